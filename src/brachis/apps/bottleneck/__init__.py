"""What slows a motion down: the cost of every limit, when each limit is active, and the distance to a reference.

Examples
--------
>>> import brachis
>>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
>>> lines = str(brachis.bottleneck.report(result)).splitlines()
>>> print(next(line for line in lines if "torque" in line))
10 % more torque at j1 (1 Nm) saves 3.4 % (87 ms)
"""

from brachis.apps.bottleneck.check import (
    CheckedSensitivity,
    SensitivityCheck,
    check_sensitivities,
)
from brachis.apps.bottleneck.optimum import plan_again
from brachis.apps.bottleneck.reference import Reference, find_reference
from brachis.apps.bottleneck.report import BottleneckReport, report
from brachis.apps.bottleneck.saturation import (
    RIPPLE,
    THRESHOLD,
    ActiveInterval,
    LimitRatios,
    PhaseLimits,
    Saturation,
    limit_ratios,
    limits_by_phase,
    saturations,
)
from brachis.trajectory.sensitivities import (
    BranchBoundary,
    Sensitivities,
    Sensitivity,
    TaskSaving,
)

__all__ = [
    "RIPPLE",
    "THRESHOLD",
    "ActiveInterval",
    "BottleneckReport",
    "BranchBoundary",
    "CheckedSensitivity",
    "LimitRatios",
    "PhaseLimits",
    "Reference",
    "Saturation",
    "Sensitivities",
    "Sensitivity",
    "SensitivityCheck",
    "TaskSaving",
    "check_sensitivities",
    "find_reference",
    "limit_ratios",
    "limits_by_phase",
    "plan_again",
    "report",
    "saturations",
]
__dir__ = __all__.copy  # what tab completion shows
