"""From limits at collocation points to limits everywhere."""

from brachis.refine.loop import Refined, RefinementOptions, Solve, refine
from brachis.refine.violations import merged

__all__ = ["Refined", "RefinementOptions", "Solve", "merged", "refine"]
