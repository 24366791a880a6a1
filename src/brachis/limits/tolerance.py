"""Tolerances that are more than ranges of the tool's virtual joints: a cone, a sphere, a box in the world's axes.

With the angles a (side) and b (lead) the tool's z axis is tilted by arccos(cos a cos b). A displacement d in the axes
of the path's orientation is R d in the world's, with the rotation R of the chain's end.
"""

from __future__ import annotations

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
from brachis.limits.tool import ToolRatios
from brachis.robot import Robot
from brachis.robot.task_map import Pose
from brachis.task import Task


def _joints_of(robot: Robot, *ways: str) -> list[int]:
    """Return the virtual joints of the tool that move it in some ways, as far as there are such joints."""
    names = [joint.way for joint in robot.tool_joints]
    first = len(robot.urdf_joints)
    return [first + names.index(way) for way in ways if way in names]


class _Size(ToolRatios):
    """How far the tool is from the path, zero or more, over the largest size that is allowed.

    Parameters
    ----------
    robot : Robot
    ways : tuple of str
        In which the virtual joints move the tool on which it depends.
    label : Label
    figure : float
        The largest size, in the unit of the label.
    largest : float
        The same, rad or m.
    """

    at_rest = "posture"

    def __init__(
        self,
        robot: Robot,
        ways: tuple[str, ...],
        label: Label,
        figure: float,
        largest: float,
    ) -> None:
        super().__init__([label], [figure])
        self._n = robot.n
        self._joints = _joints_of(robot, *ways)
        self._largest = largest
        self.inset = compute_inset(largest)

    def _divide(self, slopes: np.ndarray, size: np.ndarray) -> Partials:
        """Return `slopes` by the virtual joints, (K, j), over a size, (K, 1), and the largest one; 0 for size 0."""
        by_q = np.zeros((len(slopes), 1, self._n))
        zero = np.zeros_like(slopes)
        by_q[:, 0, self._joints] = np.divide(
            slopes, self._largest * size, out=zero, where=size > 0.0
        )
        return Partials(q=by_q)


class TiltLimit(_Size):
    """Angle between the tool's z axis and that of the path over the largest one.

    Parameters
    ----------
    robot : Robot
    figure : float
        Largest tilt, degrees.
    """

    kind = "tool_tilt"

    def __init__(self, robot: Robot, figure: float) -> None:
        label = Label("tool", "tilt", "deg", "tolerances.orientation.tilt")
        super().__init__(robot, ("side", "lead"), label, figure, np.radians(figure))

    def values(self, motion: JointStates) -> np.ndarray:
        angles = motion.q[:, self._joints]
        cosine = np.cos(angles).prod(axis=1, keepdims=True)
        return np.arccos(np.clip(cosine, -1.0, 1.0)) / self._largest

    def partials(self, motion: JointStates) -> Partials:
        """Slopes of the tilt, over the largest one, by q, (K, 1, n)."""
        angles = motion.q[:, self._joints]
        tilt = self.values(motion) * self._largest
        falls = np.tan(angles) * np.cos(angles).prod(axis=1, keepdims=True)
        return self._divide(falls, np.sin(tilt))


class DistanceLimit(_Size):
    """Distance of the tool from the path over the largest one.

    Parameters
    ----------
    robot : Robot
    figure : float
        Largest distance, m.
    """

    kind = "tool_distance"

    def __init__(self, robot: Robot, figure: float) -> None:
        key = "tolerances.position.sphere"
        label = Label("tool", "distance from the path", "m", key)
        super().__init__(robot, ("x", "y", "z"), label, figure, figure)

    def values(self, motion: JointStates) -> np.ndarray:
        away = motion.q[:, self._joints]
        return np.linalg.norm(away, axis=1, keepdims=True) / self._largest

    def partials(self, motion: JointStates) -> Partials:
        away = motion.q[:, self._joints]
        return self._divide(away, np.linalg.norm(away, axis=1, keepdims=True))


class RangeLimit(Limit):
    """Displacement of the tool from the path along the world's axes within ranges.

    Parameters
    ----------
    robot : Robot
    ranges : (3, 2) ndarray
        Along x, y and z, m.
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
        """Slopes of the values by q, (K, 3, n)."""
        rotations = self._robot.chain.tool(motion.q, in_tool_axes=True)[1]
        away = motion.q[:, self._joints]
        turning = self._pose.twists(motion.q)[3:]
        by_q = cross(turning, away.T[:, :, None])
        for axis, column in enumerate(self._joints):
            by_q[axis, :, column] += 1.0
        in_world = np.einsum("kij,jkn->kin", rotations, by_q)
        return Partials(q=in_world * self._scale[:, None])


def build_tool_tilt(robot: Robot, task: Task) -> TiltLimit | None:
    """Build the limit of a task whose tool may tilt within a cone."""
    figure = task.tolerances.orientation.tilt
    return None if figure is None else TiltLimit(robot, figure)


def build_tool_distance(robot: Robot, task: Task) -> DistanceLimit | None:
    """Build the limit of a task whose tool may be within a sphere around the path."""
    figure = task.tolerances.position.sphere
    return None if figure is None else DistanceLimit(robot, figure)


def build_tool_range(robot: Robot, task: Task) -> RangeLimit | None:
    """Build the limit of a task whose tool may be within a box in the world's axes."""
    given = task.tolerances.position
    if given.axes == "tool" or given.x is None:
        return None
    return RangeLimit(robot, np.array([given.x, given.y, given.z]))
