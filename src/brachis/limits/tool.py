"""How fast the tool moves, turns and accelerates, as functions of the joint motion, with their derivatives.

With J the Jacobian of a velocity of the tool, v = J(q) qdot and its direction e = v / |v|,

    d|v|/dqdot = e . J,        d|v|/dq = e . dv/dq,

and likewise for the size of the acceleration a = J qddot + Jdot qdot. What is zero has no direction; far from its limit
there, it is given none.

|v| <= v_max(s) of the tool frame's origin, as |v| / v_max(s) <= 1; v_max a number, or tables over the path.

|a| <= a_max of the tool frame's origin, as |a| / a_max <= 1; see `tool` for the derivatives.

|w| <= w_max of the tool, as |w| / w_max <= 1; see `tool` for the derivatives.

A tool that rolls freely about its own axis does so by a virtual joint, which turns nothing.

A largest speed over the path coordinate: piecewise linear, with steps made into ramps on their faster side.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.limits.protocol import (
    Bound,
    JointMotion,
    Label,
    Limit,
    Partials,
    PhaseLines,
    Role,
)
from brachis.robot import ROLL_JOINT, Robot, task_map_of
from brachis.task import SpeedTable as SpeedTableModel
from brachis.task import Task


def direction(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sizes, (K,), of vectors (K, 3), and their directions, (K, 3); zero where there is none."""
    size = np.linalg.norm(vectors, axis=1)
    return size, np.divide(
        vectors, size[:, None], out=np.zeros_like(vectors), where=size[:, None] > 0.0
    )


class ToolSpeed:
    """Speed of the tool frame's origin, m/s.

    Parameters
    ----------
    robot : Robot
    """

    def __init__(self, robot: Robot) -> None:
        self._tool = task_map_of(robot, "position")

    def speed(self, motion: JointMotion) -> np.ndarray:
        """Speeds at K moments, (K,)."""
        return self.slope(motion.q, motion.qdot)

    def slope(self, q: np.ndarray, q_ds: np.ndarray) -> np.ndarray:
        """Size of the origin's displacement per unit of the path, (S,), from postures and their derivatives."""
        jacobian = self._tool.jacobian(self._tool.twists(q))
        return np.asarray(
            np.linalg.norm(np.einsum("kij,kj->ki", jacobian, q_ds), axis=1)
        )

    def derivatives(
        self, motion: JointMotion
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Speeds, (K,), and their derivatives by q and by qdot, (K, n)."""
        twists = self._tool.twists(motion.q)
        jacobian = self._tool.jacobian(twists)
        speed, along = direction(np.einsum("kij,kj->ki", jacobian, motion.qdot))
        by_q = self._tool.velocity_slopes(twists, motion.qdot)
        return speed, *(
            np.einsum("ki,kij->kj", along, part) for part in (by_q, jacobian)
        )


class ToolAccelerationLimit(Limit):
    """Size of the acceleration of the tool frame's origin over its limit.

    Parameters
    ----------
    robot : Robot
    figure : float
        m/s^2.
    """

    kind = "tool_acceleration"
    role = Role.PROCESS
    longer_time = "relieves"

    def __init__(self, robot: Robot, figure: float) -> None:
        self._tool, self._figure = task_map_of(robot, "position"), figure
        self.labels = (
            Label(
                "tool",
                "acceleration",
                "m/s^2",
                "tool_limits.acceleration",
                share="tool acceleration / limit",
            ),
        )
        self.lower, self.upper = np.full(1, -np.inf), np.ones(1)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return (Bound(0, self._figure, self._figure, 1.0 / self._figure),)

    def _acceleration(
        self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> np.ndarray:
        """Accelerations over the limit, (K, 3), world frame."""
        jacobian = self._tool.jacobian(twists)
        return (
            np.einsum("kij,kj->ki", jacobian, qddot) + self._tool.bias(twists, qdot)
        ) / self._figure

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        found = self._acceleration(
            self._tool.twists(motion.q), motion.qdot, motion.qddot
        )
        return np.linalg.norm(found, axis=1)[:, None]

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        twists = self._tool.twists(motion.q)
        _, along = direction(self._acceleration(twists, motion.qdot, motion.qddot))
        exact = self._tool.derivatives(twists, motion.qdot, motion.qddot)
        by = (
            exact.acceleration_q,
            exact.acceleration_qdot,
            self._tool.jacobian(twists),
        )
        return Partials(
            *(
                np.einsum("ki,kij->kj", along, part)[:, None] / self._figure
                for part in by
            )
        )

    def lines(
        self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray
    ) -> PhaseLines:
        """See `Limit.lines`: the components along the world's axes, each within the whole."""
        twists, still = self._tool.twists(q), np.zeros_like(q)
        by_u = self._acceleration(twists, still, q_ds)
        return PhaseLines(
            by_u, self._acceleration(twists, q_ds, q_dds), np.zeros_like(by_u)
        )


def build_tool_acceleration(robot: Robot, task: Task) -> ToolAccelerationLimit | None:
    """Build the limit where the task has one."""
    figure = task.tool_limits.acceleration
    return None if figure is None else ToolAccelerationLimit(robot, figure)


_ANGULAR = slice(3, None)
"""Rows of a pose's velocity that are its angular part, in the tool's own axes."""


class ToolAngularSpeedLimit(Limit):
    """Angular speed of the tool over its limit.

    Parameters
    ----------
    robot : Robot
    figure : float
        rad/s.
    """

    kind = "tool_angular_speed"
    role = Role.PROCESS
    longer_time = "relieves"

    def __init__(self, robot: Robot, figure: float) -> None:
        self._tool, self._figure = task_map_of(robot, "pose"), figure
        self._turning = np.array(
            [
                not (robot.rolls_freely and name == ROLL_JOINT)
                for name in robot.joint_names
            ]
        )
        self.labels = (
            Label(
                "tool",
                "angular speed",
                "rad/s",
                "tool_limits.angular_speed",
                share="tool angular speed / limit",
            ),
        )
        self.lower, self.upper = np.full(1, -np.inf), np.ones(1)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return (Bound(0, self._figure, self._figure, 1.0 / self._figure),)

    def _jacobian(self, twists: np.ndarray) -> np.ndarray:
        """Jacobian of the angular velocity over the limit, (K, 3, n)."""
        return self._tool.jacobian(twists)[:, _ANGULAR] * (self._turning / self._figure)

    def _speed(self, q: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        velocity = np.einsum("kij,kj->ki", self._jacobian(self._tool.twists(q)), qdot)
        return np.linalg.norm(velocity, axis=1)[:, None]

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._speed(motion.q, motion.qdot)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        twists, qdot = self._tool.twists(motion.q), motion.qdot * self._turning
        jacobian = self._jacobian(twists)
        _, along = direction(np.einsum("kij,kj->ki", jacobian, qdot))
        by_q = self._tool.velocity_slopes(twists, qdot)[:, _ANGULAR] / self._figure
        return Partials(
            *(
                np.einsum("ki,kij->kj", along, part)[:, None]
                for part in (by_q, jacobian)
            )
        )

    def lines(
        self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray
    ) -> PhaseLines:
        """See `Limit.lines`: the square of the ratio."""
        return PhaseLines(None, self._speed(q, q_ds) ** 2, np.zeros((len(q), 1)))


def build_tool_angular_speed(robot: Robot, task: Task) -> ToolAngularSpeedLimit | None:
    """Build the limit where the task has one."""
    figure = task.tool_limits.angular_speed
    return None if figure is None else ToolAngularSpeedLimit(robot, figure)


_RAMP = 5e-3
"""Length of a ramp in s: Newton's steps need a slope."""
_SHARE = 0.4
"""Part of the way to the next place that a ramp takes at most."""
_BEYOND = 20.0
"""Times the speed at its end, up to which a table that ends there goes on rising within a ramp."""


class SpeedTable:
    """Largest speeds at path coordinates.

    Parameters
    ----------
    s : (P,) sequence of float
        Ascending; a place that occurs twice is a step.
    speed : (P,) sequence of float
        m/s.
    whole : bool, optional
        Whether the first and the last speed hold beyond their places too; otherwise nothing does there.

    Attributes
    ----------
    places : (p,) ndarray
        Path coordinates between which the speed is linear, each once.
    speeds : (p,) ndarray
        m/s; between the given places nowhere above the given ones.
    largest : float
        Of the given ones, m/s.
    """

    def __init__(
        self, s: Sequence[float], speed: Sequence[float], *, whole: bool = True
    ) -> None:
        places, speeds = np.array(s, dtype=float), np.array(speed, dtype=float)
        given, steps = places.copy(), np.flatnonzero(np.diff(places) == 0.0)
        for first in steps.tolist():
            rising = speeds[first + 1] > speeds[first]
            moved, onwards = (first + 1, 1) if rising else (first, -1)
            beyond = moved + onwards
            if not 0 <= beyond < len(given):
                places[moved] += onwards * _RAMP
                continue
            length = min(_RAMP, _SHARE * abs(given[beyond] - given[moved]))
            share = length / abs(given[beyond] - given[moved])
            places[moved] += onwards * length
            speeds[moved] += share * (speed[beyond] - speed[moved])
        kept = _bends(places, speeds)
        self.places, self.speeds, self._whole = places[kept], speeds[kept], whole
        self.largest = float(self.speeds.max())
        if not whole:
            first, last = self.places[[0, -1]]
            self.places = np.concatenate([[first - _RAMP], self.places, [last + _RAMP]])
            self.speeds = np.concatenate(
                [self.speeds[:1] * _BEYOND, self.speeds, self.speeds[-1:] * _BEYOND]
            )

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Largest speeds, (K,), m/s, at path coordinates s, (K,), and their derivatives by s; none off the path."""
        if len(self.places) == 1:
            return np.full(len(s), self.speeds[0]), np.zeros(len(s))
        slopes = np.concatenate(
            [[0.0], np.diff(self.speeds) / np.diff(self.places), [0.0]]
        )
        piece = np.searchsorted(self.places, s, side="right")
        beyond = (s < self.places[0]) | (s > self.places[-1])
        nowhere = np.isnan(s) | (beyond & (not self._whole))
        return np.where(
            nowhere, np.inf, np.interp(s, self.places, self.speeds)
        ), slopes[piece]


def _bends(places: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """Tell which rows of a table are needed, (P,) bool: not those on the straight line between their neighbours."""
    slopes = np.concatenate([[np.nan], np.diff(speeds) / np.diff(places), [np.nan]])
    return ~np.isclose(slopes[1:], slopes[:-1], rtol=1e-12, atol=1e-12)


class ToolSpeedLimit(Limit):
    """Speed of the tool frame's origin over its limits.

    Parameters
    ----------
    robot : Robot
    tables : (c,) sequence of SpeedTable
        Largest speeds, m/s.
    labels : (c,) sequence of Label
    """

    kind = "tool_speed"
    role = Role.PROCESS
    longer_time = "relieves"

    def __init__(
        self, robot: Robot, tables: Sequence[SpeedTable], labels: Sequence[Label]
    ) -> None:
        self._tool, self._tables, self.labels = ToolSpeed(robot), tables, tuple(labels)
        self.lower, self.upper = np.full(len(tables), -np.inf), np.ones(len(tables))
        self.breaks = np.unique(
            np.concatenate(
                [table.places for table in tables if len(table.places) > 1] or [[]]
            )
        )

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`: the largest figure of a table stands for all of them."""
        figures = [table.largest for table in self._tables]
        return tuple(
            Bound(column, figure, figure, 1.0 / figure)
            for column, figure in enumerate(figures)
        )

    def largest_at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Largest speeds, (K, c), m/s, at path coordinates s, (K,), and their derivatives by s."""
        largest, slopes = zip(*(table.at(s) for table in self._tables), strict=True)
        return np.column_stack(largest), np.column_stack(slopes)

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return np.asarray(
            self._tool.speed(motion)[:, None] / self.largest_at(motion.s)[0]
        )

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        largest, slope = self.largest_at(motion.s)
        speed, by_q, by_qdot = self._tool.derivatives(motion)
        q, qdot = (part[:, None] / largest[:, :, None] for part in (by_q, by_qdot))
        return Partials(q=q, qdot=qdot, s=-speed[:, None] * slope / largest**2)

    def lines(
        self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray
    ) -> PhaseLines:
        """See `Limit.lines`: the square of the ratio."""
        squares = (self._tool.slope(q, q_ds)[:, None] / self.largest_at(s)[0]) ** 2
        return PhaseLines(None, squares, np.zeros_like(squares))


def build_tool_speed(robot: Robot, task: Task) -> ToolSpeedLimit | None:
    """Build the limit where the task has one, or its path has feed rates."""
    speed, feed = task.tool_limits.speed, task.tool_limits.feed
    tables, labels = [], []
    if speed is not None:
        given = (
            (speed.s, speed.speed)
            if isinstance(speed, SpeedTableModel)
            else ((0.0,), (speed,))
        )
        tables.append(SpeedTable(*given))
        labels.append(
            Label(
                "tool", "speed", "m/s", "tool_limits.speed", share="tool speed / limit"
            )
        )
    for part in feed:
        tables.append(SpeedTable(part.s, part.speed, whole=False))
        labels.append(
            Label(
                f"tool, s = {part.s[0]:g} to {part.s[-1]:g},",
                "feed rate",
                "m/s",
                "tool_limits.feed",
            )
        )
    return ToolSpeedLimit(robot, tables, labels) if tables else None
