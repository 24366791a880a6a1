"""The motion of a trajectory, evaluated by polynomial piece and by the place u within the piece.

A piece of only a microsecond is evaluated as exactly as any other. Roots of the polynomials, in Bernstein form, show
where a motion reverses, peaks or crosses a value.

A motion is checked in every piece, in every knot interval, in every piece of the path, and where joints reverse. A
violation could be hidden between checked instants. Every quintic piece is therefore checked inside, however short it
is, and more densely if it moves a joint further. Wherever a joint reverses or almost reverses, the motion is also
checked within the range of speeds over which Coulomb friction changes its sign.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import bisect, count_each
from brachis.errors import InputError
from brachis.kernel import bernstein
from brachis.path import Path
from brachis.path.legs import Leg, legs_of, with_held_speeds
from brachis.robot import Robot, TaskMap
from brachis.task import SpeedTable, Task
from brachis.trajectory import MotionPhase, Trajectory
from brachis.verify.mechanics import joint_placements, torques
from brachis.verify.report import VerifyOptions

_HALVINGS = 30
"""Number of halvings after which no part contains two roots, unless the roots are closer than `SAME_PLACE`."""


def roots(coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the places in (0, 1) where polynomials change sign; places where they only touch zero may be included.

    Parameters
    ----------
    coefficients : (m + 1, F) ndarray
        Bernstein coefficients of F polynomials of degree m >= 1.

    Returns
    -------
    column : (Z,) int ndarray
        Index of the polynomial of each root, ascending.
    u : (Z,) ndarray
        Roots, ascending within each polynomial.
    """
    column = np.arange(coefficients.shape[1])
    low = np.zeros(len(column))
    width = 1.0
    root_arrays = [(column[:0], low[:0])]
    for _ in range(_HALVINGS):
        # A polynomial whose coefficients do not change sign has no root.
        changing = (coefficients.min(axis=0) < 0.0) & (coefficients.max(axis=0) > 0.0)
        coefficients = coefficients[:, changing]
        column = np.tile(column[changing], 2)
        low = low[changing]
        if not len(low):
            break
        width *= 0.5
        low = np.concatenate([low, low + width])
        coefficients = _halve(coefficients)
        right = slice(len(column) // 2, None)
        is_root = coefficients[0, right] == 0.0
        root_arrays.append((column[right][is_root], low[right][is_root]))
    first, last = coefficients[[0, -1]]
    crossing = first * last < 0.0
    share = first[crossing] / (first[crossing] - last[crossing])
    root_arrays.append((column[crossing], low[crossing] + width * share))
    number, u = (np.concatenate(arrays) for arrays in zip(*root_arrays, strict=True))
    order = np.lexsort((u, number))
    return number[order], u[order]


def _halve(coefficients: np.ndarray) -> np.ndarray:
    """Return Bernstein coefficients, (m + 1, 2 F), of the lower and then of the upper halves of F polynomials."""
    lower = [coefficients[0]]
    upper = [coefficients[-1]]
    while len(coefficients) > 1:
        coefficients = 0.5 * (coefficients[:-1] + coefficients[1:])
        lower.append(coefficients[0])
        upper.append(coefficients[-1])
    return np.hstack([lower, upper[::-1]])


def turns(coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the extrema of polynomials, (m + 1, F), within (0, 1).

    Returns
    -------
    column : (Z,) int ndarray
    u, value : (Z,) ndarray
    """
    column, u = roots(np.diff(coefficients, axis=0))
    return column, u, bernstein(coefficients, column, u)


SAME_PLACE = 1e-9
"""Fraction of a piece; places in the piece that are closer to each other than this count as the same."""


class MotionPieces:
    """Joint motion as polynomials in Bernstein form over L pieces; u in [0, 1] is the place within a piece.

    Parameters
    ----------
    trajectory : Trajectory
    robot : Robot
        Robot for which the motion is verified.

    Attributes
    ----------
    times : (L + 1,) ndarray
        Times of the nodes, s.
    lengths : (L,) ndarray
        Lengths of the pieces, s.
    nodes : (L, n) ndarray
        Positions at the beginning of the pieces, rad or m.
    position : (6, L, n) ndarray
        Coefficients of the positions relative to `nodes`.
    velocity : (5, L, n) ndarray
    acceleration : (4, L, n) ndarray
    jerk : (3, L, n) ndarray
    path_coordinate : callable
        ``path_coordinate(t)`` returns s, (K,), at times t, (K,), s.
    robot : Robot
    """

    def __init__(self, trajectory: Trajectory, robot: Robot) -> None:
        position = trajectory.pieces
        velocity = position.derivative
        self.times = trajectory.times
        self.lengths = np.diff(trajectory.times)
        self.nodes = trajectory.q[:-1]
        self.position = position.c
        self.velocity = velocity.c
        self.acceleration = velocity.derivative.c
        self.jerk = trajectory.jerk_pieces.c
        self.path_coordinate = trajectory.path_spline
        self.robot = robot

    def time(self, index: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the times, s, of places u in pieces."""
        return self.times[index] + u * self.lengths[index]

    def positions(self, index: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the joint positions at places, (K, n)."""
        return self.nodes[index] + bernstein(self.position, index, u)

    def place(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the piece and the place in it for times t, (K,), s; at a node, the piece that begins there."""
        index = np.searchsorted(self.times, t, side="right") - 1
        index = np.clip(index, 0, len(self.lengths) - 1)
        return index, np.clip((t - self.times[index]) / self.lengths[index], 0.0, 1.0)

    def place_on_path(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pieces and places at which path coordinates, (P,), are reached; s(t) does not decrease."""
        end = np.full(len(s), self.times[-1])
        return self.place(bisect(lambda t: self.path_coordinate(t) < s, end))


@dataclass(frozen=True, eq=False)
class MotionStates:
    """The motion at K places, ascending in time, evaluated on demand. Where pieces join, both sides are included.

    Attributes
    ----------
    pieces : MotionPieces
    index : (K,) int ndarray
    u, t, s : (K,) ndarray
        Place in the piece with this index; time, s; and path coordinate.
    q, qdot, qddot, qdddot, tau : (K, n) ndarray
    """

    pieces: MotionPieces
    index: np.ndarray
    u: np.ndarray

    @classmethod
    def at(cls, pieces: MotionPieces, index: np.ndarray, u: np.ndarray) -> MotionStates:
        """Evaluate pieces at places given in any order. Each place occurs only once in the result."""
        order = np.lexsort((u, index))
        index = index[order]
        u = u[order]
        near = (index[1:] == index[:-1]) & (u[1:] - u[:-1] <= SAME_PLACE)
        again = near & ((u[1:] < 1.0) | (u[:-1] == 1.0))  # an end is kept
        first = np.append(True, ~again)[: len(index)]
        return cls(pieces, index[first], u[first])

    @classmethod
    def join(cls, chunks: list[MotionStates]) -> MotionStates:
        """Concatenate states."""
        index = np.concatenate([states.index for states in chunks])
        return cls(
            chunks[0].pieces, index, np.concatenate([states.u for states in chunks])
        )

    def split(self) -> Iterator[MotionStates]:
        """Yield the states in parts small enough to need little memory."""
        for begin in range(0, max(len(self.u), 1), _AT_ONCE):
            yield self.only(slice(begin, begin + _AT_ONCE))

    @cached_property
    def t(self) -> np.ndarray:
        """Times of the states, (K,), s."""
        return self.pieces.time(self.index, self.u)

    @cached_property
    def s(self) -> np.ndarray:
        """Path coordinates of the states, (K,)."""
        return self.pieces.path_coordinate(self.t)

    @cached_property
    def q(self) -> np.ndarray:
        """Joint positions, (K, n)."""
        return self.pieces.positions(self.index, self.u)

    @cached_property
    def qdot(self) -> np.ndarray:
        """Joint velocities, (K, n)."""
        return bernstein(self.pieces.velocity, self.index, self.u)

    @cached_property
    def qddot(self) -> np.ndarray:
        """Joint accelerations, (K, n)."""
        return bernstein(self.pieces.acceleration, self.index, self.u)

    @cached_property
    def qdddot(self) -> np.ndarray:
        """Joint jerks, (K, n)."""
        return bernstein(self.pieces.jerk, self.index, self.u)

    @cached_property
    def joints(self) -> tuple[np.ndarray, np.ndarray]:
        """The `joint_placements` of the states."""
        return joint_placements(self.pieces.robot, self.q)

    @cached_property
    def tau(self) -> np.ndarray:
        """Joint torques, (K, n)."""
        robot = self.pieces.robot
        return np.concatenate(
            [
                torques(robot, states.q, states.qdot, states.qddot)
                for states in self.split()
            ]
        )

    def torque(self, robot: Robot) -> np.ndarray:
        """Return the torques of the verified robot, (K, n). The user's own limits call this method."""
        robot.check_masses("torques")
        return self.tau

    def only(self, chosen: np.ndarray | slice | list[int]) -> MotionStates:
        """Return some of the states, in the chosen order."""
        return MotionStates(self.pieces, self.index[chosen], self.u[chosen])

    def merge(self, added: MotionStates) -> tuple[MotionStates, np.ndarray]:
        """Return these states merged with others, ascending in time, and their order among the concatenated states."""
        both = self.join([self, added])
        order = np.lexsort((both.u, both.index))
        return both.only(order), order


@dataclass(frozen=True, eq=False)
class CheckedMotion:
    """A motion to verify, with the data against which it is verified.

    Attributes
    ----------
    trajectory : Trajectory
    robot : Robot
    task_map : TaskMap
    path : Path
    options : VerifyOptions
    is_sampled : bool
        Whether the motion is known only at its nodes, so that it is checked only there.
    """

    trajectory: Trajectory
    robot: Robot
    task_map: TaskMap
    path: Path
    options: VerifyOptions
    is_sampled: bool = False

    @property
    def task(self) -> Task:
        """The task of the trajectory."""
        return self.trajectory.task

    @cached_property
    def pieces(self) -> MotionPieces:
        """The joint motion as polynomial pieces."""
        return MotionPieces(self.trajectory, self.robot)

    @cached_property
    def states(self) -> MotionStates:
        """The motion at all instants at which it is checked."""
        if self.is_sampled:
            return MotionStates(self.pieces, *self.pieces.place(self.pieces.times))
        return MotionStates.at(self.pieces, *_all_places(self))

    @cached_property
    def legs(self) -> tuple[Leg, ...]:
        """Legs of the path, derived again from the task."""
        task = with_held_speeds(self.task, self.task_map, self.path)
        return legs_of(task, self.task_map, self.path)

    def during(self, phase: MotionPhase) -> MotionStates:
        """Return the states of all pieces that overlap a phase."""
        times = self.pieces.times
        rounding = tolerances.TIME * times[-1]
        first = np.searchsorted(times, phase.begin + rounding, side="right") - 1
        last = np.searchsorted(times, phase.end - rounding)
        inside = (self.states.index >= first) & (self.states.index < last)
        return self.states.only(inside)


MOST_INSTANTS = 2_000_000
"""Maximum number of instants checked, not counting those that limits add: this takes about 10 s and 3 GB."""
_USUAL_INSTANTS = 200_000
"""Target for the total number of instants in all knot intervals; each still has at least its minimum number."""
_AT_ONCE = 5000
"""Number of instants that are evaluated at once, so that their data stay in the processor's cache."""
_FEWEST = 8
"""Minimum number of steps in a knot interval, however many intervals there are."""
_LEAST_STEPS = 3
"""Minimum number of steps in each piece. The ends of three steps determine a cubic acceleration."""
_TRAVEL = 0.05
"""Maximum travel of a joint within a step, rad or m."""

Places = tuple[np.ndarray, np.ndarray]
"""Indices of pieces, (K,), and places u in these pieces, (K,)."""


def _all_places(motion: CheckedMotion) -> Places:
    """List all places at which a motion is checked, in any order.

    Raises
    ------
    InputError
        There are more than `MOST_INSTANTS` places.
    """
    pieces = motion.pieces
    places = (
        _spread(motion),
        pieces.place_on_path(_path_coordinates(motion)),
        _peaks(pieces),
        _reversals(pieces),
    )
    index, u = (np.concatenate(arrays) for arrays in zip(*places, strict=True))
    _check_count(len(index))
    return index, u


def _spread(motion: CheckedMotion) -> Places:
    """Spread places over every piece, including both ends, as densely as knot intervals and joint travel require."""
    pieces = motion.pieces
    trajectory = motion.trajectory
    knots = np.unique(trajectory.knots) * trajectory.t_end
    edges = np.union1d(pieces.times, knots[(knots > 0.0) & (knots < pieces.times[-1])])
    first, _ = pieces.place(edges[:-1])
    low = (edges[:-1] - pieces.times[first]) / pieces.lengths[first]
    high = (edges[1:] - pieces.times[first]) / pieces.lengths[first]
    middle = 0.5 * (edges[1:] + edges[:-1])
    interval = np.searchsorted(knots, middle).clip(1, len(knots) - 1)
    share = np.diff(edges) / np.diff(knots)[interval - 1]
    most_steps = max(_USUAL_INSTANTS / len(knots), _FEWEST)
    steps_per_interval = min(motion.options.points_per_interval, most_steps)
    by_interval = share * steps_per_interval - 1e-6  # less rounding
    travel = np.abs(np.diff(pieces.position, axis=0)).sum(axis=0).max(axis=1)
    by_travel = travel[first] * (high - low) / _TRAVEL
    steps = np.nan_to_num(np.maximum(by_interval, by_travel))
    steps = np.ceil(np.clip(steps, _LEAST_STEPS, 10_000)).astype(int)
    count = steps + 1
    _check_count(count.sum())
    fraction = count_each(count) / np.repeat(steps, count)
    u = (1.0 - fraction) * np.repeat(low, count) + fraction * np.repeat(high, count)
    return np.repeat(first, count), u


def list_speed_tables(task: Task) -> list[SpeedTable]:
    """List the tool's speed limits that depend on s: those of the task, from feed rates, and in process-speed leads."""
    limits = task.tool_limits
    tables = [limits.speed] if isinstance(limits.speed, SpeedTable) else []
    leads = [lead for section in limits.process_speed for lead in section.leads]
    return [*tables, *limits.feed, *leads]


def _check_count(count: int) -> None:
    """Raise an error if a motion would be checked at more than `MOST_INSTANTS` instants."""
    if count > MOST_INSTANTS:
        raise InputError(
            "the motion is too long, too fast or too finely divided to be verified",
            where="trajectory",
            found=f"{count} instants to check",
            allowed=f"{MOST_INSTANTS}: {_LEAST_STEPS + 1} in every piece between nodes, one for every {_TRAVEL:g} rad "
            f"or m that a joint travels, {_FEWEST} in every knot interval, 32 in every piece of the path",
            hint="Split the motion into parts",
        )


def _path_coordinates(motion: CheckedMotion) -> np.ndarray:
    """Spread s over every piece of the path, so that no small blend is skipped; add the s values of speed tables."""
    breaks = motion.path.breaks
    fractions = np.linspace(0.0, 1.0, motion.options.points_per_interval)
    _check_count(len(breaks) * len(fractions))
    s = (breaks[:-1, None] + np.diff(breaks)[:, None] * fractions).ravel()
    return np.concatenate([s, *(table.s for table in list_speed_tables(motion.task))])


def _peaks(pieces: MotionPieces) -> Places:
    """Find extrema of joint accelerations inside pieces that exceed the values at the ends of the piece."""
    ends = pieces.acceleration[[0, -1]]
    beyond = np.maximum(
        pieces.acceleration.max(axis=0) - ends.max(axis=0),
        ends.min(axis=0) - pieces.acceleration.min(axis=0),
    )
    # Coefficients are ignored if they leave the range between the two ends by at most 1 % of the largest acceleration.
    index, joint = np.nonzero(beyond > 0.01 * np.abs(ends).max(axis=(0, 1)))
    turning, u, _ = turns(pieces.acceleration[:, index, joint])
    return index[turning], u


def _reversals(pieces: MotionPieces) -> Places:
    """Find where velocities of joints with Coulomb friction cross multiples of its width or peak close to zero."""
    # Speeds, in widths, at which friction rises from 29 % of its full torque to the full torque less a fraction of
    # 2e-6.
    speeds = np.array([0.3, 1.0, 2.0, 3.0, 4.5, 7.0])
    levels = np.concatenate([-speeds[::-1], [0.0], speeds])
    near = 10.0  # in widths; an extremum at a lower speed is almost a reversal
    friction = pieces.robot.friction
    rubbing = np.flatnonzero(friction.coulomb > 0.0)
    velocity = pieces.velocity[:, :, rubbing] / friction.v_eps[rubbing]
    lowest = velocity.min(axis=0)
    highest = velocity.max(axis=0)
    # The velocity of a joint at rest crosses zero only because of rounding.
    moving = np.maximum(highest, -lowest) > speeds[0]
    index, joint = np.nonzero(moving & (lowest < near) & (highest > -near))
    slow = velocity[:, index, joint]
    crossing, u = roots((slow[:, :, None] - levels).reshape(len(slow), -1))
    turning, at, least_speed = turns(slow)
    is_near = np.abs(least_speed) < near
    indices = [index[crossing // len(levels)], index[turning[is_near]]]
    return np.concatenate(indices), np.concatenate([u, at[is_near]])
