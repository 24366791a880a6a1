"""Why a motion takes as long as it does: what limits, speeds and waits cost, from the plan's own multipliers."""

from brachis.explain.motion import explain_motion
from brachis.explain.multipliers import (
    ActiveSet,
    Multipliers,
    multipliers_of,
)
from brachis.explain.sensitivities import LimitBound, figures_of, sensitivities_at
from brachis.trajectory.sensitivities import TIMINGS, Sensitivities, Sensitivity

__all__ = [
    "TIMINGS",
    "ActiveSet",
    "LimitBound",
    "Multipliers",
    "Sensitivities",
    "Sensitivity",
    "explain_motion",
    "figures_of",
    "multipliers_of",
    "sensitivities_at",
]
