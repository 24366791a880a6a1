"""The solver backends of this environment: ipyopt has wheels for Linux on x86_64 alone."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from brachis.optimise.backends import (
    SOLVERS,
    NonlinearProgram,
    SolverOptions,
    solvers_for,
)
from brachis.optimise.backends.protocol import SolverReport

INSTALLED = tuple(name for name in SOLVERS if name != "ipopt" or find_spec("ipyopt"))


def solve(program: NonlinearProgram, x: np.ndarray) -> SolverReport:
    """Solve a program from x with Uno."""
    (uno,) = solvers_for("uno")
    return uno.solve(program, x, SolverOptions(), None)
