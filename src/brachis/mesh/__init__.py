"""Knots where they pay: given intervals reached from few, meshes refined, and free knots."""

from brachis.mesh.freeing import free_knots
from brachis.mesh.growing import coarsest, grow
from brachis.mesh.halving import COARSE_INTERVALS, MeshOptions, refine_mesh
from brachis.mesh.settle import settle_knots

__all__ = [
    "COARSE_INTERVALS",
    "MeshOptions",
    "coarsest",
    "free_knots",
    "grow",
    "refine_mesh",
    "settle_knots",
]
