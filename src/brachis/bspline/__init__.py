"""B-spline knots and basis functions."""

from brachis.bspline.basis import basis_matrix, basis_windows
from brachis.bspline.knots import clamped_uniform_knots

__all__ = ["basis_matrix", "basis_windows", "clamped_uniform_knots"]
