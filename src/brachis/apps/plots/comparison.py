"""Plots of the end times of plans and candidates, and of the errors of paths fitted to points."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps.plots import style
from brachis.common.arguments import check_list
from brachis.errors import InputError
from brachis.search.stages import RANKED, SLOW, Candidate, coordinates
from brachis.trajectory import Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Case = float | str
"""Case that was planned: the value of a number that varies, or a name."""


def plot_comparison(
    rows: Sequence[tuple[Case, str, float]], xlabel: str = "", unit: str = ""
) -> Figure:
    """Plot the end times of cases, one bar for each choice.

    Parameters
    ----------
    rows : sequence of (case, choice, t_end)
        The case is what was planned (a direction, a payload, the name of a path, ...). The choice is what was chosen
        for it (redundant joints, a branch, a robot, ...). The end time is in s; NaN means that no plan was found.
        Choices keep the order in which they first appear. Cases do so as well, unless all of them are numbers; then
        they are sorted.
    xlabel : str, optional
        Label of the axis of cases.
    unit : str, optional
        Text appended to every case. Begin it with a space if a space is wanted.

    Returns
    -------
    Figure
        Figure two columns wide, with several panels if there are many cases. The shortest time of each case is in bold
        type.

    Raises
    ------
    InputError
        `rows` is empty, a case is not finite, a time is not positive, or the same case and choice occur twice.

    Examples
    --------
    >>> from brachis.apps.plots import plot_comparison
    >>> rows = [("seam", "rail", 2.1), ("seam", "joint_1", 2.4), ("hem", "rail", 2.3), ("hem", "joint_1", 2.5)]
    >>> figure = plot_comparison(rows, "path")
    """
    cells = _cells(rows)
    cases: list[Case] = list(dict.fromkeys(case for case, _ in cells))
    if not any(isinstance(case, str) for case in cases):
        cases.sort(key=float)
    choices = list(dict.fromkeys(choice for _, choice in cells))
    panels = math.ceil(len(cases) / max(1, 48 // len(choices)))
    per_panel = math.ceil(len(cases) / panels)
    figure = style.new_figure(style.PAGE_WIDTH, 12.0 + 58.0 * panels)
    height = 1.27 * max((t_end for t_end in cells.values() if t_end > 0.0), default=1.0)
    for panel in range(panels):
        ax = figure.add_subplot(panels, 1, panel + 1)
        style.dress(ax, xlabel if panel == panels - 1 else "", r"$t_\mathrm{E}$ (s)")
        shown = cases[panel * per_panel : (panel + 1) * per_panel]
        _draw_bars(ax, shown, choices, cells)
        names = [style.plain(f"{_name(case)}{unit}") for case in shown]
        ax.set_xticks(range(len(shown)), names)
        ax.tick_params(axis="x", length=0.0)
        ax.set_xlim(-0.5, per_panel - 0.5)
        ax.set_ylim(0.0, height)
    style.legend_above(figure.axes[0], style.PAGE_WIDTH - 20.0)
    return figure


def _cells(rows: Sequence[tuple[Case, str, float]]) -> dict[tuple[Case, str], float]:
    """Check the rows, and return the end times by case and choice."""
    check_list(rows, "rows", _ROW)
    if not rows:
        raise InputError("the list of rows is empty", where="rows", allowed=_ROW)
    cells: dict[tuple[Case, str], float] = {}
    for number, row in enumerate(rows):
        where = f"rows[{number}]"
        if not _is_row(row):
            problem = "the row is not valid"
            raise InputError(problem, where=where, found=repr(row), allowed=_ROW)
        case, choice, t_end = row
        if (case, choice) in cells:
            problem = "this case and choice are already in another row"
            raise InputError(
                problem, where=where, found=f"{_name(case)} with {choice!r}"
            )
        cells[case, choice] = t_end
    return cells


_ROW = "(case, choice, end time in s); the case is a finite number or a name, the time > 0 s or NaN for no plan"


def _is_row(row: object) -> bool:
    """Return whether something is a valid row."""
    if not isinstance(row, Sequence) or isinstance(row, str) or len(row) != 3:
        return False
    case, _, t_end = row
    is_case = isinstance(case, str) or math.isfinite(case)
    return is_case and (math.isnan(t_end) or 0.0 < t_end < math.inf)


def _name(case: Case) -> str:
    return case if isinstance(case, str) else f"{case:g}"


def _draw_bars(
    ax: Axes,
    cases: Sequence[Case],
    choices: Sequence[str],
    cells: Mapping[tuple[Case, str], float],
) -> None:
    """Draw one panel of grouped bars with their values above them. A case and choice without a row leave a gap."""
    width = 0.84 / len(choices)
    for column, choice in enumerate(choices):
        shift = (column - 0.5 * (len(choices) - 1)) * width
        bars = {}
        for place, case in enumerate(cases):
            if (case, choice) not in cells:
                continue
            t_end = cells[case, choice]
            has_plan = not math.isnan(t_end)
            if has_plan:
                bars[place + shift] = t_end
            end_times = [cells.get((case, rival), math.inf) for rival in choices]
            is_best = has_plan and not any(time < t_end for time in end_times)
            ax.annotate(
                f"{t_end:.3f}" if has_plan else "no plan",
                (place + shift, bars.get(place + shift, 0.0)),
                xytext=(0.0, 2.0),
                textcoords="offset points",
                rotation=90.0,
                fontsize=style.TICK_SIZE - 0.5,
                fontweight="bold" if is_best else "normal",
                horizontalalignment="center",
                verticalalignment="bottom",
            )
        ax.bar(
            list(bars),
            list(bars.values()),
            0.9 * width,
            label=style.plain(choice),
            color=style.COLOURS[column % len(style.COLOURS)],
            hatch=style.HATCHES[column % len(style.HATCHES)],
            edgecolor="white",
            linewidth=0.0,
        )


_MARKS: dict[str, dict[str, Any]] = {
    "planned": {
        "marker": "o",
        "facecolors": "none",
        "edgecolors": style.GREY,
        "label": "not finished; estimated by the ratio of end time to timing of the fastest",
    },
    "refined": {
        "marker": "s",
        "color": style.COLOURS[0],
        "label": "refined and verified",
    },
    "failed": {
        "marker": "x",
        "color": style.COLOURS[1],
        "label": "no verified motion (at the right edge if there was no motion)",
    },
    "fastest": {
        "marker": "*",
        "color": style.COLOURS[2],
        "s": 60.0,
        "label": "the fastest",
    },
}


def plot_candidates(candidates: Sequence[Candidate]) -> Figure:
    """Plot the end times of candidates, with one row for each choice of redundant joints and branch.

    Parameters
    ----------
    candidates : sequence of Candidate
        Candidates in the order of a `Result`: the fastest verified one comes first.

    Returns
    -------
    Figure
        Figure two columns wide; the row of the fastest candidate is at the top. An unfinished candidate is drawn at the
        least time along its joint path, multiplied by the fastest candidate's ratio of end time to least time. Finished
        and unfinished candidates can therefore be compared.

    Raises
    ------
    InputError
        `candidates` is empty, or contains something other than candidates.
    """
    check_list(candidates, "candidates", "candidates")
    if not candidates or not all(isinstance(entry, Candidate) for entry in candidates):
        raise InputError(
            "the list of candidates is empty, or has entries that are not candidates",
            where="candidates",
            found=f"{candidates!r:.60}",
            allowed="the candidates of a result: result.candidates",
        )
    fastest = candidates[0]
    rows = list(dict.fromkeys(_row(candidate) for candidate in candidates))
    refining = 1.0
    if math.isfinite(fastest.t_end) and math.isfinite(fastest.estimate):
        refining = fastest.t_end / fastest.estimate
    drawn: dict[str, list[tuple[float, int]]] = {kind: [] for kind in _MARKS}
    for candidate in candidates:
        time = candidate.t_end
        kind = "failed"
        if candidate.verified:
            kind = "fastest" if candidate is fastest else "refined"
        elif candidate.status in {RANKED, SLOW}:
            kind = "planned"
            time = refining * candidate.estimate
        drawn[kind].append((time, rows.index(_row(candidate))))
    known = [time for marks in drawn.values() for time, _ in marks if time < math.inf]
    edge = 1.05 * max(known, default=1.0)
    figure = style.new_figure(style.PAGE_WIDTH, 24.0 + 5.0 * len(rows))
    ax = figure.add_subplot()
    for kind, marks in drawn.items():
        if marks:
            times, heights = np.array(marks).T
            look = {"s": 18.0, "linewidths": 0.8, "zorder": 3.0, **_MARKS[kind]}
            ax.scatter(np.where(np.isfinite(times), times, edge), heights, **look)
    style.dress(ax, r"$t_\mathrm{E}$ (s)", "")
    ax.set_yticks(range(len(rows)), [style.plain(row) for row in rows])
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.grid(axis="y", color=style.FAINT, linewidth=0.5)
    style.legend_above(ax, style.PAGE_WIDTH - 60.0)
    return figure


def _row(candidate: Candidate) -> str:
    """Return the name of a candidate's row: its redundant joints and its branch."""
    name = coordinates(candidate.redundant_joints, candidate.branch)
    joints = "no redundant joint" if name == "none" else name
    is_named = candidate.branch not in {"", joints}
    return f"{joints}: {candidate.branch}" if is_named else joints


@of_motion
def plot_fit(trajectory: Trajectory) -> Figure:
    """Plot how far the points are from the path fitted to them, in distance and angle, with the tolerances.

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        Figure one column wide, with one panel for each file or array to which the path was fitted. Dotted lines mark
        corners.

    Raises
    ------
    InputError
        The path was not fitted to points.
    """
    fits = [fit for fit in trajectory.task.fits if fit.profile]
    if not fits:
        raise InputError(
            "the path was not fitted to points: it has no fit to draw",
            allowed="the motion of a task with a path of points and a tolerance",
        )
    figure = style.new_figure(style.COLUMN_WIDTH, 45.0 * len(fits))
    for i, fit in enumerate(fits):
        ax = figure.add_subplot(len(fits), 1, i + 1)
        along, distances, angles = np.array(fit.profile).T
        mm = 1e3 * along
        style.dress(ax, "along the path (mm)", "distance (mm)")
        _draw_error(ax, mm, 1e3 * distances, 1e3 * fit.position_tolerance, 0)
        for corner in fit.corners:
            at = 1e3 * corner.distance
            ax.axvline(at, color=style.GREY, linewidth=0.6, linestyle=":")
        ax.set_xlim(0.0, 1e3 * fit.length)
        ax.set_title(style.plain(fit.source), fontsize=style.TICK_SIZE)
        if fit.orientation_error > 0.0:
            beside = ax.twinx()
            style.dress(beside, "", "angle (deg)")
            tolerance = math.degrees(fit.orientation_tolerance)
            _draw_error(beside, mm, np.rad2deg(angles), tolerance, 1)
            for axes, colour in ((ax, 0), (beside, 1)):
                axes.yaxis.label.set_color(style.COLOURS[colour])
    return figure


def _draw_error(
    ax: Axes, along: np.ndarray, errors: np.ndarray, tolerance: float, colour: int
) -> None:
    """Draw the errors of a fit along the path, with their tolerance."""
    ax.plot(along, errors, linewidth=0.6, color=style.COLOURS[colour])
    ax.axhline(tolerance, linewidth=0.8, linestyle="--", color=style.COLOURS[colour])
    ax.set_ylim(0.0, 1.15 * tolerance)
