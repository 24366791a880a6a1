"""A first task for a robot, commented, which plans and verifies as it is."""

from brachis.starter.make import Starter, starter_task

__all__ = ["Starter", "starter_task"]
