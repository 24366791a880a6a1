"""URDF to Pinocchio model, limits and friction."""

from brachis.robot.free_roll import bind
from brachis.robot.friction import Friction
from brachis.robot.in_use import in_use
from brachis.robot.limits import Limits
from brachis.robot.robot import ROLL_JOINT, Robot
from brachis.robot.task_map import TaskMap, task_map_of

__all__ = ["ROLL_JOINT", "Friction", "Limits", "Robot", "TaskMap", "bind", "in_use", "task_map_of"]
