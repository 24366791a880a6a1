"""Closed-form inverse kinematics: the protocol, the families, and the registry that finds a family for a geometry.

Examples
--------
>>> import brachis
>>> task_map = brachis.task_map_of(brachis.robots.scara3, ["x", "y"])
>>> match = brachis.ik.find(brachis.robots.scara3, task_map, ["j3"])
>>> match.family, match.solver.branches
('planar', ('elbow_positive', 'elbow_negative'))
"""

from brachis.ik.protocol import (
    Family,
    FormulaSolver,
    IKSolver,
    NotApplicableError,
    ik_family,
)
from brachis.ik.registry import (
    BUILTIN,
    NO_CLOSED_FORM,
    Match,
    TriedDecomposition,
    check_families,
    default_task_space,
    find,
    find_all,
    missing_eaik,
)
from brachis.ik.screws import ChainGeometry, PosedScrews
from brachis.ik.solver_checks import check_answers

__all__ = [
    "BUILTIN",
    "NO_CLOSED_FORM",
    "ChainGeometry",
    "Family",
    "FormulaSolver",
    "IKSolver",
    "Match",
    "NotApplicableError",
    "PosedScrews",
    "TriedDecomposition",
    "check_answers",
    "check_families",
    "default_task_space",
    "find",
    "find_all",
    "ik_family",
    "missing_eaik",
]
__dir__ = __all__.copy  # what tab completion shows
