"""B-spline knots and basis functions."""

from brachis.bspline.basis import ORDERS, basis_derivatives, basis_functions, basis_matrix, local_basis
from brachis.bspline.insertion import insert_knots
from brachis.bspline.knots import clamped_knots, clamped_uniform_knots, spread

__all__ = [
    "ORDERS",
    "basis_derivatives",
    "basis_functions",
    "basis_matrix",
    "clamped_knots",
    "clamped_uniform_knots",
    "insert_knots",
    "local_basis",
    "spread",
]
