"""A path made of curves.

How a path begins and ends: how fast it runs there per unit s, and whether it closes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.path.protocol import PathSample

if TYPE_CHECKING:
    from collections.abc import Sequence

    from brachis.path.frame import PathFrame
    from brachis.path.protocol import Array, Curve, Path
    from brachis.robot import TaskMap

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True, eq=False)
class Piece:
    """The part of a curve between sigma = `first` and sigma = `last`; of which segment, or None for a blend."""

    curve: Curve
    first: float
    last: float
    segment: int | None = None

    @property
    def length(self) -> float:
        """Range of sigma."""
        return self.last - self.first

    def arc_length(self, positions: int) -> float:
        """Return the arc length of the position rows by Gauss quadrature between the curve's knots."""
        knots = self.curve.knots
        inner = knots[(knots > self.first) & (knots < self.last)]
        bounds = np.concatenate([[self.first], inner, [self.last]])
        half = np.diff(bounds)[:, None] / 2
        sigma = bounds[:-1, None] + half * (_NODES + 1)
        slope = self.curve.derivatives(sigma.ravel(), 1)[1, :, :positions]
        return float(np.linalg.norm(slope, axis=1) @ (half * _WEIGHTS).ravel())


@dataclass(frozen=True, eq=False)
class SequencePath:
    """Pieces of curves one after the other; s is the sum of their parameters over its total.

    Attributes
    ----------
    pieces : tuple of Piece
        Parts of the segments' curves, and blends.
    breaks : ndarray
        Values of s where pieces join, from 0 to 1.
    length : float
        Arc length of the position rows, m.
    frame : PathFrame or None
        In which the curves are; None: the world.
    """

    pieces: tuple[Piece, ...]
    breaks: Array
    length: float
    frame: PathFrame | None = None

    @classmethod
    def of(cls, pieces: tuple[Piece, ...], positions: int) -> SequencePath:
        """Put pieces together whose first `positions` rows are those of the position."""
        ends = np.cumsum([0.0, *(piece.length for piece in pieces)])
        return cls(
            pieces,
            ends / ends[-1],
            sum(piece.arc_length(positions) for piece in pieces),
        )

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
        """Return the coordinates in the world and their derivatives by s up to the third, shape (4, K, m)."""
        values = np.atleast_1d(np.asarray(s, dtype=float))
        which = np.clip(
            np.searchsorted(self.breaks, values, side="right") - 1,
            0,
            len(self.pieces) - 1,
        )
        total = self.total
        rows = self.pieces[0].curve.derivatives(np.zeros(1), 0).shape[2]
        result = np.empty((4, values.size, rows))
        order = np.argsort(which, kind="stable")
        for here in (
            np.split(order, np.flatnonzero(np.diff(which[order])) + 1)
            if len(order)
            else ()
        ):
            i = int(which[here[0]])
            sigma = self.pieces[i].first + (values[here] - self.breaks[i]) * total
            result[:, here] = self.pieces[i].curve.derivatives(sigma)
        result *= total ** np.arange(4)[:, None, None]
        if self.frame is not None:
            result = result @ self.frame.turn.T
            result[0] += self.frame.origin
        return result


_CLOSED = 1e-6
"""Largest gap of a closed path, m and rad, and of its derivatives by s, relative to their size."""
_STILL = 1e-9


def path_speed(task_map: TaskMap, path: Path, s: float) -> float:
    """Return how far the position moves per unit s, m; where it stands still, how far the angles turn, rad.

    Of a path of joints it is the norm of their derivatives.
    """
    position, angle = (
        float(size[0]) for size in task_map.norms(path.sample(np.array([s])).xi)
    )
    return position if position > _STILL else angle


def check_closed(task_map: TaskMap, path: Path) -> None:
    """Refuse a path that does not end where, and as, it begins, to the second derivative.

    Raises
    ------
    PathError
    """
    ends = path.sample(np.array([0.0, 1.0]))
    gap = np.abs(task_map.difference(*ends.target))
    worst = int(np.argmax(gap))
    allowed = f"an end where the path begins, to {_CLOSED:g} m and rad"
    if gap[worst] > _CLOSED:
        raise PathError(
            "the path does not close",
            found=f"{gap[worst]:.3g} {task_map.units[worst]} off in {task_map.rows[worst]}",
            allowed=allowed,
            where="boundary.periodic",
        )
    for derivative, name in ((ends.xi, "tangent"), (ends.xi_ds, "curvature")):
        jump = float(np.linalg.norm(derivative[1] - derivative[0]))
        if jump > _CLOSED * max(
            float(np.linalg.norm(ends.xi[0])), float(np.linalg.norm(derivative))
        ):
            raise PathError(
                f"the path's {name} jumps where it closes",
                found=f"a jump of {jump:.3g} in {np.linalg.norm(derivative[0]):.3g} (by s)",
                allowed="a path that continues where it closes, to the second derivative",
                where="boundary.periodic",
                hint="Begin within a segment, so that corners are blended",
            )
