"""What a solver gets and gives: problem and options in, report out."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from brachis.common.summary import Summary

FEASIBLE = 1e-5
"""Violation of rows and bounds, dimensionless, that refinement mends."""


class SolveStatus(enum.Enum):
    """How a solve ended; the value is the advice to the user."""

    OPTIMAL = "optimal: first-order conditions hold"
    ACCEPTABLE = "acceptable: feasible, but the solver could not confirm optimality; another start may be better"
    STAGNATED = "stagnated: feasible, and the last iterations made it no faster; other motions take as long"
    FOLLOWED = "followed: feasible, along the fastest timing of the best joint path that was found"
    ITERATION_LIMIT = "iteration limit reached; raise solver.max_iterations"
    STALLED = "the solver made no progress; another start or solver may do better"
    TIME_LIMIT = "time limit reached"
    INFEASIBLE = "no feasible point near this start; check limits, choose another redundant joint or start posture"
    EVALUATION_ERROR = "the motion could not be evaluated near this start; choose another redundant joint"
    FAILED = "the solver failed; choose another solver"

    @property
    def usable(self) -> bool:
        """True where the answer satisfies the rows."""
        return self in (
            SolveStatus.OPTIMAL,
            SolveStatus.STAGNATED,
            SolveStatus.ACCEPTABLE,
            SolveStatus.FOLLOWED,
        )


@dataclass(frozen=True, eq=False)
class Curvature:
    """What is known of the Hessian of a problem's Lagrangian, L = objective - multipliers . rows.

    Attributes
    ----------
    hessian : callable
        ``hessian(x, objective_multiplier, multipliers)`` returns the known part, (v, v), by the multipliers of the
        objective, 0 in a restoration, and of the rows, (c,).
    multipliers : (c,) ndarray
        A first guess. It serves until those of a solver give the known part some size.
    """

    hessian: Callable[[np.ndarray, float, np.ndarray], np.ndarray]
    multipliers: np.ndarray


class NonlinearProgram(Protocol):
    """A sparse nonlinear program; `brachis.optimise.program.Program` is one."""

    x_lower: np.ndarray
    x_upper: np.ndarray

    @property
    def jacobian_rows(self) -> np.ndarray:
        """Rows of the entries of the Jacobian."""

    @property
    def jacobian_columns(self) -> np.ndarray:
        """Columns of the entries of the Jacobian."""

    @property
    def lower(self) -> np.ndarray:
        """Lower bounds of the rows."""

    @property
    def upper(self) -> np.ndarray:
        """Upper bounds of the rows."""

    def objective(self, x: np.ndarray) -> float:
        """Value to be minimised; raises UnreachableError where it does not exist."""

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Gradient of the objective; raises UnreachableError as `objective` does."""

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Values of the rows; raises UnreachableError where they do not exist."""

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Entries of the Jacobian on its pattern; raises UnreachableError as `rows` does."""

    def curvature(self, x: np.ndarray) -> Curvature | None:
        """Return what is known of the Lagrangian's Hessian in a solve from x; None if that is nothing."""


@dataclass(frozen=True)
class SolverOptions:
    """Bounds on a solve.

    Attributes
    ----------
    tolerance : float
        On constraint violation and optimality, dimensionless.
    max_iterations : int
    time_limit : float
        s; no solve is begun where it is 0.
    progress : float
        Least relative gain of the last iterates over the best one before; with less a solve has stagnated. An iterate
        counts with its objective times 1 + violation, if it violates rows by no more than 1e-3 or ten tolerances.
    patience : int
        How many iterates the last ones are.
    first_step : float
        Factor on the first radius of a trust region, for starts that are near the answer. Uno asks.
    widening : float
        Largest widening of a row's bound, as a part of it; no more than the tolerance. Uno asks.
    anywhere : bool
        Whether iterates far from stationarity count too: where near enough will do, and not where a solver creeps. Uno
        asks; IPOPT counts all iterates in any case.
    apart : bool
        Whether the solve runs in a process of its own, which is ended when nothing is heard of it for long. That takes
        some 0.07 s more.
    learnt : (v, v) ndarray, optional
        `SolverReport.learnt` of an earlier solve with the same variables. Uno starts with it if the problem knows a
        part of its Hessian.
    """

    tolerance: float = 1e-6
    max_iterations: int = 300
    time_limit: float = 20.0
    progress: float = 1e-6
    patience: int = 15
    first_step: float = 1.0
    widening: float = 0.0
    anywhere: bool = False
    apart: bool = False
    learnt: np.ndarray | None = None


@dataclass(frozen=True, repr=False)
class SolverReport(Summary):
    """Answer of a solver.

    Attributes
    ----------
    solver : str
    status : SolveStatus
        Judged by the residuals below, not by the backend's word alone.
    x : (v,) ndarray
    objective : float
        s, where it is the end time; infinite if `x` cannot be evaluated.
    violation : float
        Largest violation of rows and bounds, recomputed by brachis; infinite if `x` cannot be evaluated.
    multipliers : (c,) ndarray
        Of the rows, L = objective - multipliers . rows; zeros where the backend gives none.
    iterations : int
    wall_time : float
        s.
    message : str
        The backend's own words.
    learnt : (v, v) ndarray or None
        The Hessian of the Lagrangian, without the part that the problem knows, where the backend learnt it.
    """

    solver: str
    status: SolveStatus
    x: np.ndarray
    objective: float
    violation: float
    multipliers: np.ndarray
    iterations: int
    wall_time: float
    message: str
    learnt: np.ndarray | None = None

    @property
    def feasible(self) -> bool:
        """True where the answer is a motion within the limits at the collocation points, however the solve ended."""
        return self.violation <= FEASIBLE


Progress = Callable[[int, float], None]
"""Called between iterations with the iteration's number and the objective in seconds; may raise KeyboardInterrupt."""
