"""Solver backends behind one protocol: one per file, listed in `TABLE`, imported when used."""

from brachis.solvers.protocol import Problem, Progress, Solver, SolverOptions, SolverReport, SolveStatus
from brachis.solvers.registry import AUTO_ORDER, NAMES, solver_named
from brachis.solvers.watch import residual

__all__ = [
    "AUTO_ORDER",
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
