"""SciPy's SLSQP (Kraft): a dense SQP that is always there; for small problems and as a third opinion."""

from __future__ import annotations

import numpy as np

from brachis.errors import UnreachableError
from brachis.optimise.backends.monitor import SolveMonitor, objective_at, residual
from brachis.optimise.backends.protocol import Problem, SolverReport, SolveStatus

NAME = "slsqp"
_STATUS = {
    0: SolveStatus.OPTIMAL,
    4: SolveStatus.INFEASIBLE,
    8: SolveStatus.ACCEPTABLE,
    9: SolveStatus.ITERATION_LIMIT,
}


class _StopSolveError(Exception):
    """Leaves SciPy's loop when the solve has to stop."""


def run(monitor: SolveMonitor, x: np.ndarray) -> SolverReport:
    """Solve the monitor's problem from `x`."""
    from scipy.optimize import Bounds, minimize

    problem = monitor.problem
    options = monitor.options
    below = np.isfinite(problem.lower)
    above = np.isfinite(problem.upper)
    last = x.copy()

    def rows(point: np.ndarray) -> np.ndarray:
        """Values of the rows; far beyond their bounds where there are none."""
        try:
            values = monitor.rows(point)
        except UnreachableError:
            if monitor.must_stop():
                raise _StopSolveError from None
            # SLSQP cannot back off from NaN; a violation far above any real one makes it shorten the step.
            return np.full(below.sum() + above.sum(), -1e3)
        gaps = [(values - problem.lower)[below], (problem.upper - values)[above]]
        return np.concatenate(gaps)

    def jacobian(point: np.ndarray) -> np.ndarray:
        dense = _dense(problem, monitor.jacobian(point))
        return np.concatenate([dense[below], -dense[above]])

    def objective(point: np.ndarray) -> float:
        # The rows say how bad an unreachable point is.
        return objective_at(problem, point, objective_at(problem, last))

    def callback(point: np.ndarray) -> None:
        """Leave the loop where the solve has to stop, or the iterates have settled."""
        last[:] = point
        value = objective(point)
        has_settled = monitor.has_settled(value, residual(problem, point))
        if monitor.between_iterations(value) or has_settled:
            raise _StopSolveError

    try:
        with monitor:
            # From a start that cannot be evaluated there is nothing to back off to.
            monitor.rows(x)
            result = minimize(  # type: ignore[call-overload]  # the stubs know neither Bounds nor this callback
                objective,
                x,
                method="SLSQP",
                jac=monitor.gradient,
                bounds=Bounds(problem.x_lower, problem.x_upper),
                constraints=[{"type": "ineq", "fun": rows, "jac": jacobian}],
                callback=callback,
                # SLSQP ends where the objective changes by less than ftol. Around an optimum inside an edge it changes
                # by the square of what is left of the gradient.
                options={
                    "maxiter": options.max_iterations,
                    "ftol": 1e-3 * options.tolerance,
                },
            )
    except (_StopSolveError, UnreachableError):
        # Where the time is up, or the iterates have settled, the report says so.
        status = SolveStatus.EVALUATION_ERROR
        return monitor.report(NAME, status, last, None, "stopped")
    # SciPy gives no status where no variable is free.
    status = _STATUS.get(
        result.get("status", 0 if result.success else 4), SolveStatus.FAILED
    )
    answer = np.array(result.x)
    if status is SolveStatus.OPTIMAL and not _is_stationary(problem, answer):
        status = SolveStatus.ACCEPTABLE
    return monitor.report(NAME, status, answer, None, str(result.message))


def _dense(problem: Problem, entries: np.ndarray) -> np.ndarray:
    """Jacobian as a matrix, (c, v)."""
    matrix = np.zeros((len(problem.lower), len(problem.x_lower)))
    matrix[problem.jacobian_rows, problem.jacobian_columns] = entries
    return matrix


def _is_stationary(problem: Problem, x: np.ndarray) -> bool:
    """Tell whether multipliers of the right sign balance the gradient.

    SciPy also stops where the objective stands still while rows come true, and calls that a success.
    """
    from scipy.optimize import nnls

    try:
        values = np.concatenate([problem.rows(x), x])
        slopes = np.vstack([_dense(problem, problem.jacobian(x)), np.eye(len(x))])
    except UnreachableError:
        return False
    at_lower = values <= np.concatenate([problem.lower, problem.x_lower]) + 1e-5
    at_upper = values >= np.concatenate([problem.upper, problem.x_upper]) - 1e-5
    pushing = np.vstack([slopes[at_lower], -slopes[at_upper]])
    gradient = problem.gradient(x)
    distance = np.linalg.norm(gradient)
    if len(pushing):
        _, distance = nnls(pushing.T, gradient)
    return bool(distance <= 1e-3 * np.linalg.norm(gradient))
