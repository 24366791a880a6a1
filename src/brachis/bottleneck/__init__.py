"""What holds a motion back: what every limit costs, which limit is active when, and the distance to a reference.

Examples
--------
>>> import brachis
>>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
>>> print(str(brachis.bottleneck.report(result)).splitlines()[0])
10 % more torque at j1 (1 Nm) saves 3.4 % (87 ms)
"""

from brachis.bottleneck.check import CheckedSensitivity, SensitivityCheck, check_sensitivities
from brachis.bottleneck.knots import KnotCost, knot_cost
from brachis.bottleneck.ratios import LimitRatios, limit_ratios
from brachis.bottleneck.reference import Reference, find_reference
from brachis.bottleneck.saturation import RIPPLE, THRESHOLD, Saturation, Stretch, saturations
from brachis.bottleneck.saved import solved_again
from brachis.bottleneck.sensitivities import BranchBoundary, Sensitivities, Sensitivity, sensitivities
from brachis.bottleneck.whole import BottleneckReport, report

__all__ = [
    "RIPPLE",
    "THRESHOLD",
    "BottleneckReport",
    "BranchBoundary",
    "CheckedSensitivity",
    "KnotCost",
    "LimitRatios",
    "Reference",
    "Saturation",
    "Sensitivities",
    "Sensitivity",
    "SensitivityCheck",
    "Stretch",
    "check_sensitivities",
    "find_reference",
    "knot_cost",
    "limit_ratios",
    "report",
    "saturations",
    "sensitivities",
    "solved_again",
]
