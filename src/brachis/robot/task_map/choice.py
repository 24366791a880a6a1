"""The task map that a task asks for: of the tool, with a tool that rolls freely, or of the joints themselves.

Free roll about the tool axis is a virtual joint after the tool frame, of zero inertia and without limits. A pose whose
rotation about the tool frame's z axis is left open has five rows. With a revolute joint about this axis added to the
chain it is a pose of six rows again, and the joint is one more that may be redundant: the closed forms for poses serve
both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from brachis.common import tolerances
from brachis.errors import InputError
from brachis.robot.friction import Friction
from brachis.robot.limits import UrdfLimit
from brachis.robot.robot import ROLL_JOINT, Robot
from brachis.robot.task_map.protocol import (
    AXES,
    POSE_ROWS,
    ROWS,
    YAW,
    TaskDerivatives,
    TaskMap,
    joint_rows,
    position_rows,
)
from brachis.robot.task_map.tool import Pose, RowsAndYaw, WorldRows


@dataclass(frozen=True, eq=False, repr=False)
class JointSpace(TaskMap):
    """All n joint positions; the Jacobian is the identity."""

    frame = pin.ReferenceFrame.LOCAL

    rows: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Name the rows after the joints."""
        object.__setattr__(self, "rows", joint_rows(self.robot.joint_names))

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of every joint's position."""
        return self.robot.position_units

    def values(self, q: np.ndarray) -> np.ndarray:
        """Return the joint positions themselves."""
        return q

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the displacement joint by joint; whole turns count, since the path says in which turn a joint is."""
        return np.asarray(first - second, dtype=float)

    def jacobian(self, twists: np.ndarray) -> np.ndarray:
        """Return identity matrices, (K, n, n)."""
        return np.broadcast_to(np.eye(self.m), (twists.shape[1], self.m, self.m))

    def velocity_slopes(self, twists: np.ndarray, qdot: np.ndarray) -> np.ndarray:
        """Return zeros, (K, n, n)."""
        return np.zeros((len(qdot), self.m, self.m))

    def derivatives(
        self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> TaskDerivatives:
        """Return zeros, (K, n, n) each."""
        zeros = self.velocity_slopes(twists, qdot)
        return TaskDerivatives(zeros, zeros, zeros)


FREE_ROLL = "pose_free_roll"
JOINTS = "joints"


def task_map_of(robot: Robot, rows: str | Sequence[str]) -> TaskMap:
    """Bind the asked rows, or the word for them, to a robot.

    Raises
    ------
    InputError
        A row or word is unknown, no axis of the tool frame lies in the yaw plane, or the tool cannot roll freely.

    Examples
    --------
    >>> import brachis
    >>> brachis.task_map_of(brachis.robots.iiwa14, "pose").m
    6
    """
    if rows == JOINTS:
        return JointSpace(robot)
    if rows == FREE_ROLL and not robot.rolls_freely:
        raise InputError(
            "the robot's tool does not roll freely",
            where="task_space",
            found=rows,
            hint="brachis.robot.bind makes a robot whose tool does",
        )
    if rows in ("pose", FREE_ROLL):
        return Pose(robot)
    if isinstance(rows, str) and rows != "position":
        raise InputError(
            "this task space does not exist",
            where="task_space",
            found=rows,
            allowed=f"rows out of {', '.join(ROWS)}, or one of position, pose, {FREE_ROLL}, {JOINTS}",
        )
    names = AXES if rows == "position" else tuple(rows)
    positions = position_rows(names)
    if names == POSE_ROWS:
        return Pose(robot)
    if not set(names) <= set(ROWS) or len(set(names)) < len(names) or not positions:
        only_yaw = set(names) <= {YAW}
        raise InputError(
            "no row of the position" if only_yaw else "unknown or repeated rows",
            where="task_space",
            found=list(names),
            allowed=f"{', '.join(ROWS)}, each once",
        )
    if YAW not in names:
        return WorldRows(robot, names)
    if names[-1] != YAW or len(positions) != 2:
        raise InputError(
            "yaw needs exactly two position rows before it",
            where="task_space",
            found=list(names),
            allowed="[x, y, yaw]",
        )
    rotation = robot.tool_placement(np.zeros(robot.n)).rotation
    plane = [AXES.index(row) for row in positions]
    lies_in_plane = np.linalg.norm(rotation[plane], axis=0) >= 1.0 - tolerances.ANGLE
    if not lies_in_plane.any():
        raise InputError(
            "no axis of the tool frame lies in the plane in which yaw turns",
            where="task_space",
            found=list(names),
            hint="Attach a tool frame with an axis in this plane",
        )
    return RowsAndYaw(robot, names, int(np.argmax(lies_in_plane)))


def bind(robot: Robot, space: str | Sequence[str]) -> tuple[Robot, TaskMap]:
    """Return the robot as a task space needs it, and the task map bound to it.

    Parameters
    ----------
    robot : Robot
    space : str or sequence of str
        Rows, or one of ``position``, ``pose``, ``pose_free_roll``. The last one adds the virtual joint `ROLL_JOINT`
        unless the robot has it already.

    Raises
    ------
    InputError
        See `task_map_of`; or the robot has a joint of the virtual joint's name.
    """
    if robot.rolls_freely and space != FREE_ROLL:
        raise InputError(
            "the robot's tool rolls freely",
            where="task_space",
            found=space,
            allowed=FREE_ROLL,
            hint="Use the robot as it was before it was bound to pose_free_roll",
        )
    if space == FREE_ROLL and not robot.rolls_freely:
        robot = with_free_roll(robot)
    return robot, task_map_of(robot, space)


def with_free_roll(robot: Robot) -> Robot:
    """Append the virtual joint `ROLL_JOINT` about the tool frame's z axis.

    Raises
    ------
    InputError
        The robot has a joint of this name.
    """
    if robot.model.existJointName(ROLL_JOINT):
        raise InputError(
            "a joint of the robot has the name of the virtual roll joint",
            where="task_space",
            found=ROLL_JOINT,
            hint="Rename the joint in the URDF",
        )
    model = robot.model.copy()
    tool = model.frames[robot.frame_id]
    turning = pin.JointModelRZ()
    joint = model.addJoint(tool.parentJoint, turning, tool.placement, ROLL_JOINT)
    name = f"{robot.tool_frame}/{ROLL_JOINT}"
    origin = pin.SE3.Identity()
    model.addFrame(
        pin.Frame(name, joint, robot.frame_id, origin, pin.FrameType.OP_FRAME)
    )
    friction = robot.friction
    return replace(
        robot,
        rolls_freely=True,
        model=model,
        joint_names=(*robot.joint_names, ROLL_JOINT),
        tool_frame=name,
        limits=robot.limits.with_free_joint(),
        urdf_limits=(*robot.urdf_limits, UrdfLimit(None, None, None, None)),
        friction=Friction(
            armature=np.append(friction.armature, 0.0),
            viscous=np.append(friction.viscous, 0.0),
            coulomb=np.append(friction.coulomb, 0.0),
            v_eps=np.append(friction.v_eps, 1.0),
        ),
    )
