"""Knots where they pay: meshes refined from coarse to fine, and free knots."""

from brachis.mesh.freeing import free_knots
from brachis.mesh.halving import COARSE_INTERVALS, MeshOptions, refine_mesh
from brachis.mesh.settle import settle_knots

__all__ = ["COARSE_INTERVALS", "MeshOptions", "free_knots", "refine_mesh", "settle_knots"]
