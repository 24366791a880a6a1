"""Limits on how fast the tool moves, turns and accelerates, and on how far it deviates from the path.

Speeds and accelerations are ratios to the limit: |v| / v_max <= 1.
With J the Jacobian of a velocity of the tool, v = J(q) qdot and its direction e = v / |v|,

    d|v|/dqdot = e . J,        d|v|/dq = e . dv/dq,

and likewise for the magnitude of the acceleration a = J qddot + Jdot qdot. A vector of length zero is given the
direction zero, because it is far from its limit.

The maximum speed of the tool frame's origin may be a piecewise linear function of the path coordinate (`SpeedProfile`).

Three tolerances need more than ranges of the tool's virtual joints: a cone, a sphere, and a box in the world's axes.
With the angles a (side) and b (lead), the tool's z axis is tilted by arccos(cos a cos b). A displacement d in the axes
of the path's orientation is R d in the axes of the world, where R is the rotation of the end of the chain.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.common.arrays import apply_each, cross
from brachis.common.labels import Label
from brachis.limits.protocol import (
    Bound,
    JointStates,
    Limit,
    Partials,
    Role,
    compute_inset,
)
from brachis.robot import Robot
from brachis.robot.task_map import Pose
from brachis.task import SpeedTable, Task

PROCESS_SPEED = "process speed"
"""Name of the setting that determines the maximum speed next to a part with a process speed."""


class ToolRatios(Limit):
    """Ratios of quantities of the tool to their limits, at most 1.

    Parameters
    ----------
    labels : (c,) sequence of Label
    figures : (c,) sequence of float
        The limits, in the units of the labels.
    """

    role = Role.PROCESS

    def __init__(self, labels: Sequence[Label], figures: Sequence[float]) -> None:
        self.labels = tuple(labels)
        self.lower = np.full(len(labels), -np.inf)
        self.upper = np.ones(len(labels))
        self.bounds = tuple(
            Bound(column, figure, figure, 1.0 / figure)
            for column, figure in enumerate(figures)
        )


class SpeedProfile:
    """Maximum speeds along the path: piecewise linear, with steps turned into ramps on their faster side.

    Parameters
    ----------
    s : (P,) sequence of float
        Ascending path coordinates. A coordinate that occurs twice marks a step.
    speed : (P,) sequence of float
        m/s.
    covers_path : bool, optional
        Whether the first speed also applies before the first coordinate, and the last speed after the last coordinate.
        Otherwise there is no limit there.

    Attributes
    ----------
    places : (p,) ndarray
        Path coordinates between which the speed is linear, without repetitions.
    speeds : (p,) ndarray
        Speeds at these coordinates, m/s. Between the given coordinates they are nowhere above the given speeds.
    largest : float
        Highest of the given speeds, m/s.
    """

    def __init__(
        self, s: Sequence[float], speed: Sequence[float], *, covers_path: bool = True
    ) -> None:
        stated = np.array(s, dtype=float)
        places = stated.copy()
        speeds = np.array(speed, dtype=float)
        ramp = 5e-3  # length in s: Newton steps need a slope
        for first in np.flatnonzero(np.diff(stated) == 0.0).tolist():
            # The side with the higher speed is moved away from the step, along the line to the next coordinate.
            rises = speeds[first + 1] > speeds[first]
            moved = first + 1 if rises else first
            onwards = 1 if rises else -1
            beyond = moved + onwards
            length = ramp
            if 0 <= beyond < len(stated):
                gap = abs(stated[beyond] - stated[moved])
                length = min(ramp, 0.4 * gap)
                speeds[moved] += length / gap * (speed[beyond] - speed[moved])
            places[moved] += onwards * length
        self.largest = float(speeds.max())
        self._covers_path = covers_path
        if not covers_path:  # outside, the speed continues to rise within a ramp
            places = np.concatenate([[places[0] - ramp], places, [places[-1] + ramp]])
            speeds = np.concatenate([20.0 * speeds[:1], speeds, 20.0 * speeds[-1:]])
        slopes = np.concatenate([[np.nan], np.diff(speeds) / np.diff(places), [np.nan]])
        bends = ~np.isclose(slopes[1:], slopes[:-1], rtol=1e-12, atol=1e-12)
        self.places = places[bends]
        self.speeds = speeds[bends]

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the maximum speeds at s, (K,), m/s, and their slopes over s, m/s; infinite where there is no limit."""
        if len(self.places) == 1:
            return np.full(len(s), self.speeds[0]), np.zeros(len(s))
        slopes = np.diff(self.speeds) / np.diff(self.places)
        slopes = np.concatenate([[0.0], slopes, [0.0]])
        index = np.searchsorted(self.places, s, side="right")
        beyond = (s < self.places[0]) | (s > self.places[-1])
        is_free = np.isnan(s) | (beyond & (not self._covers_path))
        speeds = np.interp(s, self.places, self.speeds)
        return np.where(is_free, np.inf, speeds), slopes[index]


class ToolMotionLimit(ToolRatios):
    """Ratio of a tool quantity to its limits: speed or acceleration of the frame's origin, or angular speed.

    Virtual joints do not move the tool: their positions are the deviation of the tool from the path.

    Parameters
    ----------
    robot : Robot
    quantity : {"speed", "angular speed", "acceleration"}
    tables : (c,) sequence of SpeedTable
        The limits, m/s, rad/s or m/s^2.
    labels : (c,) sequence of Label
    """

    longer_time = "relieves"

    def __init__(
        self,
        robot: Robot,
        quantity: str,
        tables: Sequence[SpeedProfile],
        labels: Sequence[Label],
    ) -> None:
        # Each table is represented by its largest figure.
        super().__init__(labels, [table.largest for table in tables])
        self.kind = f"tool_{quantity}".replace(" ", "_")
        self.is_of_tool_speed = quantity == "speed"
        self._robot = robot
        self._quantity = quantity
        self._tables = tables
        steps = [table.places for table in tables if len(table.places) > 1]
        self.breaks = np.unique(np.concatenate(steps or [[]]))

    def largest_at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the limits, (K, c), at path coordinates s, (K,), and their derivatives with respect to s."""
        largest, slopes = zip(*(table.at(s) for table in self._tables), strict=True)
        return np.column_stack(largest), np.column_stack(slopes)

    def _states(self, motion: JointStates) -> list[np.ndarray]:
        """Return q, qdot and qddot of the real joints, (K, n) each."""
        states = (motion.q, motion.qdot, motion.qddot)
        return [self._robot.of_real_joints(state) for state in states]

    def values(self, motion: JointStates) -> np.ndarray:
        chain = self._robot.chain
        sizes = chain.tool_sizes(self._quantity, *self._states(motion))
        return sizes[:, None] / self.largest_at(motion.s)[0]

    def partials(self, motion: JointStates) -> Partials:
        """Differentiate with respect to q, qdot and, for accelerations, qddot, (K, c, n) each, and to s, (K, c)."""
        chain = self._robot.chain
        sizes, slopes = chain.tool_size_slopes(self._quantity, *self._states(motion))
        largest, slope = self.largest_at(motion.s)
        q, qdot, qddot = (
            self._robot.of_real_joints(derivatives)[:, None] / largest[:, :, None]
            for derivatives in slopes
        )
        s = -sizes[:, None] * slope / largest**2
        by_qddot = qddot if self._quantity == "acceleration" else None
        return Partials(q, qdot, by_qddot, s=s)


def _label(quantity: str, unit: str) -> Label:
    key = f"tool_limits.{quantity}".replace(" ", "_")
    return Label("tool", quantity, unit, key, share=f"tool {quantity} / limit")


def build_tool_speed(robot: Robot, task: Task) -> ToolMotionLimit | None:
    """Build the limit from the task's tool speed, feed rates, and leads of process speeds; None if none is given."""
    limits = task.tool_limits
    speed = limits.speed
    tables = []
    labels = []
    if speed is not None:
        tables.append(
            SpeedProfile(speed.s, speed.speed)
            if isinstance(speed, SpeedTable)
            else SpeedProfile([0.0], [speed])
        )
        labels.append(_label("speed", "m/s"))
    leads = [lead for section in limits.process_speed for lead in section.leads]
    beside = (
        "before or after a part with a process speed, the tool is at its maximum speed"
    )
    for quantity, key, cause, tables_of_speed, text in (
        ("feed rate", "feed", "feed rate", limits.feed, ""),
        (
            "speed next to a process speed",
            "process_speed",
            PROCESS_SPEED,
            leads,
            beside,
        ),
    ):
        for table in tables_of_speed:
            tables.append(SpeedProfile(table.s, table.speed, covers_path=False))
            s = f"s = {table.s[0]:.4g} to {table.s[-1]:.4g}"
            active = text and f"at {s}, {text}"
            labels.append(
                Label(
                    f"tool, {s},",
                    quantity,
                    "m/s",
                    f"tool_limits.{key}",
                    active_text=active,
                    share="tool speed / limit",
                    cause=cause,
                )
            )
    return ToolMotionLimit(robot, "speed", tables, labels) if tables else None


def constant_limit(
    quantity: str, unit: str, robot: Robot, _task: Task, figure: float
) -> ToolMotionLimit:
    """Return the `ToolMotionLimit` of a quantity that is the same all along the path, in the given unit."""
    table = SpeedProfile([0.0], [figure])
    return ToolMotionLimit(robot, quantity, [table], [_label(quantity, unit)])


def _joints_of(robot: Robot, *directions: str) -> list[int]:
    """Return the indices of the tool's virtual joints for some directions, if the robot has such joints."""
    names = [joint.direction for joint in robot.tool_joints]
    first = len(robot.urdf_joints)
    return [
        first + names.index(direction) for direction in directions if direction in names
    ]


class _Size(ToolRatios):
    """Ratio of the tool's deviation from the path, zero or more, to the maximum deviation.

    Parameters
    ----------
    robot : Robot
    figure : float
        The maximum deviation, in the unit of the label.
    """

    at_rest = "posture"
    directions: tuple[str, ...]
    """Directions of the virtual joints on which the deviation depends."""
    label: Label

    def __init__(self, robot: Robot, _task: Task, figure: float) -> None:
        super().__init__([self.label], [figure])
        self._n = robot.n
        self._joints = _joints_of(robot, *self.directions)
        self._largest = np.radians(figure) if self.label.unit == "deg" else figure
        self.inset = compute_inset(self._largest)

    def _divide(self, slopes: np.ndarray, size: np.ndarray) -> Partials:
        """Divide slopes with respect to the virtual joints, (K, j), by `size`, (K, 1), and the limit; 0 for size 0."""
        by_q = np.zeros((len(slopes), 1, self._n))
        zero = np.zeros_like(slopes)
        by_q[:, 0, self._joints] = np.divide(
            slopes, self._largest * size, out=zero, where=size > 0.0
        )
        return Partials(q=by_q)


class TiltLimit(_Size):
    """Ratio of the angle between the z axes of the tool and the path to the maximum angle."""

    kind = "tool_tilt"
    directions = ("side", "lead")
    label = Label("tool", "tilt", "deg", "tolerances.orientation.tilt")

    def values(self, motion: JointStates) -> np.ndarray:
        angles = motion.q[:, self._joints]
        cosine = np.cos(angles).prod(axis=1, keepdims=True)
        return np.arccos(np.clip(cosine, -1.0, 1.0)) / self._largest

    def partials(self, motion: JointStates) -> Partials:
        """Differentiate the ratio with respect to q, (K, 1, n)."""
        angles = motion.q[:, self._joints]
        tilt = self.values(motion) * self._largest
        falls = np.tan(angles) * np.cos(angles).prod(axis=1, keepdims=True)
        return self._divide(falls, np.sin(tilt))


class DistanceLimit(_Size):
    """Ratio of the distance between tool and path to the maximum distance."""

    kind = "tool_distance"
    directions = ("x", "y", "z")
    label = Label("tool", "distance from the path", "m", "tolerances.position.sphere")

    def values(self, motion: JointStates) -> np.ndarray:
        away = motion.q[:, self._joints]
        return np.linalg.norm(away, axis=1, keepdims=True) / self._largest

    def partials(self, motion: JointStates) -> Partials:
        away = motion.q[:, self._joints]
        return self._divide(away, np.linalg.norm(away, axis=1, keepdims=True))


class RangeLimit(Limit):
    """Ranges for the displacement of the tool from the path along the world's axes.

    Parameters
    ----------
    robot : Robot
    ranges : (3, 2) ndarray
        Ranges along x, y and z, m.
    """

    kind = "tool_range"
    role = Role.PROCESS
    at_rest = "posture"

    def __init__(self, robot: Robot, ranges: np.ndarray) -> None:
        self._robot = robot
        self._joints = _joints_of(robot, "x", "y", "z")
        self._pose = Pose(robot)
        self._scale = 2.0 / (ranges[:, 1] - ranges[:, 0])
        self.inset = compute_inset(1.0 / self._scale)
        self.lower, self.upper = (ranges * self._scale[:, None]).T
        self.labels = tuple(
            Label(f"tool {axis}", "displacement", "m", f"tolerances.position.{axis}")
            for axis in "xyz"
        )
        self.bounds = tuple(
            Bound(axis, float(ranges[axis, end]), 2.0 / per_m, per_m, side)
            for axis, per_m in enumerate(self._scale.tolist())
            for end, side in enumerate(("lower", "upper"))
        )

    def values(self, motion: JointStates) -> np.ndarray:
        rotations = self._robot.chain.tool(motion.q, in_tool_axes=True)[1]
        away = motion.q[:, self._joints]
        return apply_each(rotations, away) * self._scale

    def partials(self, motion: JointStates) -> Partials:
        """Differentiate the values with respect to q, (K, 3, n)."""
        rotations = self._robot.chain.tool(motion.q, in_tool_axes=True)[1]
        away = motion.q[:, self._joints]
        turning = self._pose.twists(motion.q)[3:]
        by_q = cross(turning, away.T[:, :, None])
        for axis, column in enumerate(self._joints):
            by_q[axis, :, column] += 1.0
        in_world = np.einsum("kij,jkn->kin", rotations, by_q)
        return Partials(q=in_world * self._scale[:, None])


def build_tool_range(robot: Robot, task: Task) -> RangeLimit | None:
    """Build the limit; None unless the task gives the tool a tolerance box in the world's axes."""
    tolerance = task.tolerances.position
    if tolerance.axes == "tool" or tolerance.x is None:
        return None
    return RangeLimit(robot, np.array([tolerance.x, tolerance.y, tolerance.z]))
