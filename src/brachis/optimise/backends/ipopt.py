"""IPOPT through the ipyopt wheel: an interior-point method, the second opinion where Uno fails.

The Hessian is IPOPT's limited-memory approximation. https://coin-or.github.io/Ipopt
"""

from __future__ import annotations

import numpy as np

from brachis.errors import UnreachableError
from brachis.optimise.backends.child_process import apart_if_large, one_at_a_time
from brachis.optimise.backends.monitor import Watch, from_finite_numbers, objective_at
from brachis.optimise.backends.protocol import (
    Problem,
    Progress,
    SolverOptions,
    SolverReport,
    SolveStatus,
)

name = "ipopt"

_STATUS = {
    0: SolveStatus.OPTIMAL,
    1: SolveStatus.ACCEPTABLE,
    2: SolveStatus.INFEASIBLE,
    3: SolveStatus.ACCEPTABLE,  # search direction too small: judged by its residuals
    -1: SolveStatus.ITERATION_LIMIT,
    -4: SolveStatus.TIME_LIMIT,
    -5: SolveStatus.TIME_LIMIT,
    -13: SolveStatus.EVALUATION_ERROR,
}
_INFINITY = 2e19  # IPOPT takes bounds beyond 1e19 for none


@from_finite_numbers
@one_at_a_time
@apart_if_large
def solve(
    problem: Problem, x: np.ndarray, options: SolverOptions, progress: Progress | None
) -> SolverReport:
    """See `brachis.optimise.backends.protocol.Solver`."""
    import ipyopt

    watch = Watch(problem, options, progress)

    def objective(point: np.ndarray) -> float:
        return objective_at(problem, point, np.nan)

    def objective_gradient(point: np.ndarray, out: np.ndarray) -> None:
        try:
            out[:] = watch.gradient(point)
        except UnreachableError:
            out[:] = np.nan

    def rows(point: np.ndarray, out: np.ndarray) -> None:
        try:
            out[:] = watch.rows(point)
        except UnreachableError:
            out[:] = np.nan  # IPOPT shortens the step

    def jacobian(point: np.ndarray, out: np.ndarray) -> None:
        try:
            out[:] = watch.jacobian(point)
        except UnreachableError:
            out[:] = np.nan

    def intermediate(
        _mode: int, _iteration: int, objective: float, infeasibility: float, *_: float
    ) -> bool:
        stop = watch.between_iterations(objective)
        return not (watch.has_settled(objective, infeasibility) or stop)

    backend = ipyopt.Problem(
        len(x),
        np.clip(problem.x_lower, -_INFINITY, _INFINITY),
        np.clip(problem.x_upper, -_INFINITY, _INFINITY),
        len(problem.lower),
        np.clip(problem.lower, -_INFINITY, _INFINITY),
        np.clip(problem.upper, -_INFINITY, _INFINITY),
        (problem.jacobian_rows, problem.jacobian_columns),
        (np.array([], dtype=int), np.array([], dtype=int)),
        objective,
        objective_gradient,
        rows,
        jacobian,
        intermediate_callback=intermediate,
        ipopt_options={
            "print_level": 0,
            "sb": "yes",
            "tol": options.tolerance,
            "constr_viol_tol": options.tolerance,
            "max_iter": options.max_iterations,
            "hessian_approximation": "limited-memory",
            "mu_strategy": "adaptive",
            "bound_relax_factor": 0.0,
        },
    )
    multipliers = np.zeros(len(problem.lower))
    with watch:
        answer, _, code = backend.solve(x.copy(), mult_g=multipliers)
    status = _STATUS.get(int(code), SolveStatus.FAILED)
    return watch.report(
        name, status, np.array(answer), -multipliers, f"return code {code}"
    )
