"""Plots over time: joint quantities, torques, ratios to limits, path coordinate, tool speed, and an overview."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from brachis.apps.bottleneck.saturation import (
    RIPPLE,
    THRESHOLD,
    dense_samples,
    knot_times,
    limit_ratios,
    saturations,
)
from brachis.apps.plots import style
from brachis.apps.plots.panels import (
    BLACK,
    Panel,
    panels_of,
    ratio_panel,
    titles_of,
    tool_rows_of,
    torque_panels,
)
from brachis.apps.plots.postures import draw_postures
from brachis.limits import Limit
from brachis.trajectory import Samples, Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import GridSpecBase, SubplotSpec

_MOST_TICKS = 100
"""Maximum number of knots that are drawn as ticks.

Hundreds of ticks would merge into a grey bar and take seconds to draw.
"""


@of_motion
def plot_motion(trajectory: Trajectory) -> Figure:
    """Plot q, dq/dt, s, the tool's speed and the smallest distance between bodies over one time axis.

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        Figure one column wide. Thin dashed lines are limits in the colours of their joints, drawn where the motion
        comes close to them. The faint ticks are the knots of the splines.
    """
    rows = ("position", "velocity", "path coordinate", *tool_rows_of(trajectory))
    return _stack(trajectory, panels_of(trajectory, dense_samples(trajectory), *rows))


@of_motion
def plot_torques(trajectory: Trajectory) -> Figure:
    """Plot the normalised joint torques and forces with the band of allowed values (Fig. 2 of the paper).

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        Figure one column wide. Joints without a limit are left out. If no joint has a limit, the torques themselves are
        shown, with the forces of prismatic joints in a panel below. The faint ticks are the knots of the splines.

    Raises
    ------
    UrdfError
        The URDF has no masses, so the torques are unknown.

    Examples
    --------
    >>> from brachis import plan
    >>> from brachis.apps.plots import plot_torques, save_figure
    >>> save_figure(plot_torques(plan("examples/01_scara_line.yaml").trajectory), "torques.pdf")  # doctest: +SKIP
    """
    trajectory.robot.check_masses("torques")
    samples = dense_samples(trajectory)
    return _stack(
        trajectory, torque_panels(trajectory, samples, limit_ratios(trajectory))
    )


@of_motion
def plot_limits(
    trajectory: Trajectory, limits: Sequence[Limit] | None = None
) -> Figure:
    """Plot the ratios to the limits of all kinds. For positions, the ratio shows the place within the range.

    Parameters
    ----------
    trajectory : Trajectory, Result or path
        Any motion, for example a saved one.
    limits : sequence of Limit, optional
        Limits to compare with. Default: the limits of the trajectory's task.

    Returns
    -------
    Figure
        Figure one column wide, with a panel for every kind of limit and a line for every joint or other value that it
        limits. Dashed lines are the limits. The faint ticks are the knots of the splines.

    Examples
    --------
    >>> from brachis import Trajectory
    >>> from brachis.apps.plots import plot_limits, save_figure
    >>> save_figure(plot_limits(Trajectory.load("out/result.npz")), "limits.pdf")  # doctest: +SKIP
    """
    ratios = limit_ratios(trajectory, limits)
    panels = [ratio_panel(trajectory, ratios, title) for title in titles_of(ratios)]
    return _stack(trajectory, panels)


@of_motion
def plot_overview(trajectory: Trajectory) -> Figure:
    """Plot postures, active limits, positions, velocities, path coordinate and tool speed, two columns wide.

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        The panels at the top right show the kinds of limits that are active longest, at most three. If no limit is
        active, these panels show torques and forces, or accelerations if the URDF has no masses. All panels also appear
        in `plot_postures`, `plot_torques`, `plot_limits` or `plot_motion`.
    """
    samples = dense_samples(trajectory)
    columns = [
        panels_of(trajectory, samples, *rows)
        for rows in (("position", "path coordinate"), ("velocity", "tool speed"))
    ]
    heights = [74.0, *(1.2 * _height(panel) for panel in columns[0])]
    figure = style.new_figure(style.PAGE_WIDTH, sum(heights) + 11.0)
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    postures = draw_postures(figure, trajectory, samples, grid[0, 0])
    style.legend_above(postures, 0.5 * style.PAGE_WIDTH - 10.0)
    draw_holding(figure, grid[0, 1], trajectory, samples)
    joints = []
    for column, panels in enumerate(columns):
        joints += draw_panels(figure, grid, trajectory, panels, row=1, column=column)
    style.legend_below(figure, lines_of(joints, trajectory))
    return figure


def draw_holding(
    figure: Figure, place: SubplotSpec, trajectory: Trajectory, samples: Samples
) -> list[Axes]:
    """Draw the limits that slow the motion down, one panel below the other; see `plot_overview`."""
    ratios = limit_ratios(trajectory)
    shares = dict.fromkeys(titles_of(ratios), 0.0)
    for entry in saturations(ratios):
        shares[entry.label.axis] += entry.share
    longest = sorted(shares, key=shares.__getitem__, reverse=True)[:3]
    active = [title for title in longest if shares[title] > 0.0]
    torques = torque_panels(trajectory, samples, ratios)
    torques = torques or panels_of(trajectory, samples, "acceleration")
    other_titles = [
        title for title in active if title not in torques[0].title.split(", ")
    ]
    shown = [] if active and other_titles == active else torques
    shown += [ratio_panel(trajectory, ratios, title) for title in other_titles]
    grid = place.subgridspec(len(shown), 1)
    axes = draw_panels(figure, grid, trajectory, shown)
    style.mark_end(axes[0], trajectory.t_end)
    if len(axes) > 2:
        for ax in axes:
            label = ax.get_ylabel()
            if "$" not in label:
                label = textwrap.fill(label, 16)
            ax.set_ylabel(label, fontsize=style.LABEL_SIZE)
    figure.align_ylabels(axes)
    return axes


def _stack(trajectory: Trajectory, panels: Sequence[Panel]) -> Figure:
    """Draw panels one below the other, one column wide, with a common legend."""
    heights = [_height(panel) for panel in panels]
    figure = style.new_figure(style.COLUMN_WIDTH, sum(heights) + 20.0)
    grid = figure.add_gridspec(len(panels), 1, height_ratios=heights)
    axes = draw_panels(figure, grid, trajectory, panels)
    style.legend_above(axes[0], style.COLUMN_WIDTH - 15.0, lines_of(axes, trajectory))
    style.mark_end(axes[-1], trajectory.t_end)
    return figure


def _height(panel: Panel) -> float:
    """Return the height of a panel, mm. A panel with few curves is less high."""
    return 38.0 if len(panel.curves) > 2 else 24.0


def draw_panels(
    figure: Figure,
    grid: GridSpecBase,
    trajectory: Trajectory,
    panels: Sequence[Panel],
    *,
    row: int = 0,
    column: int = 0,
) -> list[Axes]:
    """Draw panels into a column of a grid, from `row` downwards, over one time axis."""
    axes = []
    for number, panel in enumerate(panels):
        ax = figure.add_subplot(grid[row + number, column])
        _draw_panel(ax, panel)
        dress(ax, trajectory, panel.label)
        style.mark_phases(ax, trajectory, labels=number == 0)
        axes.append(ax)
    for ax in axes[:-1]:
        ax.sharex(axes[-1])
        ax.tick_params(labelbottom=False)
        ax.set_xlabel("")
    figure.align_ylabels(axes)
    return axes


def _draw_panel(ax: Axes, panel: Panel) -> None:
    """Draw one line for each curve, and the limits. Curves with the same limit share its dashed line."""
    for curve in panel.curves:
        label = style.plain(curve.name) if curve.style != BLACK else None
        ax.plot(panel.t, curve.values, label=label, **style.joint_style(curve.style))
    ends = panel.view()
    for limit, curves in panel.near_limits():
        if panel.is_ratio:
            level = limit[0]
            ax.axhline(level, color=style.GREY, **style.LIMIT)
            outer = np.sign(level) * ends[1]
            ax.axhspan(level, outer, facecolor="#EFEFEF", edgecolor="none", zorder=0.0)
            continue
        for place, curve in enumerate(curves):
            look = {**style.joint_style(curve.style), **style.LIMIT}
            look["linestyle"] = style.limit_dashes(place, len(curves))
            ax.plot(panel.t, limit, label="limit", **look)
    if panel.is_ratio:
        ax.axhline(0.0, color=style.FAINT, linewidth=0.6, zorder=0.5)
    ax.set_ylim(ends)


def lines_of(axes: Sequence[Axes], trajectory: Trajectory) -> dict[str, Artist]:
    """Collect one line for each subject shown in the axes, by its label. Joints come first, in chain order."""
    lines = style.lines_by_label(axes)
    joints = [style.plain(name) for name in trajectory.joint_names]
    return {name: lines[name] for name in (*joints, *lines) if name in lines}


def dress(ax: Axes, trajectory: Trajectory, ylabel: str) -> None:
    """Set the labels, with time to the right, and mark the splines' knots as ticks unless they would merge."""
    style.dress(ax, r"$t$ (s)", ylabel)
    ax.set_xlim(0.0, trajectory.t_end)
    knots = knot_times(trajectory)[1:-1]
    if len(knots) <= _MOST_TICKS:
        ax.set_xticks(knots, minor=True)
    ax.tick_params(axis="x", which="minor", length=2.0, color="#A0A0A0", width=0.5)


@of_motion
def plot_timeline(
    trajectory: Trajectory, limits: Sequence[Limit] | None = None
) -> Figure:
    """Plot how close the motion is to each limit over time.

    Parameters
    ----------
    trajectory : Trajectory, Result or path
        Any motion, for example a saved one.
    limits : sequence of Limit, optional
        Limits to compare with. Default: the limits of the trajectory's task.

    Returns
    -------
    Figure
        Figure two columns wide, with a row for each limited value that ever uses more than half of its limit. Rows that
        hardly change are left out. A deeper blue means closer to the limit. Orange means that the limit is active: at
        99 % of it or more, including ripple down to 95 %. The faint ticks are the knots of the splines.

    Examples
    --------
    >>> from brachis import Trajectory
    >>> from brachis.apps.plots import plot_timeline, save_figure
    >>> save_figure(plot_timeline(Trajectory.load("out/result.npz")), "timeline.pdf")  # doctest: +SKIP
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.patches import Patch

    ratios = limit_ratios(trajectory, limits)
    used = dict(zip(ratios.labels, np.abs(ratios.values.T), strict=True))
    entries = [entry for entry in saturations(ratios) if entry.is_drawn]
    entries.sort(key=lambda entry: ratios.labels.index(entry.label))
    rows = max(len(entries), 1)
    figure = style.new_figure(style.PAGE_WIDTH, 26.0 + 5.0 * rows)
    ax = figure.add_subplot()
    orange = style.COLOURS[1]
    thick = 0.84  # height of a bar, as a fraction of the distance between rows
    for row, entry in enumerate(entries):
        ratio = used[entry.label]
        cells = 0.5 * (ratio[1:] + ratio[:-1])[None]
        edges = (row - 0.5 * thick, row + 0.5 * thick)
        ax.pcolormesh(
            ratios.t,
            edges,
            cells,
            cmap="Blues",
            vmin=0.0,
            vmax=1.0,
            shading="flat",
            rasterized=True,
        )
        spans = [(active.begin, active.end - active.begin) for active in entry.active]
        ax.broken_barh(spans, (edges[0], thick), color=orange, linewidth=0.8)
    dress(ax, trajectory, "")
    style.mark_phases(ax, trajectory, labels=False)
    ax.set_ylim(rows - 0.5, -0.5)
    ax.set_yticks(
        range(len(entries)),
        [style.plain(str(row_entry.label)) for row_entry in entries],
    )
    ax.tick_params(axis="y", length=0.0)
    if not entries:
        style.write(
            ax,
            0.5,
            0.5,
            "no value uses more than half of its limit, apart from constant ones",
            ha="center",
        )
    blue = ScalarMappable(Normalize(0.0, 1.0), "Blues")
    bar = figure.colorbar(blue, ax=ax, pad=0.01, fraction=0.03)
    style.dress(bar.ax, "", "fraction of the limit")
    words = f"active: at {100.0 * THRESHOLD:g} % of the limit or more, including ripple down to {100.0 * RIPPLE:g} %"
    style.legend_above(ax, style.PAGE_WIDTH - 20.0, {words: Patch(facecolor=orange)})
    ax.set_xlabel(f"{ax.get_xlabel()}, {style.end_text(trajectory.t_end)}")
    return figure
