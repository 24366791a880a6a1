"""From limits at collocation points to limits everywhere."""

from brachis.refine.excesses import merged
from brachis.refine.loop import Refined, RefinementOptions, Solve, refine

__all__ = ["Refined", "RefinementOptions", "Solve", "merged", "refine"]
