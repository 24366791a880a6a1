"""A first task for a robot, commented, which plans and verifies as it is."""

from brachis.starter.make import Starter, starter_task
from brachis.starter.space import natural_space

__all__ = ["Starter", "natural_space", "starter_task"]
