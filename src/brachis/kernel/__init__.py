"""The compiled kernel: C code for the computations that are repeated at every point of every motion.

Pinocchio builds the model and serves as the reference: the tests compare the kernel with it. See `docs/mathematics.md`
for the formulas.
"""

from brachis.kernel.chain import Chain, TorqueDerivatives
from brachis.kernel.chain_rule import (
    CurvePattern,
    MotionSlopes,
    VariableSlopes,
    differentiate,
)
from brachis.kernel.formula import Formula
from brachis.kernel.halving import halve_intervals
from brachis.kernel.lattice import find_largest_products
from brachis.kernel.newton import Prescribed, find_postures
from brachis.kernel.passes import bounds_of_pairs, go_backwards, go_forwards
from brachis.kernel.path_motion import Fault, PathMotion, find_least_singular
from brachis.kernel.postures import Branch
from brachis.kernel.rotations import body_twists, rotation_derivatives
from brachis.kernel.splines import Basis, Spline, bernstein, blossom, collocation
from brachis.kernel.tool import rotation_vectors, tool_derivatives
from brachis.kernel.value_groups import (
    FormulaQuantity,
    Quantity,
    ScaledQuantity,
    ValueGroups,
)

__all__ = [
    "Basis",
    "Branch",
    "Chain",
    "CurvePattern",
    "Fault",
    "Formula",
    "FormulaQuantity",
    "MotionSlopes",
    "PathMotion",
    "Prescribed",
    "Quantity",
    "ScaledQuantity",
    "Spline",
    "TorqueDerivatives",
    "ValueGroups",
    "VariableSlopes",
    "bernstein",
    "blossom",
    "body_twists",
    "bounds_of_pairs",
    "collocation",
    "differentiate",
    "find_largest_products",
    "find_least_singular",
    "find_postures",
    "go_backwards",
    "go_forwards",
    "halve_intervals",
    "rotation_derivatives",
    "rotation_vectors",
    "tool_derivatives",
]
