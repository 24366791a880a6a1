"""A motion that runs today beside the one that is planned along its path, within the same limits."""

from brachis.comparison.comparison import Comparison, Use
from brachis.comparison.figure import plot_today
from brachis.comparison.planned import compare
from brachis.comparison.rows import RatioBounds, bound_ratios

__all__ = ["Comparison", "RatioBounds", "Use", "bound_ratios", "compare", "plot_today"]
