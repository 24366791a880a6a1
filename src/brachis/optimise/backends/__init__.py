"""Solver backends. Each has a file and a line in `SOLVERS`. The libraries of backends are imported when used."""

from importlib.util import find_spec

from brachis.errors import NotInstalledError, UnknownNameError
from brachis.optimise.backends import ipopt, uno, uno_interior
from brachis.optimise.backends.child_process import Solver
from brachis.optimise.backends.monitor import objective_at, report_point, residual
from brachis.optimise.backends.protocol import (
    FEASIBLE,
    Curvature,
    NonlinearProgram,
    ProgramRows,
    Progress,
    SolverOptions,
    SolverReport,
    SolveStatus,
)

__all__ = [
    "FEASIBLE",
    "NAMES",
    "Curvature",
    "NonlinearProgram",
    "ProgramRows",
    "Progress",
    "SolveStatus",
    "Solver",
    "SolverOptions",
    "SolverReport",
    "interior_solver",
    "objective_at",
    "report_point",
    "residual",
    "solvers_for",
]
SOLVERS = {
    backend.NAME: Solver(backend.NAME, backend.run, backend in (ipopt, uno_interior))
    for backend in (uno, ipopt, uno_interior)
}
"""Backends by name, in the order in which ``auto`` tries them. It tries only one of the two interior-point methods."""
NAMES = ("auto", *SOLVERS)


def solvers_for(name: str) -> tuple[Solver, ...]:
    """Return the backends to try for a name, in order. For ``auto`` there is one for each method, otherwise just one.

    Parameters
    ----------
    name : str

    Raises
    ------
    UnknownNameError
    NotInstalledError
        The name is ``ipopt``, but its package is not installed. There are wheels for one platform only.
    """
    if name == "auto":
        return SOLVERS["uno"], _interior()
    if name not in SOLVERS:
        raise UnknownNameError("solver", name, NAMES, where="solver.name")
    if name == "ipopt" and _interior() is not SOLVERS[name]:
        library = "ipyopt (it has wheels only for Linux on x86_64)"
        error = NotInstalledError("solver.name: ipopt", library, "ipopt")
        error.put_advice("Set solver.name: auto, uno or uno_interior")
        raise error
    return (SOLVERS[name],)


def _interior() -> Solver:
    """Return IPOPT if it is installed, otherwise Uno's interior-point method."""
    return SOLVERS["ipopt" if find_spec("ipyopt") else "uno_interior"]


def interior_solver(name: str) -> Solver | None:
    """Return the interior-point method of ``auto``, for large programs and given speeds; None if a solver is named.

    The effort of an interior-point method grows with the number of entries of the Jacobian. That of an active-set
    method grows at least with the square of the number of variables.
    """
    return _interior() if name == "auto" else None
