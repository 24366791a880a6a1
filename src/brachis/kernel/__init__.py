"""The compiled kernel: what is computed at every point of every motion, in C.

Pinocchio builds the model and is the reference: the tests compare the kernel with it. See `docs/mathematics.md` for the
formulas.
"""

from brachis.kernel.chain import Chain
from brachis.kernel.chain_rule import (
    CurvePattern,
    MotionSlopes,
    ScaledQuantity,
    ValueGroups,
    VariableSlopes,
)
from brachis.kernel.formula import Formula
from brachis.kernel.halving import halve_intervals
from brachis.kernel.lattice import largest_parts
from brachis.kernel.newton import Prescribed, find_postures
from brachis.kernel.passes import bounds_of_pairs, go_backwards, go_forwards
from brachis.kernel.path_motion import Conditions, PathMotion, find_least_singular
from brachis.kernel.rotations import body_twists, rotation_derivatives
from brachis.kernel.splines import Basis, Spline, blossom, collocation
from brachis.kernel.tool import rotation_vectors, tool_derivatives
from brachis.kernel.turns import follow_turns, pick_nearest, set_turns

__all__ = [
    "Basis",
    "Chain",
    "Conditions",
    "CurvePattern",
    "Formula",
    "MotionSlopes",
    "PathMotion",
    "Prescribed",
    "ScaledQuantity",
    "Spline",
    "ValueGroups",
    "VariableSlopes",
    "blossom",
    "body_twists",
    "bounds_of_pairs",
    "collocation",
    "find_least_singular",
    "find_postures",
    "follow_turns",
    "go_backwards",
    "go_forwards",
    "halve_intervals",
    "largest_parts",
    "pick_nearest",
    "rotation_derivatives",
    "rotation_vectors",
    "set_turns",
    "tool_derivatives",
]
