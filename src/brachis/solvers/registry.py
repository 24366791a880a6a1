"""The table of solver backends."""

from __future__ import annotations

from brachis.errors import UnknownNameError
from brachis.solvers import ipopt, slsqp, uno
from brachis.solvers.protocol import Solver

TABLE: dict[str, Solver] = {backend.name: backend for backend in (uno, ipopt, slsqp)}
AUTO_ORDER = ("uno", "ipopt", "slsqp")
"""The order in which ``auto`` tries them."""
NAMES = ("auto", *TABLE)


def solver_named(name: str) -> tuple[Solver, ...]:
    """Backends to try for a name, in order: one, or all for ``auto``.

    Raises
    ------
    UnknownNameError
    """
    if name == "auto":
        return tuple(TABLE[each] for each in AUTO_ORDER)
    if name not in TABLE:
        raise UnknownNameError("solver", name, NAMES, where="solver.name")
    return (TABLE[name],)
