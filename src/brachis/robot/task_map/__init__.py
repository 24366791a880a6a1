"""Task maps: from joint positions to task coordinates; one kind per file."""

from brachis.robot.task_map.choice import FREE_ROLL, JOINTS, task_map_of
from brachis.robot.task_map.joint_space import JointSpace
from brachis.robot.task_map.pose import Pose
from brachis.robot.task_map.protocol import TaskDerivatives, TaskMap
from brachis.robot.task_map.rows_and_yaw import RowsAndYaw
from brachis.robot.task_map.world_rows import WorldRows

__all__ = [
    "FREE_ROLL",
    "JOINTS",
    "JointSpace",
    "Pose",
    "RowsAndYaw",
    "TaskDerivatives",
    "TaskMap",
    "WorldRows",
    "task_map_of",
]
