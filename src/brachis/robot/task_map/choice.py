"""The task map that a task asks for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.errors import InputError
from brachis.robot.robot import Robot
from brachis.robot.task_map.joint_space import JointSpace
from brachis.robot.task_map.pose import Pose
from brachis.robot.task_map.protocol import TaskMap
from brachis.robot.task_map.rows import AXES, POSE_ROWS, ROWS, YAW, position_rows
from brachis.robot.task_map.rows_and_yaw import RowsAndYaw
from brachis.robot.task_map.world_rows import WorldRows

FREE_ROLL = "pose_free_roll"
JOINTS = "joints"
WORDS = ("position", "pose", FREE_ROLL, JOINTS)
_IN_PLANE = 1.0 - 1e-9


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
    if rows == "position":
        rows = AXES
    if isinstance(rows, str):
        return _of_word(robot, rows)
    names, positions = tuple(rows), position_rows(rows)
    if names == POSE_ROWS:
        return Pose(robot)
    if any(row not in ROWS for row in names) or len(set(names)) != len(names) or not positions:
        allowed = f"{', '.join(ROWS)}, each once"
        raise InputError("rows are not usable", where="task_space", found=list(names), allowed=allowed)
    if YAW not in names:
        return WorldRows(robot, names)
    if names[-1] != YAW or len(positions) != 2:  # noqa: PLR2004
        raise InputError(
            "yaw needs exactly two position rows before it",
            where="task_space",
            found=list(names),
            allowed="[x, y, yaw]",
        )
    rotation = robot.tool_placement(np.zeros(robot.n)).rotation
    in_plane = np.linalg.norm(rotation[[AXES.index(row) for row in positions]], axis=0)
    if in_plane.max() < _IN_PLANE:
        raise InputError(
            "no axis of the tool frame lies in the plane in which yaw turns",
            where="task_space",
            found=list(names),
            hint="Attach a tool frame with an axis in this plane",
        )
    return RowsAndYaw(robot, names, int(np.argmax(in_plane >= _IN_PLANE)))


def _of_word(robot: Robot, word: str) -> Pose | JointSpace:
    """Return the joints or the poses, after a check that the tool can roll where that is asked for."""
    if word not in WORDS:
        raise InputError(
            "this task space does not exist",
            where="task_space",
            found=word,
            allowed=f"rows out of {', '.join(ROWS)}, or one of {', '.join(WORDS)}",
        )
    if word == JOINTS:
        return JointSpace(robot)
    if word == FREE_ROLL and not robot.rolls_freely:
        raise InputError(
            "the robot's tool does not roll freely",
            where="task_space",
            found=word,
            hint="brachis.robot.bind makes a robot whose tool does",
        )
    return Pose(robot)
