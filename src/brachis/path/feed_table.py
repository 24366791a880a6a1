"""Largest speeds of the tool along a path, by the feed rates of its points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from brachis.path.pose import PosePath
from brachis.path.sequence import SequencePath
from brachis.task import BSplineSegment, SpeedTable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from brachis.path.protocol import Array, Path
    from brachis.task import Segment, Task


def feed_tables(segments: Sequence[Segment], path: Path) -> tuple[SpeedTable, ...]:
    """Return the tables of a task's segments on the path that was built of them, in order.

    Where one segment's table ends with it and the next one's begins with that, they are one, over the blend between.

    Parameters
    ----------
    segments : sequence of Segment
        Those of the task.
    path : Path
        Built of them by `build_path`.
    """
    sequence = path.coordinates if isinstance(path, PosePath) else path
    if not isinstance(sequence, SequencePath):
        return ()
    tables: list[tuple[Array, Array]] = []
    goes_on = False
    for begin, end, piece in zip(sequence.breaks, sequence.breaks[1:], sequence.pieces, strict=False):
        if piece.segment is None:
            continue
        segment = segments[piece.segment]
        for sigma, speed in map(np.transpose, segment.bspline.speeds if isinstance(segment, BSplineSegment) else ()):
            at = np.unique(np.clip(sigma, piece.first, piece.last))
            if len(at) > 1:
                s = np.interp(at, [piece.first, piece.last], [begin, end])
                at_start = goes_on and sigma[0] <= piece.first
                before = tables.pop() if at_start and tables else (np.empty(0), np.empty(0))
                values = np.interp(at, sigma, speed)
                tables.append((np.append(before[0], s), np.append(before[1], values)))
            goes_on = bool(sigma[-1] >= piece.last)
        if not isinstance(segment, BSplineSegment) or not segment.bspline.speeds:
            goes_on = False
    return tuple(SpeedTable(s=tuple(s.tolist()), speed=tuple(speed.tolist())) for s, speed in tables)


def with_feed_rates(task: Task, path: Path) -> Task:
    """Return the task with the feed rates of its path's points among its limits on the tool."""
    tables = feed_tables(task.path, path)
    if not tables:
        return task
    return task.model_copy(update={"tool_limits": task.tool_limits.model_copy(update={"feed": tables})})
