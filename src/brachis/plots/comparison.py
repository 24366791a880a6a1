"""End times of many plans side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from brachis.errors import InputError
from brachis.plots import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BARS_PER_PANEL = 48
_GROUP_WIDTH = 0.84
_HEADROOM = 1.27


def plot_comparison(rows: Sequence[tuple[float, str, float]]) -> Figure:
    """Plot the end time over the path's direction, one bar for each choice of the redundant joint.

    Parameters
    ----------
    rows : sequence of (angle_deg, redundant_joint, t_end)
        Direction of the path in degrees, name of the redundant joint, end time in s. An end time of NaN marks a
        plan that was not found. Joints keep the order in which they first appear; angles are sorted.

    Returns
    -------
    Figure
        Two columns wide, with more panels below where there are many angles. The shortest time of every direction
        is printed in bold type.

    Raises
    ------
    InputError
        There are no rows, an angle is not finite, a time is not positive, or a pair of angle and joint comes twice.

    Examples
    --------
    >>> from brachis.plots import plot_comparison
    >>> figure = plot_comparison([(0.0, "j1", 2.1), (0.0, "j3", 2.4), (90.0, "j1", 2.3), (90.0, "j3", 2.5)])
    """
    cells = _cells(rows)
    angles = sorted({angle for angle, _ in cells})
    joints = list(dict.fromkeys(joint for _, joint in cells))
    panels = math.ceil(len(angles) / max(1, _BARS_PER_PANEL // len(joints)))
    per_panel = math.ceil(len(angles) / panels)
    figure = style.new_figure(style.PAGE_WIDTH, 12.0 + 58.0 * panels)
    height = _HEADROOM * max((t_end for t_end in cells.values() if t_end > 0.0), default=1.0)
    for panel in range(panels):
        ax = figure.add_subplot(panels, 1, panel + 1)
        _draw(ax, angles[panel * per_panel : (panel + 1) * per_panel], joints, cells)
        ax.set_xlim(-0.5, per_panel - 0.5)
        ax.set_ylim(0.0, height)
        if panel < panels - 1:
            ax.set_xlabel("")
        if panel == 0:
            style.legend_above(ax, style.PAGE_WIDTH - 20.0)
    return figure


def _cells(rows: Sequence[tuple[float, str, float]]) -> dict[tuple[float, str], float]:
    """Check the rows and key them by angle and joint."""
    if not rows:
        raise InputError("there is nothing to compare", where="rows", found="no rows", allowed="at least one")
    cells: dict[tuple[float, str], float] = {}
    for number, (angle, joint, t_end) in enumerate(rows):
        where = f"rows[{number}]"
        if not math.isfinite(angle):
            raise InputError("is not an angle", where=where, found=f"{angle}", allowed="a finite number of degrees")
        if not (math.isnan(t_end) or 0.0 < t_end < math.inf):
            raise InputError("is not an end time", where=where, found=f"{t_end} s", allowed="> 0 s, or NaN for no plan")
        if (angle, joint) in cells:
            raise InputError("comes twice", where=where, found=f"{angle:g} degrees with {joint!r}")
        cells[angle, joint] = t_end
    return cells


def _draw(ax: Axes, angles: Sequence[float], joints: Sequence[str], cells: Mapping[tuple[float, str], float]) -> None:
    """Draw one panel of grouped bars with their values; pairs without a row leave a gap."""
    width = _GROUP_WIDTH / len(joints)
    found = {pair: t_end for pair, t_end in cells.items() if not math.isnan(t_end)}
    for column, joint in enumerate(joints):
        shift = (column - 0.5 * (len(joints) - 1)) * width
        places = [place + shift for place, angle in enumerate(angles) if (angle, joint) in found]
        times = [found[angle, joint] for angle in angles if (angle, joint) in found]
        colour = style.joint_style(column)["color"]
        ax.bar(places, times, 0.9 * width, color=colour, label=style.plain(joint))
        for place, angle in enumerate(angles):
            if (angle, joint) in cells:
                best = min((found[angle, other] for other in joints if (angle, other) in found), default=math.nan)
                _write(ax, place + shift, cells[angle, joint], bold=cells[angle, joint] == best)
    style.dress(ax, "direction of the path", r"$t_\mathrm{E}$ (s)")
    ax.set_xticks(range(len(angles)), [f"{angle:g}\N{DEGREE SIGN}" for angle in angles])
    ax.tick_params(axis="x", length=0.0)


def _write(ax: Axes, place: float, value: float, *, bold: bool) -> None:
    """Write a value above its bar."""
    ax.annotate(
        "no plan" if math.isnan(value) else f"{value:.3f}",
        (place, 0.0 if math.isnan(value) else value),
        xytext=(0.0, 2.0),
        textcoords="offset points",
        rotation=90.0,
        fontsize=style.TICK_SIZE - 0.5,
        fontweight="bold" if bold else "normal",
        horizontalalignment="center",
        verticalalignment="bottom",
    )
