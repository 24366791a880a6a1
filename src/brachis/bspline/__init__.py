"""B-spline knots and basis functions."""

from brachis.bspline.basis import basis_matrix, basis_windows
from brachis.bspline.insertion import insert_knots
from brachis.bspline.knots import clamped_knots, clamped_uniform_knots, spread
from brachis.bspline.lengths import window_derivatives, windows_of_lengths

__all__ = [
    "basis_matrix",
    "basis_windows",
    "clamped_knots",
    "clamped_uniform_knots",
    "insert_knots",
    "spread",
    "window_derivatives",
    "windows_of_lengths",
]
