"""SciPy's SLSQP (Kraft): a dense SQP that is always there; for small problems and as a third opinion."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from brachis.errors import UnreachableError
from brachis.optimise.backends.child_process import apart_if_large
from brachis.optimise.backends.monitor import Watch, from_finite_numbers, objective_at
from brachis.optimise.backends.protocol import (
    Problem,
    Progress,
    SolverOptions,
    SolverReport,
    SolveStatus,
)

name = "slsqp"

_STATUS = {
    0: SolveStatus.OPTIMAL,
    4: SolveStatus.INFEASIBLE,
    8: SolveStatus.ACCEPTABLE,
    9: SolveStatus.ITERATION_LIMIT,
}
_UNREACHABLE_ROWS = -1e3
"""SLSQP cannot back off from NaN; a violation far above any real one makes its line search shorten the step."""

_FLAT = 1e-3
"""SLSQP ends where the objective changes by less than this part of the tolerance: around an optimum that is no vertex
it changes by the square of what is left of the gradient."""
_ACTIVE = 1e-5
_STATIONARY = 1e-3


class _StopSolveError(Exception):
    """Leaves SciPy's loop when the solve has to stop."""


@from_finite_numbers
@apart_if_large
def solve(
    problem: Problem, x: np.ndarray, options: SolverOptions, progress: Progress | None
) -> SolverReport:
    """See `brachis.optimise.backends.protocol.Solver`."""
    from scipy.optimize import Bounds, minimize

    watch = Watch(problem, options, progress)
    below = np.isfinite(problem.lower)
    above = np.isfinite(problem.upper)
    shape = (len(problem.lower), len(x))
    last = x.copy()

    def rows(point: np.ndarray) -> np.ndarray:
        try:
            values = watch.rows(point)
        except UnreachableError:
            if watch.must_stop():
                raise _StopSolveError from None
            return np.full(below.sum() + above.sum(), _UNREACHABLE_ROWS)
        return np.concatenate(
            [(values - problem.lower)[below], (problem.upper - values)[above]]
        )

    def jacobian(point: np.ndarray) -> np.ndarray:
        entries = watch.jacobian(point)
        dense = sparse.coo_array(
            (entries, (problem.jacobian_rows, problem.jacobian_columns)), shape=shape
        ).toarray()
        return np.concatenate([dense[below], -dense[above]])

    def objective(point: np.ndarray) -> float:
        return objective_at(
            problem, point, objective_at(problem, last)
        )  # the rows say how bad an unreachable point is

    def callback(point: np.ndarray) -> None:
        last[:] = point
        if watch.between_iterations(objective(point)):
            raise _StopSolveError

    try:
        with watch:
            watch.rows(
                x
            )  # from a start that cannot be evaluated there is nothing to back off to
            result = minimize(  # type: ignore[call-overload]  # the stubs know neither Bounds nor this callback
                objective,
                x,
                method="SLSQP",
                jac=watch.gradient,
                bounds=Bounds(problem.x_lower, problem.x_upper),
                constraints=[{"type": "ineq", "fun": rows, "jac": jacobian}],
                callback=callback,
                options={
                    "maxiter": options.max_iterations,
                    "ftol": _FLAT * options.tolerance,
                },
            )
    except (_StopSolveError, UnreachableError):
        status = (
            SolveStatus.TIME_LIMIT if watch.timed_out else SolveStatus.EVALUATION_ERROR
        )
        return watch.report(name, status, last, None, "stopped")
    status = _STATUS.get(int(result.status), SolveStatus.FAILED)
    answer = np.array(result.x)
    if status is SolveStatus.OPTIMAL and not _is_stationary(problem, answer):
        status = SolveStatus.ACCEPTABLE
    return watch.report(name, status, answer, None, str(result.message))


def _is_stationary(problem: Problem, x: np.ndarray) -> bool:
    """Tell whether multipliers of the right sign balance the gradient.

    SciPy also stops where the objective stands still while rows come true, and calls that a success.
    """
    from scipy.optimize import nnls

    try:
        rows = problem.rows(x)
        entries = problem.jacobian(x)
    except UnreachableError:
        return False
    shape = (len(rows), len(x))
    dense = sparse.coo_array(
        (entries, (problem.jacobian_rows, problem.jacobian_columns)), shape=shape
    ).toarray()
    slopes = np.vstack([dense, np.eye(len(x))])
    values = np.concatenate([rows, x])
    lower = np.concatenate([problem.lower, problem.x_lower])
    upper = np.concatenate([problem.upper, problem.x_upper])
    pushing = np.vstack(
        [slopes[values <= lower + _ACTIVE], -slopes[values >= upper - _ACTIVE]]
    )
    gradient = problem.gradient(x)
    _, distance = (
        nnls(pushing.T, gradient) if len(pushing) else (None, np.linalg.norm(gradient))
    )
    return bool(distance <= _STATIONARY * np.linalg.norm(gradient))
