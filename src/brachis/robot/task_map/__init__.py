"""Task maps: from joint positions to task coordinates; one kind per file."""

from brachis.robot.task_map.choice import JOINTS, JointSpace, task_map_of
from brachis.robot.task_map.protocol import TaskMap
from brachis.robot.task_map.tool import Pose, RowsAndAngle, RowsAndOrientation

__all__ = [
    "JOINTS",
    "JointSpace",
    "Pose",
    "RowsAndAngle",
    "RowsAndOrientation",
    "TaskMap",
    "task_map_of",
]
