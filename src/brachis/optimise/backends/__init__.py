"""Solver backends behind one protocol: one per file, listed in `TABLE`, imported when used."""

from brachis.optimise.backends.child_process import Solver
from brachis.optimise.backends.monitor import residual
from brachis.optimise.backends.protocol import (
    FEASIBLE,
    Problem,
    Progress,
    SolverOptions,
    SolverReport,
    SolveStatus,
)
from brachis.optimise.backends.registry import AUTO_ORDER, NAMES, solver_named

__all__ = [
    "AUTO_ORDER",
    "FEASIBLE",
    "NAMES",
    "Problem",
    "Progress",
    "SolveStatus",
    "Solver",
    "SolverOptions",
    "SolverReport",
    "residual",
    "solver_named",
]
