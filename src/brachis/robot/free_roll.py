"""Free roll about the tool axis: a virtual joint after the tool frame, of zero inertia and without limits.

A pose whose rotation about the tool frame's z axis is left open has five rows. With a revolute joint about this axis
added to the chain it is a pose of six rows again, and the joint is one more that may be redundant: the closed forms for
poses serve both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from brachis.errors import InputError
from brachis.robot.friction import Friction
from brachis.robot.limits import UrdfLimit
from brachis.robot.robot import ROLL_JOINT, Robot
from brachis.robot.task_map.choice import FREE_ROLL, task_map_of
from brachis.robot.task_map.protocol import TaskMap

_NO_SPEED_SCALE = 1.0


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
        raise InputError("the robot has a joint with the name of the virtual one", where="task_space", found=ROLL_JOINT)
    model = robot.model.copy()
    tool = model.frames[robot.frame_id]
    joint = model.addJoint(tool.parentJoint, pin.JointModelRZ(), tool.placement, ROLL_JOINT)
    frame = f"{robot.tool_frame}/{ROLL_JOINT}"
    model.addFrame(pin.Frame(frame, joint, robot.frame_id, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    old, friction = robot.limits, robot.friction
    return replace(
        robot,
        rolls_freely=True,
        model=model,
        joint_names=(*robot.joint_names, ROLL_JOINT),
        tool_frame=frame,
        limits=old.with_free_joint(),
        stated_limits=(*robot.stated_limits, UrdfLimit(None, None, None, None)),
        friction=Friction(
            armature=np.append(friction.armature, 0.0),
            viscous=np.append(friction.viscous, 0.0),
            coulomb=np.append(friction.coulomb, 0.0),
            v_eps=np.append(friction.v_eps, _NO_SPEED_SCALE),
        ),
    )
