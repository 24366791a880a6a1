"""What the coordinates along a path are, to those who build it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from brachis.path.joins import Corner, Join
    from brachis.path.protocol import Array, Curve, Path
    from brachis.path.sequence import SequencePath
    from brachis.task import Segment


class Coordinates(Protocol):
    """Rows of a task space, or the coordinates of poses."""

    @property
    def rows(self) -> tuple[str, ...]:
        """Names of the first coordinates, those of the position before others."""
        ...

    def checked(self, start: Array) -> Array:
        """Return the coordinates of the path's start after a check, freed of rounding.

        Raises
        ------
        PathError, UnknownNameError
        """
        ...

    def curve(self, segment: Segment, index: int, start: Array) -> Curve:
        """Return the curve of the segment with this index in the path, from its start on.

        Raises
        ------
        PathError
            The segment has zero length, or does not fit these coordinates.
        """
        ...

    def corner(self, join: Join, first: Curve, second: Curve) -> Corner | None:
        """Return what jumps from one curve to the next, or None where three derivatives continue."""
        ...

    def blend(self, first: Curve, second: Curve, size: float, join: Join) -> Curve:
        """Return the curve that replaces the last `size` (sigma) of one curve and the first `size` of the next.

        Raises
        ------
        PathError
            The blend does not fit.
        """
        ...

    def path(self, sequence: SequencePath) -> Path:
        """Return the path of the task velocity along the coordinates."""
        ...
