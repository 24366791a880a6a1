"""A recorded motion beside the motion that is planned along its path, within the same limits."""

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
