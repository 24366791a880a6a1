"""Solver backends: a file for each, and a line in `SOLVERS`; libraries are imported when used."""

from importlib.util import find_spec

from brachis.errors import NotInstalledError, UnknownNameError
from brachis.optimise.backends import ipopt, uno, uno_interior
from brachis.optimise.backends.child_process import Solver
from brachis.optimise.backends.monitor import objective_at, residual
from brachis.optimise.backends.protocol import (
    FEASIBLE,
    Curvature,
    NonlinearProgram,
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
SOLVERS = {
    backend.NAME: Solver(backend.NAME, backend.run, backend in (ipopt, uno_interior))
    for backend in (uno, ipopt, uno_interior)
}
"""Backends by name, in the order in which ``auto`` tries them; of the two interior-point methods it takes one."""
NAMES = ("auto", *SOLVERS)


def solvers_for(name: str) -> tuple[Solver, ...]:
    """Backends to try for a name, in order: one, or for ``auto`` one of each method.

    Parameters
    ----------
    name : str

    Raises
    ------
    UnknownNameError
    NotInstalledError
        It is ``ipopt``, whose package has wheels for one platform alone.
    """
    if name == "auto":
        return SOLVERS["uno"], _interior()
    if name not in SOLVERS:
        raise UnknownNameError("solver", name, NAMES, where="solver.name")
    if name == "ipopt" and _interior() is not SOLVERS[name]:
        library = "ipyopt (it has wheels for Linux on x86_64 alone)"
        error = NotInstalledError("solver.name: ipopt", library, "ipopt")
        error.put_advice("Set solver.name: auto, uno or uno_interior")
        raise error
    return (SOLVERS[name],)


def _interior() -> Solver:
    """Return IPOPT where it is installed, else Uno's interior-point method."""
    return SOLVERS["ipopt" if find_spec("ipyopt") else "uno_interior"]


def solver_for_large(name: str) -> Solver | None:
    """Return what ``auto`` tries first for large, sparse programs; None for the name of a single solver.

    The effort of an interior-point method grows with the entries of the Jacobian, that of an active-set method with the
    square of the variables at least.
    """
    return _interior() if name == "auto" else None
