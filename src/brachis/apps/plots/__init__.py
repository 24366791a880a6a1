"""Figures of a trajectory. Each plot is one function in this package and one row of `PLOTS`.

Every function returns a new Matplotlib figure, and uses neither pyplot nor Matplotlib's global settings. Matplotlib is
imported when the first figure is made.

Examples
--------
>>> import brachis
>>> sorted(brachis.plots.PLOTS)[:3]
['fit', 'limits', 'motion']
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from brachis.apps.plots.comparison import plot_candidates, plot_comparison, plot_fit
from brachis.apps.plots.motion import (
    plot_limits,
    plot_motion,
    plot_overview,
    plot_timeline,
    plot_torques,
)
from brachis.apps.plots.postures import plot_postures
from brachis.apps.plots.style import SUFFIXES, as_html, check_suffix, save_figure
from brachis.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLOTS: dict[str, Callable[[Trajectory], Figure]] = {
    "torques": plot_torques,
    "postures": plot_postures,
    "motion": plot_motion,
    "overview": plot_overview,
    "timeline": plot_timeline,
    "limits": plot_limits,
    "fit": plot_fit,
}
"""Plots of one trajectory, by name.

`plot_comparison` compares many plans; `plot_candidates` shows the results of a search.
"""

__all__ = [
    "PLOTS",
    "SUFFIXES",
    "as_html",
    "check_suffix",
    "plot_candidates",
    "plot_comparison",
    "plot_fit",
    "plot_limits",
    "plot_motion",
    "plot_overview",
    "plot_postures",
    "plot_timeline",
    "plot_torques",
    "save_figure",
]
__dir__ = __all__.copy  # what tab completion shows
