"""Knots where they pay: given intervals reached from few, meshes refined, and free knots."""

from brachis.mesh.adaptation import adapt_mesh
from brachis.mesh.h_refinement import COARSE_INTERVALS, MeshOptions, refine_mesh
from brachis.mesh.knot_optimisation import optimise_knots
from brachis.mesh.nested_iteration import coarsest, solve_nested

__all__ = [
    "COARSE_INTERVALS",
    "MeshOptions",
    "adapt_mesh",
    "coarsest",
    "optimise_knots",
    "refine_mesh",
    "solve_nested",
]
