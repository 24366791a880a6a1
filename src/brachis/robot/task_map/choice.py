"""The task map for a task: for the tool, for a tool that may deviate from the path, or for the joints themselves.

Each direction in which the tool may deviate from the path, such as a roll about its axis, is a virtual joint after the
tool frame. A pose with one open row thus becomes a pose of six rows again, with one more joint that may be redundant,
so that the closed forms for poses serve both cases.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from brachis.common import tolerances
from brachis.errors import InputError
from brachis.robot.friction import Friction
from brachis.robot.limits import UrdfLimit
from brachis.robot.robot import Robot
from brachis.robot.task_map.protocol import (
    ANGLES,
    AXES,
    POSE_ROWS,
    ROWS,
    TURN_ROWS,
    TaskDerivatives,
    TaskMap,
    joint_rows,
    position_rows,
)
from brachis.robot.task_map.tool import Pose, RowsAndAngle, RowsAndOrientation
from brachis.robot.tool_joints import (
    AXIS,
    FREE_ROLL,
    ToolJoint,
    rolls_freely,
    tool_joints_of,
)
from brachis.task import Tolerances


@dataclass(frozen=True, eq=False, repr=False)
class JointSpace(TaskMap):
    """All n joint positions; the Jacobian is the identity.

    Differences between positions include whole turns, because the path prescribes the turn of each joint.
    """

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of every joint's position."""
        return self.robot.position_units

    def values(self, q: np.ndarray) -> np.ndarray:
        """Return the joint positions themselves."""
        return q

    def jacobian(self, twists: np.ndarray) -> np.ndarray:
        """Return identity matrices, (K, n, n)."""
        return np.broadcast_to(np.eye(self.m), (twists.shape[1], self.m, self.m))

    def derivatives(
        self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> TaskDerivatives:
        """Return zeros, (K, n, n) each."""
        zeros = np.zeros((len(qdot), self.m, self.m))
        return TaskDerivatives(zeros, zeros, zeros)


JOINTS = "joints"
FREE = "free"
"""The task space without rows, in which a move is planned: all joints are redundant."""


def task_map_of(robot: Robot, rows: str | Sequence[str]) -> TaskMap:
    """Bind a task space, given by its rows or by a word for them, to a robot.

    Raises
    ------
    InputError
        A row or word is unknown, a joint tilts the tool relative to the axis of an angle, or the tool cannot roll
        freely.

    Examples
    --------
    >>> import brachis
    >>> brachis.task_map_of(brachis.robots.iiwa14, "pose").m
    6
    """
    if rows == JOINTS:
        return JointSpace(robot, joint_rows(robot.joint_names))
    if rows == FREE:
        return TaskMap(robot, ())
    if rolls_freely(rows) and (
        tool_joints_of(FREE_ROLL, None)[0] not in robot.tool_joints
    ):
        raise InputError(
            "the robot's tool does not roll freely",
            where="task_space",
            found=rows,
            hint="brachis.robot.bind makes a robot whose tool does",
        )
    if rows in ("pose", FREE_ROLL):
        return Pose(robot)
    is_word = isinstance(rows, str) and rows not in ("position", AXIS)
    names = {"position": AXES, AXIS: (AXIS,)}.get(str(rows), tuple(rows))
    if names == POSE_ROWS:
        return Pose(robot)
    positions = position_rows(names)
    turning = names[len(positions) :]
    is_known = not is_word and names and {*names} <= {*ROWS}
    is_ordered = names == (*positions, *turning[:1]) and len({*names}) == len(names)
    if not is_known or not is_ordered:
        raise InputError(
            "this task space does not exist",
            where="task_space",
            found=rows,
            allowed=f"rows out of {', '.join(AXES)}, each once, and after them one of {', '.join(ANGLES)}, {AXIS}; "
            f"or one of position, pose, {FREE_ROLL}, {JOINTS}, {FREE}",
        )
    if AXIS in names:
        return RowsAndOrientation(robot, (*positions, *TURN_ROWS))
    return _rows_and_angle(robot, names) if turning else TaskMap(robot, names)


def _rows_and_angle(robot: Robot, names: tuple[str, ...]) -> RowsAndAngle:
    """Bind rows of the position and an angle to a robot.

    Raises
    ------
    InputError
        A joint turns about a different axis than the angle, or no axis of the tool frame is perpendicular to that axis.
    """
    angle = names[-1]
    world_axis = ANGLES.index(angle)
    turning = np.abs(robot.chain.axes[robot.revolute])
    is_along = turning > 1.0 - tolerances.ANGLE
    tilting = np.flatnonzero(robot.revolute)[~is_along[:, world_axis]]
    if len(tilting):
        usual = [ANGLES[axis] for axis in np.flatnonzero(is_along.all(axis=0))]
        rows = ", ".join([*names[:-1], *usual])
        joints = ", ".join(robot.joint_names[i] for i in tilting)
        raise InputError(
            f"{angle} is the angle of tools that turn about the world's {AXES[world_axis]} axis alone",
            where="task_space",
            found=f"[{', '.join(names)}], with {joints} about other axes",
            hint=f"Set task_space: [{rows}]"
            if usual
            else "Set task_space: pose or pose_free_roll, or rows with axis, the direction of the tool's z axis",
        )
    rotation = robot.tool_placement(np.zeros(robot.n)).rotation
    plane = [axis for axis in range(3) if axis != world_axis]
    lies_across = np.linalg.norm(rotation[plane], axis=0) >= 1.0 - tolerances.ANGLE
    if not lies_across.any():
        raise InputError(
            f"no axis of the tool frame lies in the plane in which {angle} turns",
            where="task_space",
            found=list(names),
            hint="Attach a tool frame with an axis in this plane",
        )
    return RowsAndAngle(robot, names, int(np.argmax(lies_across)))


def bind(
    robot: Robot,
    space: str | Sequence[str],
    tolerances: Tolerances | None = None,
) -> tuple[Robot, TaskMap]:
    """Return the robot that a task space needs, and the task map bound to it.

    Parameters
    ----------
    robot : Robot
    space : str or sequence of str
        Rows, or one of ``position``, ``pose``, ``pose_free_roll``, ``joints``.
    tolerances : Tolerances, optional
        A virtual joint is added for each direction in which the tool may deviate from the path, unless the robot
        already has it.

    Raises
    ------
    InputError
        See `task_map_of`; or a joint of the robot has the name of a virtual joint.
    """
    joints = tool_joints_of(space, tolerances)
    if robot.tool_joints and robot.tool_joints != joints:
        raise InputError(
            "the robot is bound to a different task space or tolerances: its tool leaves the path in other ways",
            where="robot",
            found=", ".join(joint.name for joint in robot.tool_joints),
            allowed=", ".join(joint.name for joint in joints) or "no virtual joints",
            hint="Use the robot as it was before it was bound",
        )
    if joints and not robot.tool_joints:
        robot = with_tool_joints(robot, joints)
    return robot, task_map_of(robot, space)


def with_tool_joints(robot: Robot, joints: Sequence[ToolJoint]) -> Robot:
    """Append virtual joints after the tool frame.

    Raises
    ------
    InputError
        A joint of the robot has the name of a virtual joint.
    """
    model = robot.model.copy()
    frame = model.frames[robot.frame_id]
    last = frame.parentJoint
    place = frame.placement
    for joint in joints:
        if model.existJointName(joint.name):
            raise InputError(
                "a joint of the robot has the name of a virtual joint of the tool",
                where=joint.key,
                found=joint.name,
                hint="Rename the joint in the URDF",
            )
        kind = (
            pin.JointModelRevoluteUnaligned
            if joint.turns
            else pin.JointModelPrismaticUnaligned
        )
        last = model.addJoint(last, kind(np.array(joint.axis)), place, joint.name)
        place = pin.SE3.Identity()
    name = f"{robot.tool_frame}/{joints[-1].name}"
    model.addFrame(pin.Frame(name, last, robot.frame_id, place, pin.FrameType.OP_FRAME))
    count = len(joints)
    frictionless = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    friction = np.concatenate([robot.friction.table, frictionless])
    return replace(
        robot,
        tool_joints=tuple(joints),
        model=model,
        joint_names=(*robot.joint_names, *(joint.name for joint in joints)),
        tool_frame=name,
        limits=robot.limits.with_tool_joints(joints),
        urdf_limits=(*robot.urdf_limits, *(UrdfLimit(),) * count),
        friction=Friction(*friction.T),
    )
