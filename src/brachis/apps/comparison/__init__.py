"""A motion that runs today beside the one that is planned along its path, within the same limits."""

from brachis.apps.comparison.comparison import (
    Comparison,
    RatioBounds,
    Use,
    bound_ratios,
)
from brachis.apps.comparison.planned import compare, plot_today

__all__ = ["Comparison", "RatioBounds", "Use", "bound_ratios", "compare", "plot_today"]
