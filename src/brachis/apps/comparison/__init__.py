"""Comparison of a recorded motion with a motion planned along the same path and within the same limits."""

from brachis.apps.comparison.comparison import (
    Comparison,
    Use,
    compare,
    plot_both_motions,
)
from brachis.apps.comparison.rows import RatioBounds, bound_ratios
from brachis.apps.comparison.tracking import AxisTracking, Tracking, compare_run

__all__ = [
    "AxisTracking",
    "Comparison",
    "RatioBounds",
    "Tracking",
    "Use",
    "bound_ratios",
    "compare",
    "compare_run",
    "plot_both_motions",
]
