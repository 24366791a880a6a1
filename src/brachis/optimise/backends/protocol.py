"""The interface of a solver: it gets a problem and options, and returns a report."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from brachis.common.summary import Summary

FEASIBLE = 1e-5
"""Largest violation of rows and bounds, dimensionless, that refinement can still remove."""


class SolveStatus(enum.Enum):
    """How a solve ended. The value is the text shown to the user, with advice."""

    OPTIMAL = "optimal: the first-order conditions are met"
    ACCEPTABLE = "acceptable: feasible, but the solver could not confirm optimality; another start may be better"
    STAGNATED = "stagnated: feasible, and the last iterations gained no time; other motions take just as long"
    FOLLOWED = "followed: feasible, along the fastest timing of the best joint path that was found"
    ITERATION_LIMIT = "iteration limit reached; raise solver.max_iterations"
    STALLED = "the solver made no progress; another start or solver may do better"
    TIME_LIMIT = "time limit reached"
    INFEASIBLE = "no feasible point near this start; check the limits, choose another redundant joint or start posture"
    EVALUATION_ERROR = "the motion could not be evaluated near this start; choose another redundant joint"
    FAILED = "the solver failed; choose another solver"

    @property
    def usable(self) -> bool:
        """Whether a solve with this status gave a solution that satisfies the rows."""
        return self in (
            SolveStatus.OPTIMAL,
            SolveStatus.STAGNATED,
            SolveStatus.ACCEPTABLE,
            SolveStatus.FOLLOWED,
        )


@dataclass(frozen=True, eq=False)
class Curvature:
    """The known part of the Hessian of a problem's Lagrangian, L = objective - multipliers . rows.

    Attributes
    ----------
    hessian : callable
        ``hessian(x, objective_multiplier, multipliers)`` returns the known part, (v, v). The multiplier of the
        objective is 0 in a restoration; the multipliers of the rows are (c,).
    multipliers : (c,) ndarray
        First guess of the multipliers. It is used until the known part is large enough with the solver's multipliers.
    """

    hessian: Callable[[np.ndarray, float, np.ndarray], np.ndarray]
    multipliers: np.ndarray


class ProgramRows(Protocol):
    """Variables with bounds, and rows of values between bounds."""

    x_lower: np.ndarray
    x_upper: np.ndarray

    @property
    def jacobian_rows(self) -> np.ndarray:
        """Row of each entry of the Jacobian."""

    @property
    def jacobian_columns(self) -> np.ndarray:
        """Column of each entry of the Jacobian."""

    @property
    def lower(self) -> np.ndarray:
        """Lower bounds of the rows."""

    @property
    def upper(self) -> np.ndarray:
        """Upper bounds of the rows."""

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Return the values of the rows; raise UnreachableError where the values do not exist."""

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return the entries of the Jacobian on its pattern; raise UnreachableError as `rows` does."""


class NonlinearProgram(ProgramRows, Protocol):
    """Interface of a sparse nonlinear program, for example `brachis.optimise.program.Program`."""

    def objective(self, x: np.ndarray) -> float:
        """Return the value to minimise; raise UnreachableError where the value does not exist."""

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Return the gradient of the objective; raise UnreachableError as `objective` does."""

    def curvature(self, x: np.ndarray) -> Curvature | None:
        """Return the known part of the Lagrangian's Hessian, for a solve from x; None if no part is known."""


@dataclass(frozen=True)
class SolverOptions:
    """Options of a solve.

    Attributes
    ----------
    tolerance : float
        Tolerance on constraint violation and optimality, dimensionless.
    max_iterations : int
    time_limit : float
        Time limit, s. With 0, no solve is started.
    progress : float
        Minimum relative gain of the last iterates over the best earlier iterate; with less, a solve has stagnated.
        Iterates are compared by their objective times 1 + violation. Only those that violate rows by at most 1e-3, or
        ten times the tolerance, are compared. Interior-point methods compare only with the `patience` iterates just
        before, and a rise counts as much as a gain.
    patience : int
        Number of iterates that count as the last iterates.
    acceptable : float
        Largest violation with which a solution counts as usable, however the solve ended.
    first_step : float
        Factor on the initial radius of Uno's trust region, or on the distance by which IPOPT moves the start away from
        bounds. Below 1 for starts close to the solution.
    damping : float
        If positive, the Hessian is its known part plus this multiple of the median of its diagonal. Used by IPOPT.
    widening : float
        Maximum widening of a row's bound, as a fraction of the bound; no more than the tolerance. Used by Uno.
    anywhere : bool
        Whether iterates far from stationarity are compared too. This is suitable if an approximate solution is enough,
        but not if the solver creeps. Used by Uno; interior-point methods compare all iterates
        with a small barrier parameter.
    apart : bool
        Whether the solve runs in a separate process, which is ended if it sends nothing for a long time. The process
        takes about 0.07 s to start.
    learnt : (v, v) ndarray, optional
        `SolverReport.learnt` of an earlier solve with the same variables. Uno starts with this matrix if part of the
        problem's Hessian is known.
    """

    tolerance: float = 1e-6
    max_iterations: int = 300
    time_limit: float = 20.0
    progress: float = 1e-6
    patience: int = 15
    acceptable: float = -np.inf
    first_step: float = 1.0
    damping: float = 0.0
    widening: float = 0.0
    anywhere: bool = False
    apart: bool = False
    learnt: np.ndarray | None = None


@dataclass(frozen=True, repr=False)
class SolverReport(Summary):
    """Result of a solver.

    Attributes
    ----------
    solver : str
    status : SolveStatus
        Status, based on the residuals below and not only on the backend's own report.
    x : (v,) ndarray
    objective : float
        Objective, in s if it is the end time; infinite if `x` cannot be evaluated.
    violation : float
        Largest violation of rows and bounds, recomputed by brachis; infinite if `x` cannot be evaluated.
    multipliers : (c,) ndarray
        Multipliers of the rows, with L = objective - multipliers . rows. Zeros if the backend gives no multipliers.
    iterations : int
    wall_time : float
        Wall time of the solve, s.
    message : str
        Message of the backend.
    learnt : (v, v) ndarray or None
        Approximation of the Lagrangian's Hessian without the known part, if the backend built an approximation.
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
        """Whether the solution is within the limits at the collocation points, however the solve ended."""
        return self.violation <= FEASIBLE


Progress = Callable[[int, float], None]
"""Function called between iterations with their number and the objective in s. It may raise KeyboardInterrupt."""
