"""Composing robots: mounting an arm on a linear axis, which gives a plain URDF.

Examples
--------
>>> import brachis
>>> rail = brachis.compose.Rail(range=(-2.0, 2.0), velocity=2.0, force=1500.0, mass=50.0, axis=(0, 1, 0))
>>> "<robot" in brachis.compose.on_rail("robots/tx90l_rail/arm.urdf", rail)
True
"""

from brachis.apps.compose.rail import Rail, on_rail

__all__ = ["Rail", "on_rail"]
__dir__ = __all__.copy  # what tab completion shows
