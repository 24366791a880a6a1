"""A path made of curves, the frame in which they are given, and how the path begins and ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from brachis.common import tolerances
from brachis.errors import PathError
from brachis.path.protocol import Array, Curve, Path, PathSample
from brachis.robot import TaskMap
from brachis.robot.task_map.protocol import AXES, POSE_ROWS, YAW, position_rows
from brachis.task import Placement
from brachis.task.points.units import rotation_by


@dataclass(frozen=True, eq=False)
class PathFrame:
    """Task coordinates in a frame, (..., c), as those in the world: ``turn @ coordinates + origin``.

    Attributes
    ----------
    turn : (c, c) ndarray
        An orthogonal matrix.
    origin : (c,) ndarray
        m, rad.
    """

    turn: Array
    origin: Array

    @classmethod
    def of(cls, placement: Placement, rows: Sequence[str]) -> PathFrame:
        """Return the frame with a placement in the world, for a task space with these rows.

        Raises
        ------
        PathError
            The frame turns the rows out of their line or plane.
        """
        rotation = rotation_by("rpy", np.radians(placement.rpy_deg)).as_matrix()
        if tuple(rows) == POSE_ROWS:
            coordinates = np.zeros((12, 12))
            coordinates[:3, :3] = rotation
            coordinates[3:, 3:] = np.kron(rotation, np.eye(3))  # of a matrix row by row
            return cls(coordinates, np.concatenate([placement.xyz, np.zeros(9)]))
        axes = [AXES.index(row) for row in position_rows(rows)]
        block = rotation[np.ix_(axes, axes)]
        if (
            np.abs(block @ block.T - np.eye(len(axes))).max() > 1e-9
            or np.linalg.det(block) < 0.0
        ):
            raise PathError(
                "the path's frame turns the path out of the rows of the task space",
                where="path_frame",
                found=f"rpy_deg {list(placement.rpy_deg)} with task_space [{', '.join(rows)}]",
                allowed="a turn within these rows",
                hint="Set task_space: position, or turn the frame only about the axis that is not among these rows",
            )
        turn = np.eye(len(rows))
        turn[: len(axes), : len(axes)] = block
        origin = np.array(placement.xyz)[axes]
        if YAW in rows:
            origin = np.append(origin, np.arctan2(block[1, 0], block[0, 0]))
        return cls(turn, origin)

    def to_world(self, coordinates: Array) -> Array:
        """Return coordinates in the world, (c,)."""
        return np.asarray(self.turn @ coordinates + self.origin)

    def to_frame(self, coordinates: Array) -> Array:
        """Return coordinates in the frame, (c,), of coordinates in the world."""
        return np.asarray(self.turn.T @ (coordinates - self.origin))


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
    frame: PathFrame | None

    @classmethod
    def of(
        cls, pieces: tuple[Piece, ...], positions: int, frame: PathFrame | None
    ) -> Self:
        """Put pieces together whose first `positions` rows are those of the position."""
        ends = np.cumsum([0.0, *(piece.length for piece in pieces)])
        length = sum(piece.arc_length(positions) for piece in pieces)
        return cls(pieces, ends / ends[-1], length, frame)

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
        which = np.searchsorted(self.breaks[1:-1], values, side="right")
        total = self.total
        rows = self.pieces[0].curve.derivatives(np.zeros(1), 0).shape[2]
        result = np.empty((4, values.size, rows))
        order = np.argsort(which, kind="stable")
        used, starts = np.unique(which[order], return_index=True)
        for i, here in zip(used, np.split(order, starts[1:]), strict=False):
            piece = self.pieces[i]
            sigma = piece.first + (values[here] - self.breaks[i]) * total
            result[:, here] = piece.curve.derivatives(sigma)
        result *= total ** np.arange(4)[:, None, None]
        if self.frame is not None:
            result = result @ self.frame.turn.T
            result[0] += self.frame.origin
        return result


def path_speed(task_map: TaskMap, path: Path, s: float) -> float:
    """Return how far the position moves per unit s, m; where it stands still, how far the angles turn, rad.

    Of a path of joints it is the norm of their derivatives.
    """
    sizes = task_map.norms(path.sample(np.array([s])).xi)
    position, angle = (float(size[0]) for size in sizes)
    return position if position > tolerances.LENGTH else angle


def check_closed(task_map: TaskMap, path: Path) -> None:
    """Refuse a path that does not end where, and as, it begins, to the second derivative.

    Raises
    ------
    PathError
    """
    ends = path.sample(np.array([0.0, 1.0]))
    gap = np.abs(task_map.difference(*ends.target))
    worst = int(np.argmax(gap))
    largest = tolerances.WRITTEN  # of derivatives relative to their size
    if gap[worst] > largest:
        raise PathError(
            "the path does not close",
            found=f"{gap[worst]:.3g} {task_map.units[worst]} off in {task_map.rows[worst]}",
            allowed=f"an end within {largest:g} m and rad of the start",
            where="boundary.periodic",
        )
    for derivative, name in ((ends.xi, "tangent"), (ends.xi_ds, "curvature")):
        jump = float(np.linalg.norm(derivative[1] - derivative[0]))
        size = max(np.linalg.norm(ends.xi[0]), np.linalg.norm(derivative))
        if jump > largest * size:
            raise PathError(
                f"the path's {name} jumps where it closes",
                found=f"a jump of {jump:.3g} in {np.linalg.norm(derivative[0]):.3g} (by s)",
                allowed="a path that continues where it closes, to the second derivative",
                where="boundary.periodic",
                hint="Begin within a segment, so that corners are blended",
            )
