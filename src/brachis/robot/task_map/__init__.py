"""Task maps: from joint positions to task coordinates; one kind per file."""

from brachis.robot.task_map.choice import JOINTS, JointSpace, task_map_of
from brachis.robot.task_map.protocol import TaskMap
from brachis.robot.task_map.tool import Pose, RowsAndYaw

__all__ = [
    "JOINTS",
    "JointSpace",
    "Pose",
    "RowsAndYaw",
    "TaskMap",
    "task_map_of",
]
