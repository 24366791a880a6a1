"""Bodies of the robot and around it, and the distances between them."""

from brachis.scene.build import scene_of
from brachis.scene.scene import UNIT, ClosePairs, Scene
from brachis.scene.solids import Solid

__all__ = ["UNIT", "ClosePairs", "Scene", "Solid", "scene_of"]
