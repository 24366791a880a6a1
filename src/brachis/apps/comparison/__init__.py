"""Comparison of a recorded motion with the motion planned along the same path within the same limits."""

from brachis.apps.comparison.comparison import (
    Comparison,
    Use,
    compare,
    plot_both_motions,
)
from brachis.apps.comparison.rows import RatioBounds, bound_ratios

__all__ = [
    "Comparison",
    "RatioBounds",
    "Use",
    "bound_ratios",
    "compare",
    "plot_both_motions",
]
