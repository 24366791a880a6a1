"""End times of plans and of candidates side by side, and how well a path fits its points."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.apps.plots import style
from brachis.errors import InputError
from brachis.optimise.candidate import Candidate, coordinates
from brachis.search.portfolio import SAME_MOTION
from brachis.trajectory import Trajectory, of_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from brachis.task import FitReport


Case = float | str
"""What is planned: a number that is varied, or a name."""


def plot_comparison(
    rows: Sequence[tuple[Case, str, float]], xlabel: str = "", unit: str = ""
) -> Figure:
    """Plot the end times of cases, one bar for each choice.

    Parameters
    ----------
    rows : sequence of (case, choice, t_end)
        What is planned (a direction, a payload, the name of a path, ...), what is chosen for it (redundant joints, a
        branch, a robot, ...) and the end time in s; NaN marks a plan that was not found. Choices keep the order in
        which they first appear; cases too, unless all of them are numbers, which are sorted.
    xlabel : str, optional
        What the cases are.
    unit : str, optional
        Written behind every case, with a space before it if there is to be one.

    Returns
    -------
    Figure
        Two columns wide, with more panels below where there are many cases. The shortest time of every case is printed
        in bold type.

    Raises
    ------
    InputError
        `rows` is empty, a case is not finite, a time is not positive, or a pair of case and choice comes twice.

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
        _draw(
            ax, cases[panel * per_panel : (panel + 1) * per_panel], choices, cells, unit
        )
        ax.set_xlim(-0.5, per_panel - 0.5)
        ax.set_ylim(0.0, height)
        ax.set_xlabel(xlabel if panel == panels - 1 else "")
        if panel == 0:
            style.legend_above(ax, style.PAGE_WIDTH - 20.0)
    return figure


def _cells(rows: Sequence[tuple[Case, str, float]]) -> dict[tuple[Case, str], float]:
    """Check the rows and key them by case and choice."""
    if not isinstance(rows, Sequence):
        raise InputError(
            "wrong type",
            where="rows",
            found=repr(rows),
            allowed="a list of (case, choice, end time in s)",
        )
    if not rows:
        raise InputError(
            "there is nothing to compare",
            where="rows",
            found="no rows",
            allowed="at least one",
        )
    cells: dict[tuple[Case, str], float] = {}
    for number, row in enumerate(rows):
        where = f"rows[{number}]"
        if not isinstance(row, Sequence) or len(row) != 3 or isinstance(row, str):
            raise InputError(
                "wrong type",
                where=where,
                found=repr(row),
                allowed="(case, choice, end time in s)",
            )
        case, choice, t_end = row
        if not isinstance(case, str) and not math.isfinite(case):
            raise InputError(
                "is not a case",
                where=where,
                found=f"{case}",
                allowed="a finite number, or a name",
            )
        if not (math.isnan(t_end) or 0.0 < t_end < math.inf):
            raise InputError(
                "is not an end time",
                where=where,
                found=f"{t_end} s",
                allowed="> 0 s, or NaN for no plan",
            )
        if (case, choice) in cells:
            raise InputError(
                "comes twice", where=where, found=f"{_name(case)} with {choice!r}"
            )
        cells[case, choice] = t_end
    return cells


def _name(case: Case) -> str:
    return case if isinstance(case, str) else f"{case:g}"


def _draw(
    ax: Axes,
    cases: Sequence[Case],
    choices: Sequence[str],
    cells: Mapping[tuple[Case, str], float],
    unit: str,
) -> None:
    """Draw one panel of grouped bars with their values; pairs without a row leave a gap."""
    width = 0.84 / len(choices)
    found = {pair: t_end for pair, t_end in cells.items() if not math.isnan(t_end)}
    best = {
        case: min(
            (found[case, choice] for choice in choices if (case, choice) in found),
            default=math.nan,
        )
        for case in cases
    }
    for column, choice in enumerate(choices):
        shift = (column - 0.5 * (len(choices) - 1)) * width
        places = [
            place + shift for place, case in enumerate(cases) if (case, choice) in found
        ]
        times = [found[case, choice] for case in cases if (case, choice) in found]
        ax.bar(
            places,
            times,
            0.9 * width,
            label=style.plain(choice),
            **style.bar_style(column),
        )
        for place, case in enumerate(cases):
            if (case, choice) in cells:
                t_end = cells[case, choice]
                _write(ax, place + shift, t_end, bold=t_end == best[case])
    style.dress(ax, "", r"$t_\mathrm{E}$ (s)")
    ax.set_xticks(
        range(len(cases)), [style.plain(f"{_name(case)}{unit}") for case in cases]
    )
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


_MARKS: dict[str, dict[str, Any]] = {
    "planned": {
        "marker": "o",
        "facecolors": "none",
        "edgecolors": style.GREY,
        "label": "planned; as much longer or shorter as refining made the fastest",
    },
    "refined": {
        "marker": "s",
        "color": style.COLOURS[0],
        "label": "refined and verified",
    },
    "failed": {
        "marker": "x",
        "color": style.COLOURS[1],
        "label": "no verified motion (at the right edge without any)",
    },
    "fastest": {
        "marker": "*",
        "color": style.COLOURS[2],
        "s": 60.0,
        "label": "the fastest",
    },
}


def plot_candidates(candidates: Sequence[Candidate]) -> Figure:
    """Plot the end times of candidates, one row for each choice of redundant joints and branch.

    Parameters
    ----------
    candidates : sequence of Candidate
        The fastest verified one first, as a `Result` has them.

    Returns
    -------
    Figure
        Two columns wide; the row of the fastest candidate is the uppermost one. Candidates that were planned at the
        first collocation points only are drawn at that time multiplied by what refining did to the time of the fastest
        one, so that like is compared with like. What turned out to be the same motion as another is drawn once.

    Raises
    ------
    InputError
        `candidates` is empty, or has other entries than candidates.
    """
    if not isinstance(candidates, Sequence) or not all(
        isinstance(each, Candidate) for each in candidates
    ):
        allowed = "the candidates of a result: result.candidates"
        raise InputError(
            "wrong type",
            where="candidates",
            found=type(candidates).__name__,
            allowed=allowed,
        )
    if not candidates:
        raise InputError(
            "there is nothing to draw",
            where="candidates",
            found="none",
            allowed="at least one",
        )
    candidates = [
        candidates[0],
        *(each for each in candidates[1:] if each.status != SAME_MOTION),
    ]
    rows = list(dict.fromkeys(_row(candidate) for candidate in candidates))
    fastest = candidates[0]
    refining = 1.0
    if math.isfinite(fastest.t_end):
        refining = fastest.t_end / fastest.coarse
    end_times = [_time(candidate, refining, math.inf) for candidate in candidates]
    edge = 1.05 * max(filter(math.isfinite, end_times), default=1.0)
    figure = style.new_figure(style.PAGE_WIDTH, 24.0 + 5.0 * len(rows))
    ax = figure.add_subplot()
    drawn: dict[str, list[tuple[float, int]]] = {kind: [] for kind in _MARKS}
    for number, candidate in enumerate(candidates):
        drawn[_kind(candidate, first=number == 0)].append(
            (_time(candidate, refining, edge), rows.index(_row(candidate)))
        )
    for kind, places in drawn.items():
        if places:
            times, heights = zip(*places, strict=True)
            ax.scatter(
                times,
                heights,
                **{"s": 18.0, "linewidths": 0.8, "zorder": 3.0, **_MARKS[kind]},
            )
    style.dress(ax, r"$t_\mathrm{E}$ (s)", "")
    ax.set_yticks(range(len(rows)), [style.plain(row) for row in rows])
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.grid(axis="y", color=style.FAINT, linewidth=0.5)
    style.legend_above(ax, style.PAGE_WIDTH - 60.0)
    return figure


def _row(candidate: Candidate) -> str:
    found = coordinates(candidate.redundant_joints, candidate.branch)
    joints = "no redundant joint" if found == "none" else found
    return (
        f"{joints}: {candidate.branch}"
        if candidate.branch not in {"", joints}
        else joints
    )


def _time(candidate: Candidate, refining: float, edge: float) -> float:
    """Return the refined end time, else what refining would make of the planned one, else the right edge."""
    times = (candidate.t_end, refining * candidate.coarse)
    return next((time for time in times if math.isfinite(time)), edge)


def _kind(candidate: Candidate, *, first: bool) -> str:
    if candidate.verified:
        return "fastest" if first else "refined"
    return (
        "planned"
        if math.isfinite(candidate.coarse) and not math.isfinite(candidate.t_end)
        else "failed"
    )


_ROOM = 1.15


@of_motion
def plot_fit(trajectory: Trajectory) -> Figure:
    """Plot the largest distances, and angles where the tool turns, of the points from the path, and the tolerances.

    Parameters
    ----------
    trajectory : Trajectory, Result or path

    Returns
    -------
    Figure
        One column wide, one part for each file or array that the path was fitted to; dotted lines are corners. A path
        that was not fitted gives a figure that says so.
    """
    fits = [fit for fit in trajectory.task.fits if fit.profile]
    figure = style.new_figure(style.COLUMN_WIDTH, 45.0 * max(len(fits), 1))
    if not fits:
        figure.text(
            0.5,
            0.5,
            "the path was not fitted to points",
            ha="center",
            va="center",
            fontsize=style.LABEL_SIZE,
        )
    for i, fit in enumerate(fits):
        _draw_fit(figure.add_subplot(len(fits), 1, i + 1), fit)
    return figure


def _draw_fit(ax: Axes, fit: FitReport) -> None:
    along, distances, angles = np.array(fit.profile).T
    ax.plot(1e3 * along, 1e3 * distances, color=style.COLOURS[0], linewidth=0.6)
    ax.axhline(
        1e3 * fit.position_tolerance,
        color=style.COLOURS[0],
        linewidth=0.8,
        linestyle="--",
    )
    for corner in fit.corners:
        ax.axvline(
            1e3 * corner.distance, color=style.GREY, linewidth=0.6, linestyle=":"
        )
    ax.set_xlim(0.0, 1e3 * fit.length)
    ax.set_ylim(0.0, _ROOM * 1e3 * fit.position_tolerance)
    style.dress(ax, "along the path (mm)", "distance (mm)")
    ax.set_title(style.plain(fit.source), fontsize=style.TICK_SIZE)
    if fit.orientation_error > 0.0:
        beside = ax.twinx()
        beside.plot(
            1e3 * along, np.rad2deg(angles), color=style.COLOURS[1], linewidth=0.6
        )
        beside.axhline(
            np.rad2deg(fit.orientation_tolerance),
            color=style.COLOURS[1],
            linewidth=0.8,
            linestyle="--",
        )
        beside.set_ylim(0.0, _ROOM * np.rad2deg(fit.orientation_tolerance))
        style.dress(beside, "", "angle (deg)")
        beside.yaxis.label.set_color(style.COLOURS[1])
        ax.yaxis.label.set_color(style.COLOURS[0])
