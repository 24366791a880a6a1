"""The robot that a task file describes."""

from __future__ import annotations

import os

from brachis.errors import TaskError
from brachis.robot.robot import Robot
from brachis.task import RobotSettings


def robot_from_settings(
    settings: RobotSettings, *, urdf: str | os.PathLike[str] | None = None, urdf_text: str | None = None
) -> Robot:
    """Build the robot of a task.

    Parameters
    ----------
    settings : RobotSettings
        The task's ``robot`` part.
    urdf : path, optional
        URDF file to use in place of the one that the task names.
    urdf_text : str, optional
        Text of the URDF, where it has been kept beside the task; nothing is read from disk then.

    Raises
    ------
    TaskError
        No URDF is named; or a file of limits that was not read, because `load_task` did not make the task.
    UrdfError, UnknownNameError, LimitError, InputError
        See `Robot.from_urdf`.
    """
    source = urdf if urdf is not None else settings.urdf
    if source is None and urdf_text is None:
        raise TaskError("no URDF is named", where="robot.urdf", allowed="path of a URDF file")
    if settings.limits_file is not None:
        found, hint = settings.limits_file, "Make the task with brachis.load_task, or give robot.limits"
        raise TaskError("the file of limits was not read", where="robot.limits_file", found=found, hint=hint)
    return Robot.from_urdf(
        source if source is not None else "saved URDF",
        urdf_text=urdf_text,
        tool_frame=settings.tool_frame,
        base_frame=settings.base_frame,
        gravity=settings.gravity,
        locked_joints=settings.locked_joints,
        limits=settings.limits,
        friction=settings.friction.model_dump(),
        payload=settings.payload,
        tool_offset=settings.tool_offset,
        mounting=settings.mounting,
        speed_override=settings.speed_override,
    )
