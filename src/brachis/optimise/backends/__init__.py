"""Solver backends: a file for each, and a line in `TABLE`; libraries are imported when used."""

from brachis.errors import UnknownNameError
from brachis.optimise.backends import ipopt, slsqp, uno
from brachis.optimise.backends.child_process import Solver
from brachis.optimise.backends.monitor import objective_at, residual
from brachis.optimise.backends.protocol import (
    FEASIBLE,
    Curvature,
    Problem,
    Progress,
    SolverOptions,
    SolverReport,
    SolveStatus,
)

__all__ = [
    "FEASIBLE",
    "NAMES",
    "Curvature",
    "Problem",
    "Progress",
    "SolveStatus",
    "Solver",
    "SolverOptions",
    "SolverReport",
    "objective_at",
    "residual",
    "solver_for_large",
    "solvers_for",
]
TABLE = {
    backend.NAME: Solver(backend.NAME, backend.run, is_interior=backend is ipopt)
    for backend in (uno, ipopt, slsqp)
}
"""Backends by name, in the order in which ``auto`` tries them."""
NAMES = ("auto", *TABLE)


def solvers_for(name: str) -> tuple[Solver, ...]:
    """Backends to try for a name, in order: one, or all for ``auto``.

    Parameters
    ----------
    name : str

    Raises
    ------
    UnknownNameError
    """
    if name == "auto":
        return tuple(TABLE.values())
    if name not in TABLE:
        raise UnknownNameError("solver", name, NAMES, where="solver.name")
    return (TABLE[name],)


def solver_for_large(name: str) -> Solver | None:
    """Return what ``auto`` tries first for large, sparse programs; None for the name of a single solver.

    The effort of an interior-point method grows with the entries of the Jacobian, that of an active-set method with the
    square of the variables at least.
    """
    return TABLE["ipopt"] if name == "auto" else None
