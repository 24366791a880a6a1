"""Joining curves to a path, with blends."""

from __future__ import annotations

from typing import TYPE_CHECKING

from brachis.path.joins import find_joins, refuse_corners
from brachis.path.sequence import Piece, SequencePath
from brachis.robot.task_map.rows import position_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from brachis.path.coordinates import Coordinates
    from brachis.path.joins import Corner
    from brachis.path.protocol import Curve

_NOTHING = 1e-11


def join_curves(curves: Sequence[Curve], blends: Sequence[float | None], coordinates: Coordinates) -> SequencePath:
    """Return the path along curves, with their corners rounded.

    Parameters
    ----------
    curves : sequence of Curve
        Each starts where its predecessor ends.
    blends : sequence of float or None
        For every curve, what its blend with the next one takes from either, m.
    coordinates : Coordinates
        What the curves' columns are.

    Raises
    ------
    PathError
        Curves do not continue each other to the third derivative and are not blended; or a blend does not fit.
    """
    corners: list[Corner | None] = []
    pieces: list[Piece] = []
    taken = 0.0
    joins = find_joins(curves, coordinates.rows)
    for join, curve, following, size in zip(joins, curves, curves[1:], blends, strict=False):
        if size is None:
            corners.append(coordinates.corner(join, curve, following))
            pieces.append(Piece(curve, taken, curve.length, join.index))
            taken = 0.0
        else:
            rounded = coordinates.blend(curve, following, size, join)
            pieces += [Piece(curve, taken, curve.length - size, join.index), Piece(rounded, 0.0, rounded.length)]
            taken = size
    pieces.append(Piece(curves[-1], taken, curves[-1].length, len(curves) - 1))
    refuse_corners([corner for corner in corners if corner is not None])
    # Two blends that meet in the middle of a segment leave nothing of it, but rounding.
    kept = tuple(piece for piece in pieces if piece.length > _NOTHING * piece.curve.length)
    return SequencePath.of(kept, len(position_rows(coordinates.rows)))
