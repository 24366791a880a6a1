"""A path made of curves: joining them, with blends, and sampling the result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.path.blend import blend
from brachis.path.joins import corner_at, find_joins, refuse_corners
from brachis.path.protocol import PathSample
from brachis.robot.task_map.rows import position_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from brachis.path.joins import Corner
    from brachis.path.protocol import Array, Curve

_QUADRATURE_POINTS = 16
_NOTHING = 1e-11


@dataclass(frozen=True, eq=False)
class Piece:
    """The part of a curve between sigma = `first` and sigma = `last`."""

    curve: Curve
    first: float
    last: float

    @property
    def length(self) -> float:
        """Range of sigma."""
        return self.last - self.first


@dataclass(frozen=True, eq=False)
class SequencePath:
    """Pieces of curves one after the other; s is the sum of their parameters over its total.

    Attributes
    ----------
    pieces : tuple of Piece
        Parts of the segments' curves, and blends.
    positions : int
        Number of position rows; they come first.
    breaks : ndarray
        Values of s where pieces join, from 0 to 1.
    length : float
        Arc length of the position rows, m.
    """

    pieces: tuple[Piece, ...]
    positions: int
    breaks: Array
    length: float

    @property
    def total(self) -> float:
        """Range of the summed parameter, sigma per unit s."""
        return sum(piece.length for piece in self.pieces)

    def sample(self, s: Sequence[float] | Array) -> PathSample:
        """Return the path at K values of s; beyond [0, 1] as the first or last piece continues.

        Parameters
        ----------
        s : array_like, shape (K,)
            Path coordinates.
        """
        return PathSample(*self.derivatives(s))

    def derivatives(self, s: Sequence[float] | Array) -> Array:
        """Return the coordinates and their derivatives by s up to the third, shape (4, K, m)."""
        values = np.atleast_1d(np.asarray(s, dtype=float))
        which = np.clip(np.searchsorted(self.breaks, values, side="right") - 1, 0, len(self.pieces) - 1)
        total = self.total
        rows = self.pieces[0].curve.derivatives(np.zeros(1), 0).shape[2]
        result = np.empty((4, values.size, rows))
        for i, piece in enumerate(self.pieces):
            here = which == i
            if np.any(here):
                sigma = piece.first + (values[here] - self.breaks[i]) * total
                result[:, here] = piece.curve.derivatives(sigma)
        result *= total ** np.arange(4)[:, None, None]
        return result


def join_curves(curves: Sequence[Curve], blends: Sequence[float | None], rows: tuple[str, ...]) -> SequencePath:
    """Return the path along curves, with their corners rounded.

    Parameters
    ----------
    curves : sequence of Curve
        Each starts where its predecessor ends.
    blends : sequence of float or None
        For every curve, what its blend with the next one takes from either, m.
    rows : tuple of str
        Rows of the task space; yaw, if it is one, comes last. Curves of poses have the twelve coordinates of a pose.

    Raises
    ------
    PathError
        Curves do not continue each other to the third derivative and are not blended; or a blend does not fit.
    """
    positions = len(position_rows(rows))
    corners: list[Corner | None] = []
    pieces: list[Piece] = []
    taken = 0.0
    for join, curve, following, size in zip(find_joins(curves, rows), curves, curves[1:], blends, strict=False):
        if size is None:
            corners.append(corner_at(join, curve, following))
            pieces.append(Piece(curve, taken, curve.length))
            taken = 0.0
        else:
            rounded = blend(curve, following, size, join)
            pieces += [Piece(curve, taken, curve.length - size), Piece(rounded, 0.0, rounded.length)]
            taken = size
    pieces.append(Piece(curves[-1], taken, curves[-1].length))
    refuse_corners([corner for corner in corners if corner is not None])
    # Two blends that meet in the middle of a segment leave nothing of it, but rounding.
    kept = tuple(piece for piece in pieces if piece.length > _NOTHING * piece.curve.length)
    ends = np.cumsum([0.0, *(piece.length for piece in kept)])
    return SequencePath(kept, positions, ends / ends[-1], sum(_arc_length(piece, positions) for piece in kept))


def _arc_length(piece: Piece, positions: int) -> float:
    """Return the arc length of the position rows by Gauss quadrature between the curve's knots."""
    knots = piece.curve.knots
    inner = knots[(knots > piece.first) & (knots < piece.last)]
    bounds = np.concatenate([[piece.first], inner, [piece.last]])
    nodes, weights = np.polynomial.legendre.leggauss(_QUADRATURE_POINTS)
    half = np.diff(bounds)[:, None] / 2
    sigma = bounds[:-1, None] + half * (nodes + 1)
    slope = piece.curve.derivatives(sigma.ravel(), 1)[1, :, :positions]
    return float(np.linalg.norm(slope, axis=1) @ (half * weights).ravel())
