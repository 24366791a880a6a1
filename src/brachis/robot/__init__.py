"""The robot: from a URDF to a Pinocchio model, limits and friction."""

from brachis.robot.friction import Friction
from brachis.robot.limits import Limits
from brachis.robot.robot import Robot
from brachis.robot.task_map import TaskMap, task_map_of
from brachis.robot.task_map.choice import bind

__all__ = [
    "Friction",
    "Limits",
    "Robot",
    "TaskMap",
    "bind",
    "task_map_of",
]
