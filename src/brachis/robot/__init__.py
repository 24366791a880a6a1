"""URDF to Pinocchio model, limits and friction."""

from brachis.robot.friction import Friction
from brachis.robot.from_task import in_use
from brachis.robot.limits import Limits
from brachis.robot.robot import ROLL_JOINT, Robot
from brachis.robot.task_map import TaskMap, task_map_of
from brachis.robot.task_map.choice import bind

__all__ = [
    "ROLL_JOINT",
    "Friction",
    "Limits",
    "Robot",
    "TaskMap",
    "bind",
    "in_use",
    "task_map_of",
]
