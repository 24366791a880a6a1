"""The end times of all that a search looked at."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from brachis.attempt import Attempt, coordinates
from brachis.errors import InputError
from brachis.plots import style
from brachis.search.record import SAME_MOTION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ROW_MM = 5.0
_FRAME_MM = 24.0
_MARKS: dict[str, dict[str, Any]] = {
    "planned": {
        "marker": "o",
        "facecolors": "none",
        "edgecolors": style.GREY,
        "label": "planned; as much longer or shorter as refining made the fastest",
    },
    "refined": {"marker": "s", "color": style.COLOURS[0], "label": "refined and verified"},
    "failed": {"marker": "x", "color": style.COLOURS[1], "label": "no verified motion (at the right edge without any)"},
    "fastest": {"marker": "*", "color": style.COLOURS[2], "s": 60.0, "label": "the fastest"},
}


def plot_candidates(candidates: Sequence[Attempt]) -> Figure:
    """Plot the end times of candidates, one row for each choice of redundant joints and branch.

    Parameters
    ----------
    candidates : sequence of Attempt
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
        There are no candidates, or they are something else.
    """
    if not isinstance(candidates, Sequence) or not all(isinstance(each, Attempt) for each in candidates):
        allowed = "the candidates of a result: result.candidates"
        raise InputError("wrong type", where="candidates", found=type(candidates).__name__, allowed=allowed)
    if not candidates:
        raise InputError("there is nothing to draw", where="candidates", found="none", allowed="at least one")
    candidates = [candidates[0], *(each for each in candidates[1:] if each.status != SAME_MOTION)]
    rows = list(dict.fromkeys(_row(candidate) for candidate in candidates))
    refining = candidates[0].t_end / candidates[0].coarse if math.isfinite(candidates[0].t_end) else 1.0
    known = [time for each in candidates for time in [_time(each, refining, math.inf)] if math.isfinite(time)]
    edge = 1.05 * max(known, default=1.0)
    figure = style.new_figure(style.PAGE_WIDTH, _FRAME_MM + _ROW_MM * len(rows))
    ax = figure.add_subplot()
    drawn: dict[str, list[tuple[float, int]]] = {kind: [] for kind in _MARKS}
    for number, candidate in enumerate(candidates):
        drawn[_kind(candidate, first=number == 0)].append(
            (_time(candidate, refining, edge), rows.index(_row(candidate)))
        )
    for kind, places in drawn.items():
        if places:
            times, heights = zip(*places, strict=True)
            ax.scatter(times, heights, **{"s": 18.0, "linewidths": 0.8, "zorder": 3.0, **_MARKS[kind]})
    style.dress(ax, r"$t_\mathrm{E}$ (s)", "")
    ax.set_yticks(range(len(rows)), [style.plain(row) for row in rows])
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.grid(axis="y", color=style.FAINT, linewidth=0.5)
    style.legend_above(ax, style.PAGE_WIDTH - 60.0)
    return figure


def _row(candidate: Attempt) -> str:
    found = coordinates(candidate.redundant_joints, candidate.branch)
    joints = "no redundant joint" if found == "none" else found
    return f"{joints}: {candidate.branch}" if candidate.branch not in {"", joints} else joints


def _time(candidate: Attempt, refining: float, edge: float) -> float:
    """Return the refined end time, else what refining would make of the planned one, else the right edge."""
    times = (candidate.t_end, refining * candidate.coarse)
    return next((time for time in times if math.isfinite(time)), edge)


def _kind(candidate: Attempt, *, first: bool) -> str:
    if candidate.verified:
        return "fastest" if first else "refined"
    return "planned" if math.isfinite(candidate.coarse) and not math.isfinite(candidate.t_end) else "failed"
