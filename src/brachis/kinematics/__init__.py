"""Decomposition kinematics: joint motion and its derivatives from y = (s, q_r)."""

from brachis.kinematics.decomposition import Decomposition, JointDerivatives, JointState
from brachis.kinematics.interpolation import Nodes, interpolate

__all__ = [
    "Decomposition",
    "JointDerivatives",
    "JointState",
    "Nodes",
    "interpolate",
]
