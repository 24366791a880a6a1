"""Task maps: from joint positions to task coordinates; one kind per file."""

from brachis.robot.task_map.choice import JOINTS, JointSpace, task_map_of
from brachis.robot.task_map.protocol import TaskDerivatives, TaskMap
from brachis.robot.task_map.tool import Pose, RowsAndYaw, WorldRows

__all__ = [
    "JOINTS",
    "JointSpace",
    "Pose",
    "RowsAndYaw",
    "TaskDerivatives",
    "TaskMap",
    "WorldRows",
    "task_map_of",
]
