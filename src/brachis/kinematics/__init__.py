"""Joint maps: joint motion and its derivatives from curves y, for example y = (s, q_r)."""

from brachis.ik.newton import Newton, solve_each
from brachis.kinematics.chart import (
    CHART,
    ChartMap,
    ChartRows,
    chart_around,
    moving_most,
    transversality,
)
from brachis.kinematics.closed_form import ClosedFormMap
from brachis.kinematics.interpolation import Nodes, interpolate, join_nodes
from brachis.kinematics.joint_map import (
    JointDerivatives,
    JointMap,
    JointSpaceMap,
    JointState,
)

__all__ = [
    "CHART",
    "ChartMap",
    "ChartRows",
    "ClosedFormMap",
    "JointDerivatives",
    "JointMap",
    "JointSpaceMap",
    "JointState",
    "Newton",
    "Nodes",
    "chart_around",
    "interpolate",
    "join_nodes",
    "moving_most",
    "solve_each",
    "transversality",
]
