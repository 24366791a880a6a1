"""Joint maps: joint motion and its derivatives from curves y, such as (s, q_r)."""

from brachis.kinematics.closed_form import ClosedFormMap
from brachis.kinematics.direct import DirectJointMap
from brachis.kinematics.interpolation import Nodes, interpolate
from brachis.kinematics.joint_map import JointDerivatives, JointMap, JointState

__all__ = [
    "ClosedFormMap",
    "DirectJointMap",
    "JointDerivatives",
    "JointMap",
    "JointState",
    "Nodes",
    "interpolate",
]
