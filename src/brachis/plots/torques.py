"""Joint torques and forces over time, as fractions of their limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from brachis.plots import style
from brachis.plots.curves import dense_samples, knot_times
from brachis.plots.motion import draw_joints, draw_quantity, label_time_once, legend_joints
from brachis.plots.quantities import Quantity, quantities
from brachis.trajectory import Samples, Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_RANGE = 1.15
_WHAT = "torque"


@of_motion
def plot_torques(trajectory: Trajectory) -> Figure:
    """Plot the normalised joint torques, and forces, with the band of what is allowed (Fig. 2 of the paper).

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        One column wide. Joints without a limit are left out; where no joint has one, the torques themselves are shown,
        and the forces of prismatic joints in a panel below. The faint ticks are the knots of the splines.

    Examples
    --------
    >>> from brachis import plan
    >>> from brachis.plots import plot_torques, save_figure
    >>> save_figure(plot_torques(plan("examples/01_scara_line.yaml").trajectory), "torques.pdf")  # doctest: +SKIP
    """
    found = shown_torques(trajectory, dense_samples(trajectory))
    figure = style.new_figure(style.COLUMN_WIDTH, 22.0 + 36.0 * len(found))
    panels = [figure.add_subplot(len(found), 1, row + 1) for row in range(len(found))]
    draw_torques(panels, trajectory, found)
    legend_joints(panels, trajectory, style.COLUMN_WIDTH - 15.0)
    return figure


def shown_torques(trajectory: Trajectory, samples: Samples) -> list[list[Quantity]]:
    """Torques and forces by panels: those with limits in one, all of them apart by unit where no joint has a limit."""
    found = [part.limited() for part in quantities(trajectory, samples, _WHAT)]
    limited = [part for part in found if part is not None]
    return [limited] if limited else [[part] for part in quantities(trajectory, samples, _WHAT)]


def draw_torques(panels: Sequence[Axes], trajectory: Trajectory, found: Sequence[Sequence[Quantity]]) -> None:
    """Draw what `shown_torques` found into as many axes; one labelled line per joint."""
    for ax, parts in zip(panels, found, strict=True):
        if parts[0].limited() is None:
            draw_quantity(ax, trajectory, parts[0])
        else:
            _draw_ratios(ax, trajectory, parts)
    label_time_once(panels)
    style.mark_end(panels[-1], trajectory.t_end)


def _draw_ratios(ax: Axes, trajectory: Trajectory, parts: Sequence[Quantity]) -> None:
    """Draw torques and forces over their limits, which may differ in both directions."""
    for part in parts:
        draw_joints(ax, trajectory, part, part.ratios)
    _draw_band(ax, max(float(np.abs(part.ratios).max()) for part in parts))
    labels = (rf"${part.symbol} / {part.symbol}_\mathrm{{max}}$" for part in parts)
    style.dress(ax, r"$t$ (s)", ", ".join(labels))
    style.dress_time(ax, trajectory.t_end, knot_times(trajectory))


def _draw_band(ax: Axes, largest: float) -> None:
    """Shade what is forbidden, so that the band stands out and the lines do not."""
    top = _RANGE * max(1.0, largest)
    for sign in (-1.0, 1.0):
        ax.axhline(sign, **style.LIMIT, color=style.GREY)
        ax.axhspan(sign, sign * top, facecolor=style.FORBIDDEN, edgecolor="none", zorder=0.0)
    ax.axhline(0.0, color=style.FAINT, linewidth=0.6, zorder=0.5)
    ax.set_ylim(-top, top)
