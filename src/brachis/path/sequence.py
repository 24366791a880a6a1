"""A path made of curves, the frame in which the curves are given, and the ends of the path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import apply_each
from brachis.errors import PathError
from brachis.path.protocol import Array, Curve, PathSample
from brachis.path.rotations import rotation_of
from brachis.robot import TaskMap, task_map_of
from brachis.robot.task_map import JointSpace
from brachis.robot.task_map.protocol import ANGLES, AXES, TURN_ROWS, position_rows
from brachis.task import Placement
from brachis.task.points.points import sum_up
from brachis.task.points.units import rotation_by


@dataclass(frozen=True, eq=False)
class PathFrame:
    """A frame whose task coordinates, (..., c), are ``turn @ coordinates + origin`` in the world.

    Attributes
    ----------
    turn : (c, c) ndarray
        Orthogonal matrix that turns coordinates into the world frame.
    origin : (c,) ndarray
        World coordinates of the frame's origin, m and rad.
    """

    turn: Array
    origin: Array

    @classmethod
    def of(cls, placement: Placement, rows: Sequence[str]) -> PathFrame:
        """Return the frame with a placement in the world, for a task space with these rows.

        Raises
        ------
        PathError
            The frame turns the path out of the line or plane that the rows span.
        """
        from scipy.linalg import block_diag

        rotation = rotation_by("rpy", np.radians(placement.rpy_deg)).as_matrix()
        axes = [AXES.index(row) for row in position_rows(rows)]
        block = rotation[np.ix_(axes, axes)]
        stays = np.eye(3)[[ANGLES.index(row) for row in rows if row in ANGLES]]
        angle = stays @ rotation_of(rotation).as_rotvec()
        turning: np.ndarray = np.eye(len(stays))
        if tuple(rows[-3:]) == TURN_ROWS:
            angle = np.zeros(9)
            turning = np.kron(rotation, np.eye(3))  # the rotation matrix row by row
        if (
            np.abs(block @ block.T - np.eye(len(axes))).max(initial=0.0) > 1e-9
            or np.linalg.det(block) < 0.0
            or np.abs(stays @ rotation - stays).max(initial=0.0) > 1e-9
        ):
            raise PathError(
                "the path's frame turns the path out of the rows of the task space",
                where="path_frame",
                found=f"rpy_deg {list(placement.rpy_deg)} with task_space [{', '.join(rows)}]",
                allowed="a rotation that stays within these rows",
                hint="Set task_space: position, or turn the frame only about an axis that keeps these rows",
            )
        origin = np.append(np.array(placement.xyz)[axes], angle)
        return cls(block_diag(block, turning), origin)

    def to_world(self, coordinates: Array) -> Array:
        """Convert coordinates, (c,), from the frame to the world."""
        return self.turn @ coordinates + self.origin

    def to_frame(self, coordinates: Array) -> Array:
        """Convert coordinates, (c,), from the world to the frame."""
        return self.turn.T @ (coordinates - self.origin)


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


def integrate(function: Callable[[Array], Array], bounds: Array) -> Array:
    """Integrate a function of s, (K,), between successive bounds, (N + 1,), by Gauss quadrature; return (N,)."""
    half = np.diff(bounds)[:, None] / 2.0
    nodes = bounds[:-1, None] + half * (_NODES + 1.0)
    values = function(nodes.ravel()).reshape(nodes.shape)
    return (values * half) @ _WEIGHTS


def arc_length(velocity: Callable[[Array], Array], knots: Array) -> float:
    """Return the length of a curve from its velocities, (K, p), at s, (K,), analytic between the knots, (N + 1,)."""
    lengths = integrate(lambda s: np.linalg.norm(velocity(s), axis=1), knots)
    return float(lengths.sum())


@dataclass(frozen=True, eq=False)
class CurveSpan:
    """The part of a curve from sigma = `first` to `last`, which is below `first` if the curve is travelled backwards.

    `segments` has the index of its segment or, for a blend, of the two segments that the blend joins. `dwell` is the
    time for which the tool waits at the end, s; None if it does not stop there.
    """

    curve: Curve
    first: float
    last: float
    segments: tuple[int, ...] = ()
    dwell: float | None = None

    @property
    def length(self) -> float:
        """Range of sigma."""
        return abs(self.last - self.first)

    @property
    def direction(self) -> float:
        """1.0, or -1.0 if the curve is travelled backwards."""
        return -1.0 if self.last < self.first else 1.0


@dataclass(frozen=True, eq=False)
class Path:
    """A prescribed path: curves joined end to end. s is their cumulative parameter sigma divided by `total`.

    Attributes
    ----------
    spans : tuple of CurveSpan
        Parts of the segments' curves, and blends.
    breaks : (b + 1,) ndarray
        Values of s where spans join, from 0 to 1; for a part of a path, from where the part begins to where it ends. At
        the breaks, the path is C3 except at its stops.
    total : float
        Sum of the parameter ranges of all curves of the whole path; sigma per unit s.
    positions : int
        Number of position rows among the coordinates.
    frame : PathFrame or None
        Frame in which the curves are given; None means the world.
    """

    spans: tuple[CurveSpan, ...]
    breaks: Array
    total: float
    positions: int
    frame: PathFrame | None

    @classmethod
    def of(
        cls,
        spans: tuple[CurveSpan, ...],
        positions: int,
        frame: PathFrame | None,
    ) -> Self:
        """Join spans whose first `positions` rows are those of the position."""
        ends = sum_up([span.length for span in spans])
        total = float(ends[-1])
        return cls(spans, ends / total, total, positions, frame)

    @property
    def dwells(self) -> dict[float, float]:
        """Values of s inside the path at which the tool stops, with the time for which it waits there, s.

        Only there may the path have corners.
        """
        ends = zip(self.breaks[1:-1].tolist(), self.spans[:-1], strict=True)
        return {s: span.dwell for s, span in ends if span.dwell is not None}

    @property
    def stops(self) -> Array:
        """Values of s inside the path at which the tool stops."""
        return np.array([*self.dwells], dtype=float)

    def travelled(self, begin: float, *, is_reversed: bool) -> Self:
        """Return the path as it is travelled from s = `begin` on, if it is closed, and backwards if it is reversed.

        If the ends of a closed path meet in a corner, the tool stops there.

        Raises
        ------
        PathError
            The path is not closed, or the tool waits where it begins.
        """
        spans = self.spans
        if begin:
            ends = self.sample([0.0, 1.0])
            gap = float(np.abs(ends.target[1] - ends.target[0]).max())
            if gap > tolerances.COORDINATE:
                raise PathError(
                    "only a closed path can begin elsewhere",
                    where="path_begin",
                    found=f"ends {gap:.3g} m or rad apart",
                    allowed="a path that ends where it begins, in all coordinates",
                )
            before = self.between(0.0, begin).spans
            after = self.between(begin, 1.0).spans
            if before[-1].dwell:
                raise PathError(
                    "the path begins where the tool waits",
                    where="path_begin",
                    found=begin,
                    allowed="a place without a dwell",
                )
            meeting = replace(after[-1], dwell=None if _is_smooth(ends) else 0.0)
            spans = (*after[:-1], meeting, *before)
        if is_reversed:
            dwells = [span.dwell for span in spans[-2::-1]]
            spans = tuple(
                replace(span, first=span.last, last=span.first, dwell=dwell)
                for span, dwell in zip(spans[::-1], [*dwells, None], strict=True)
            )
        return self.of(spans, self.positions, self.frame)

    @cached_property
    def length(self) -> float:
        """Arc length of the position rows, m, by Gauss quadrature between the knots."""
        return arc_length(
            lambda s: self.derivatives(s, 1)[1, :, : self.positions], self.knots
        )

    @property
    def knots(self) -> Array:
        """Values of s between which the path is analytic, from its start to its end, including the breaks."""
        inner_knots = [self.breaks]
        for (begin, end), span in zip(pairwise(self.breaks), self.spans, strict=True):
            sigma = span.curve.knots - span.first
            knots = begin + span.direction * sigma / self.total
            # The ends of a piece may be knots of its curve, up to rounding.
            is_inner = (knots > begin + tolerances.PATH) & (
                knots < end - tolerances.PATH
            )
            inner_knots.append(knots[is_inner])
        return np.unique(np.concatenate(inner_knots))

    def between(self, begin: float, end: float) -> Self:
        """Return the part of the path from s = `begin` to `end`, with the same s.

        Only the spans within this part are sampled, so that it is clear on which side of a corner a sample lies.
        Outside the ends of the part, the first or last piece is continued.
        """
        inner = self.breaks[1:-1]
        is_after = inner > begin + tolerances.PATH
        inside = inner[is_after & (inner < end - tolerances.PATH)]
        first = len(inner) - np.count_nonzero(is_after)
        last = first + len(inside)
        spans = list(self.spans[first : last + 1])
        before = (begin - self.breaks[first]) * self.total
        after = (end - self.breaks[last + 1]) * self.total
        start = spans[0].first + spans[0].direction * before
        spans[0] = replace(spans[0], first=start)
        stop = spans[-1].last + spans[-1].direction * after
        dwell = spans[-1].dwell if after > -tolerances.PATH * self.total else None
        spans[-1] = replace(spans[-1], last=stop, dwell=dwell)
        breaks = np.concatenate([[begin], inside, [end]])
        return replace(self, spans=tuple(spans), breaks=breaks)

    def sample(self, s: Sequence[float] | Array) -> PathSample:
        """Return the path at K values of s, shape (K,).

        Outside the ends of the path, the formula of the first or last piece is continued, so that trial points of the
        optimiser just outside have smooth derivatives. At a stop, the sample is that of the curve after the stop.
        """
        return PathSample(*self.derivatives(s))

    def derivatives(self, s: Sequence[float] | Array, order: int = 3) -> Array:
        """Return the coordinates in the world and their derivatives with respect to s, shape (order + 1, K, m)."""
        values = np.array(s, dtype=float, ndmin=1)
        if len(self.spans) == 1:
            result = self._on_span(0, values, order)
        else:
            which = np.searchsorted(self.breaks[1:-1], values, side="right")
            runs = np.flatnonzero(np.diff(which)) + 1
            by_span = [
                self._on_span(which[begin], values[begin:end], order)
                for begin, end in pairwise([0, *runs.tolist(), values.size])
            ]
            result = np.concatenate(by_span, axis=1)
        result *= self.total ** np.arange(order + 1)[:, None, None]
        if self.frame is not None:
            result = result @ self.frame.turn.T
            result[0] += self.frame.origin
        return result

    def _on_span(self, i: int, s: Array, order: int) -> Array:
        """Return coordinates and derivatives with respect to sigma, (order + 1, K, m), on the curve of one piece."""
        span = self.spans[i]
        sigma = span.first + span.direction * (s - self.breaks[i]) * self.total
        result = span.curve.derivatives(sigma, order)
        if span.direction < 0.0:
            result[1::2] *= -1.0
        return result


def _is_smooth(ends: PathSample) -> bool:
    """Tell whether a closed path, sampled at both ends, closes without a jump of its first three derivatives."""
    size = np.linalg.norm(ends.xi[0])
    return all(
        np.linalg.norm(derivative[1] - derivative[0])
        <= tolerances.WRITTEN * max(size, np.linalg.norm(derivative))
        for derivative in (ends.xi, ends.xi_ds, ends.xi_dds)
    )


def path_speed(task_map: TaskMap, path: Path, s: float) -> float:
    """Return how far the position moves per unit s, m, or, if it stands still, how far the angles turn, rad.

    For a joint path, return the norm of the derivatives of the joint positions.
    """
    sizes = task_map.norms(path.sample(np.array([s])).xi)
    position, angle = (float(size[0]) for size in sizes)
    return position if position > tolerances.LENGTH else angle


def tool_derivatives(task_map: TaskMap, path: Path, s: Array) -> Array:
    """Return the velocity of the tool frame's origin per unit s and its first two derivatives, (3, K, p), m.

    The vectors have the p position rows, along the axes of the world or, for poses, of the tool frame. For a joint
    path, p = 3.
    """
    sample = path.sample(s)
    if not isinstance(task_map, JointSpace):
        rows = np.stack([sample.xi, sample.xi_ds, sample.xi_dds])
        return rows[..., : len(task_map.axes)]
    tool = task_map_of(task_map.robot, "position")
    twists = tool.twists(sample.target)
    jacobian = tool.jacobian(twists)
    slopes = tool.derivatives(twists, sample.xi, sample.xi_ds)
    velocity = apply_each(jacobian, sample.xi)
    v_ds = apply_each(jacobian, sample.xi_ds) + apply_each(slopes.velocity_q, sample.xi)
    v_dds = (
        apply_each(jacobian, sample.xi_dds)
        + apply_each(slopes.acceleration_qdot, sample.xi_ds)
        + apply_each(slopes.acceleration_q, sample.xi)
    )
    return np.stack([velocity, v_ds, v_dds])


def tool_distance(task_map: TaskMap, path: Path) -> float:
    """Return how far the tool moves along a path, m."""
    return arc_length(lambda s: tool_derivatives(task_map, path, s)[0], path.knots)


def check_closed(task_map: TaskMap, path: Path) -> None:
    """Reject a path that is not closed, or whose first two derivatives differ between its start and its end.

    Raises
    ------
    PathError
    """
    ends = path.sample(np.array([0.0, 1.0]))
    gap = np.abs(task_map.difference(*ends.target))
    worst = np.argmax(gap)
    largest = tolerances.WRITTEN  # tolerance for derivatives, relative to their size
    if gap[worst] > largest:
        raise PathError(
            "the path does not close",
            found=f"{gap[worst]:.3g} {task_map.units[worst]} off in {task_map.rows[worst]}",
            allowed=f"an end within {largest:g} m and rad of the start",
            where="boundary.periodic",
        )
    for derivative, name in ((ends.xi, "tangent"), (ends.xi_ds, "curvature")):
        jump = np.linalg.norm(derivative[1] - derivative[0])
        size = max(np.linalg.norm(ends.xi[0]), np.linalg.norm(derivative))
        if jump > largest * size:
            raise PathError(
                f"the path's {name} jumps where it closes",
                found=f"a jump of {jump:.3g} in {np.linalg.norm(derivative[0]):.3g} (by s)",
                allowed="a path that continues where it closes, to the second derivative",
                where="boundary.periodic",
                hint="Begin the path within a segment, so that all corners are blended",
            )
