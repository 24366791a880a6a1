"""What is wrong with points: repetitions, spikes, other units; each named with its row."""

from __future__ import annotations

import numpy as np

from brachis.errors import TaskError, write_count
from brachis.task.points.points import Points, angles_between
from brachis.task.points.scatter import Scatter

SAME = 1e-9
"""What a path takes for standing still, m or rad."""
_NAMED = 5
_AROUND = 4
_FACTOR = (900.0, 1100.0)
_LARGEST = 100.0
"""Paths of robots are shorter, m."""


def without_repetitions(points: Points) -> tuple[Points, tuple[str, ...]]:
    """Leave out points that repeat their predecessors, and say which.

    Raises
    ------
    TaskError
        The position stands still while the tool turns, or throughout.
    """
    steps = np.linalg.norm(np.diff(points.position, axis=0), axis=1)
    again = 1 + np.flatnonzero(steps < SAME)
    turned = angles_between(points.turning[again], points.turning[again - 1])
    if np.any(turned > SAME):
        i = int(again[np.argmax(turned > SAME)])
        raise points.wrong(
            i,
            f"the position stands still from {points.name_row(i - 1)} on while the tool turns",
            found=points.describe(i),
            allowed="a motion of the position",
            hint="A path that stops and turns on the spot is for segments of its own: csv, turn, csv",
        )
    kept = points.only(np.setdiff1d(np.arange(len(points)), again))
    if len(kept) < 2:
        raise TaskError(
            "the position does not move",
            found=f"{len(points)} times the same",
            allowed="a motion",
            where=points.source,
        )
    if not again.size:
        return points, ()
    left_out = (
        f"left out {write_count(len(again), 'row')} at the place of the row before"
    )
    return kept, (f"{left_out}: {points.row}s {_list_rows(points, again)}",)


def refuse_repetitions(points: Points) -> None:
    """Refuse a row whose position repeats its predecessor's: a curve through all points would have to stop there.

    Where the position stands still in the whole file, the tool turns on the spot, and it is the angles that count.

    Raises
    ------
    TaskError
    """
    still = bool(
        np.all(np.linalg.norm(points.position - points.position[0], axis=1) < SAME)
    )
    if still:
        steps = angles_between(points.turning[1:], points.turning[:-1])
    else:
        steps = np.linalg.norm(np.diff(points.position, axis=0), axis=1)
    if np.any(steps < SAME):
        i = 1 + int(np.argmax(steps < SAME))
        raise points.wrong(
            i,
            f"the row repeats {points.name_row(i - 1)}",
            found=points.describe(i),
            allowed=f"rows that differ from their predecessors in {'orientation' if still else 'position'}",
            hint="With a tolerance repeated rows are left out",
        )


def refuse_spikes(points: Points, scatter: Scatter, tolerance: float) -> None:
    """Refuse a point that is far off the line between its neighbours, or where the unit seems to change.

    Raises
    ------
    TaskError
    """
    _refuse_factors(points)
    if len(points) < 10:
        return
    position = points.position
    before = position[:-2]
    here = position[1:-1]
    after = position[2:]
    side = after - before
    share = np.clip(
        np.sum((here - before) * side, axis=1)
        / np.maximum(np.sum(side**2, axis=1), SAME**2),
        0.0,
        1.0,
    )
    off = np.linalg.norm(here - before - share[:, None] * side, axis=1)
    chords = np.linalg.norm(np.diff(position, axis=0), axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(chords, _AROUND, mode="reflect"), 2 * _AROUND + 2
    )
    usual = np.median(windows, axis=1)[: len(off)]
    allowed = np.maximum(4.0 * usual, max(15.0 * scatter.deviation, 2.0 * tolerance))
    i = int(np.argmax(off / allowed))
    if off[i] > allowed[i]:
        away = f"{1e3 * off[i]:.4g} mm off the line between its neighbours; points are {1e3 * usual[i]:.3g} mm apart"
        raise points.wrong(
            i + 1,
            "the point is a spike, far off its neighbours",
            found=f"{points.describe(i + 1)}, {away}",
            allowed=f"at most {1e3 * allowed[i]:.3g} mm",
            hint="Correct or remove the row",
        )


def of_size(points: Points) -> str | None:
    """Say that the whole path looks like mm where m are stated, or the other way round; None where it does not."""
    extent = float(np.linalg.norm(np.ptp(points.position, axis=0)))
    if extent > _LARGEST:
        return f"the path is {extent:.4g} m long and wide: mm for m? Set units: {{length: mm}}"
    if extent < 1e-4:
        return f"the path is {1e3 * extent:.4g} mm long and wide: m for mm? Set units: {{length: m}}"
    return None


def _refuse_factors(points: Points) -> None:
    """Refuse a step after which all coordinates are a thousand times larger or smaller."""
    sizes = np.linalg.norm(points.position, axis=1)
    ratios = sizes[1:] / np.maximum(sizes[:-1], SAME)
    growth = np.maximum(ratios, 1.0 / np.maximum(ratios, SAME))
    steps = np.linalg.norm(np.diff(points.position, axis=0), axis=1)
    far = steps > 20.0 * np.median(steps)
    for i in np.flatnonzero(
        far & (growth > _FACTOR[0]) & (growth < _FACTOR[1])
    ).tolist():
        one = points.position[i]
        other = points.position[i + 1]
        small, large = (one, other) if ratios[i] > 1.0 else (other, one)
        if np.linalg.norm(large / 1e3 - small) < 0.1 * np.linalg.norm(small):
            word = "larger" if ratios[i] > 1.0 else "smaller"
            raise points.wrong(
                i + 1,
                f"the coordinates are a thousand times {word} than in {points.name_row(i)}",
                found=points.describe(i + 1),
                allowed=f"near {points.describe(i)}",
                hint="mm and m, or a lost decimal point? Write all rows in one unit",
            )


def _list_rows(points: Points, indices: np.ndarray) -> str:
    more = ", ..." if len(indices) > _NAMED else ""
    return ", ".join(str(points.rows[i]) for i in indices[:_NAMED]) + more
