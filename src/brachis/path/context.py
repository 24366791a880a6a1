"""The context of a segment: its key, its start, and the checks that all functions for building curves share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Unpack

import numpy as np

from brachis.common import tolerances
from brachis.errors import Details, PathError
from brachis.path.protocol import Array, Curve
from brachis.robot.task_map.protocol import position_rows


@dataclass(frozen=True, eq=False)
class SegmentContext:
    """The data that a function needs, besides the segment itself, to build the curve of a segment.

    Attributes
    ----------
    key : str
        Key under which the segment is described, for example ``path[0].line``.
    start : ndarray, shape (m,)
        Task coordinates at which the segment starts.
    rows : tuple of str
        Rows of the task space; for a pose, only the position rows.
    """

    key: str
    start: Array
    rows: tuple[str, ...]

    @property
    def positions(self) -> tuple[str, ...]:
        """The position rows among `rows`."""
        return position_rows(self.rows)

    @property
    def position(self) -> Array:
        """The position at which the segment starts."""
        return self.start[: len(self.positions)]

    def coordinates(
        self, values: Sequence[float], key: str, rows: Sequence[str]
    ) -> Array:
        """Return values as an array, after checking that there is one value for each of `rows`.

        Raises
        ------
        PathError
            The number of values differs from the number of rows.
        """
        if len(values) != len(rows):
            raise self.wrong(
                "wrong number of coordinates",
                f".{key}",
                found=f"{len(values)}: {list(values)}",
                allowed=f"{len(rows)}: [{', '.join(rows)}]",
            )
        return np.asarray(values, dtype=float)

    def need_rows(self, what: str, *counts: int) -> None:
        """Reject a form of segment unless the number of position rows is among `counts`.

        Raises
        ------
        PathError
        """
        if len(self.positions) not in counts:
            raise self.wrong(
                f"{what} needs {' or '.join(map(str, counts))} position rows",
                found=f"the position rows [{', '.join(self.positions)}]",
                hint="Use line: {to: [...]}, line: {by: [...]} or a spline",
            )

    def zero_length(self, key: str, found: object) -> PathError:
        """Return the error for a segment of zero length."""
        return self.wrong(
            "the segment has zero length",
            key,
            found=found,
            allowed="a motion away from the segment's start",
            hint="With task_space: pose or axis, a segment turn: {...} turns the tool on the spot",
        )

    def wrong(
        self, problem: str, key: str = "", **details: Unpack[Details]
    ) -> PathError:
        """Return an error about a key of the segment, such as ``.normal``."""
        details["where"] = f"{self.key}{key}"
        return PathError(problem, **details)


def place(rows: Sequence[str], point: Array) -> str:
    """Write coordinates in words, to the nanometre; for a pose, write only its position."""
    return ", ".join(
        f"{row} = {round(value, 9) + 0.0:.6g}"
        for row, value in zip(rows, point, strict=False)
    )


def stands_still(curve: Curve, positions: int) -> bool:
    """Return whether the position rows, which come first, do not move along a curve."""
    ends = curve.derivatives(curve.knots, 0)[0, :, :positions]
    return bool(np.ptp(ends, axis=0).max(initial=0.0) < tolerances.LENGTH)
