"""Bodies of the robot and around it, and the distances between them."""

from brachis.scene.scene import UNIT, Near, Scene, scene_of
from brachis.scene.solids import Solid

__all__ = ["UNIT", "Near", "Scene", "Solid", "scene_of"]
