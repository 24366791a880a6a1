"""The table of solver backends."""

from __future__ import annotations

from brachis.errors import UnknownNameError
from brachis.optimise.backends import ipopt, slsqp, uno
from brachis.optimise.backends.protocol import Solver

TABLE: dict[str, Solver] = {backend.name: backend for backend in (uno, ipopt, slsqp)}
AUTO_ORDER = ("uno", "ipopt", "slsqp")
"""The order in which ``auto`` tries them."""
CURVED_ORDER = ("slsqp", "uno", "ipopt")
"""That order where a mean over the motion is held: its optimum is no vertex, and a full Hessian approximation pays."""
NAMES = ("auto", *TABLE)


def solver_named(name: str, *, curved: bool = False) -> tuple[Solver, ...]:
    """Backends to try for a name, in order: one, or all for ``auto``.

    Parameters
    ----------
    name : str
    curved : bool, optional
        Whether a mean over the whole motion is held.

    Raises
    ------
    UnknownNameError
    """
    if name == "auto":
        return tuple(TABLE[each] for each in (CURVED_ORDER if curved else AUTO_ORDER))
    if name not in TABLE:
        raise UnknownNameError("solver", name, NAMES, where="solver.name")
    return (TABLE[name],)
