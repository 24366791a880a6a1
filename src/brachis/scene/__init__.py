"""Bodies of the robot and of its surroundings, and the distances between these bodies."""

from brachis.scene.build import MANY_POSTURES, find_never_free, scene_of
from brachis.scene.scene import UNIT, ClosePairs, Scene
from brachis.scene.solids import Solid

__all__ = [
    "MANY_POSTURES",
    "UNIT",
    "ClosePairs",
    "Scene",
    "Solid",
    "find_never_free",
    "scene_of",
]
