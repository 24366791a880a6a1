"""URDF to Pinocchio model, limits and friction."""

from brachis.robot.friction import Friction
from brachis.robot.from_task import in_use
from brachis.robot.limits import Limits
from brachis.robot.robot import Robot
from brachis.robot.task_map import TaskMap, task_map_of
from brachis.robot.task_map.choice import bind
from brachis.robot.tool_joints import ToolJoint

__all__ = [
    "Friction",
    "Limits",
    "Robot",
    "TaskMap",
    "ToolJoint",
    "bind",
    "in_use",
    "task_map_of",
]
