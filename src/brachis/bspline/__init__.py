"""B-spline knots and sparse basis matrices."""

from brachis.bspline.basis import basis_matrix
from brachis.bspline.knots import clamped_uniform_knots

__all__ = ["basis_matrix", "clamped_uniform_knots"]
