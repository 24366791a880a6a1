"""Speeds of the tool that are prescribed along a path, by the feed rates of its points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.arrays import freeze
from brachis.path.pose import PosePath
from brachis.path.sequence import SequencePath
from brachis.task import BSplineSegment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from brachis.path.protocol import Array, Path
    from brachis.task import Segment


@dataclass(frozen=True, eq=False)
class FeedTable:
    """Speed of the tool over the path coordinate, linear in between; outside the table none is prescribed.

    Attributes
    ----------
    s : (k,) ndarray
        Path coordinates, ascending, at least two.
    speed : (k,) ndarray
        m/s.
    """

    s: Array
    speed: Array

    def __post_init__(self) -> None:
        """Take copies of the arrays that nobody can write to."""
        freeze(self, "s", "speed")

    def at(self, s: Array) -> Array:
        """Return the speed at values of s, (K,); infinite outside the table."""
        return np.asarray(np.interp(s, self.s, self.speed, left=np.inf, right=np.inf))


def feed_tables(segments: Sequence[Segment], path: Path) -> tuple[FeedTable, ...]:
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
    return tuple(FeedTable(s, speed) for s, speed in tables)
