"""Uno (Vanaret and Leyffer): an active-set SQP with a filter and a trust region, the default.

Bang-bang optima are vertices of the feasible set, which an active-set method reaches in a few steps. The Hessian is
Uno's limited-memory approximation, the subproblem solver its BQPD. https://github.com/cvanaret/Uno
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from brachis.solvers.apart import apart_if_large
from brachis.solvers.one_at_a_time import one_at_a_time
from brachis.solvers.protocol import Problem, Progress, SolverOptions, SolverReport, SolveStatus
from brachis.solvers.watch import Watch, from_finite_numbers, objective_at

name = "uno"

_TRUST_RADII = (1.0, 0.2, 0.04)
"""First trust region radius, and those of the restarts after a stall. Uno's own 10 stalls on 1 of 8 random lines."""
_STALL_ITERATIONS = 7
_STALL_PROGRESS = 1e-3
_STALL_STATIONARITY = 0.1
_STATUS = {
    "FEASIBLE_KKT_POINT": SolveStatus.OPTIMAL,
    "FEASIBLE_FJ_POINT": SolveStatus.ACCEPTABLE,
    "FEASIBLE_SMALL_STEP": SolveStatus.ACCEPTABLE,
    "INFEASIBLE_STATIONARY_POINT": SolveStatus.INFEASIBLE,
    "INFEASIBLE_SMALL_STEP": SolveStatus.INFEASIBLE,
}
_STOPPED = {
    "ITERATION_LIMIT": SolveStatus.ITERATION_LIMIT,
    "TIME_LIMIT": SolveStatus.TIME_LIMIT,
    "EVALUATION_ERROR": SolveStatus.EVALUATION_ERROR,
}


@from_finite_numbers
@one_at_a_time
@apart_if_large
def solve(problem: Problem, x: np.ndarray, options: SolverOptions, progress: Progress | None) -> SolverReport:
    """See `brachis.solvers.protocol.Solver`."""
    with Watch(problem, options, progress) as watch:
        for radius in _TRUST_RADII:
            stall = _Stall(watch)
            result = _run(watch, x, radius, stall)
            x = np.array(result.primal_solution)
            if result.optimization_status.name == "USER_INTERRUPTION":  # Uno has a SIGINT handler of its own
                watch.interrupt = KeyboardInterrupt()
            if not stall.seen or watch.must_stop():
                break
    ending = result.optimization_status.name
    status = _STOPPED.get(ending) or _STATUS.get(result.solution_status.name, SolveStatus.FAILED)
    if stall.seen:
        status = SolveStatus.STALLED
    elif ending == "USER_TERMINATION":
        status = SolveStatus.ITERATION_LIMIT
    message = f"{ending.lower()}, {result.solution_status.name.lower()}"
    return watch.report(name, status, x, np.array(result.constraint_dual_solution), message)


class _Stall:
    """Uno's termination callback, which also stops a solve that creeps.

    Now and then the first steps wreck the Hessian approximation: steps then stay tiny for hundreds of iterations, far
    from stationarity. A new approximation and a smaller trust region cure it.
    """

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self._objectives: list[float] = []
        self.seen = False

    def __call__(self, point: np.ndarray, *rest: object) -> bool:
        *_, infeasibility, stationarity, _complementarity = rest
        problem = self._watch.problem
        objective = objective_at(problem, point[: len(problem.x_lower)])  # in restoration Uno appends elastic variables
        self._objectives.append(objective)
        stop = self._watch.between_iterations(objective) or self._watch.iterations >= self._watch.options.max_iterations
        near = infeasibility if stationarity <= _STALL_STATIONARITY else np.inf  # type: ignore[operator]
        stop = self._watch.has_settled(objective, near) or stop  # type: ignore[arg-type]
        recent = self._objectives[-_STALL_ITERATIONS:]
        self.seen = (
            not stop
            and len(recent) == _STALL_ITERATIONS
            and max(recent) - min(recent) < _STALL_PROGRESS * abs(objective)
            and infeasibility < _STALL_PROGRESS  # type: ignore[operator]
            and stationarity > _STALL_STATIONARITY  # type: ignore[operator]
        )
        return stop or self.seen


def _run(watch: Watch, x: np.ndarray, radius: float, terminate: _Stall) -> Any:  # noqa: ANN401 (unopy is untyped)
    """One call of Uno."""
    import unopy  # noqa: PLC0415  (a solver is imported when it is used)

    problem, options = watch.problem, watch.options
    model = unopy.Model(
        unopy.PROBLEM_NONLINEAR, len(x), problem.x_lower.tolist(), problem.x_upper.tolist(), unopy.ZERO_BASED_INDEXING
    )

    def objective_gradient(point: np.ndarray, out: np.ndarray) -> None:
        out[:] = watch.gradient(point)

    def rows(point: np.ndarray, out: np.ndarray) -> None:
        out[:] = watch.rows(point)

    def jacobian(point: np.ndarray, out: np.ndarray) -> None:
        out[:] = watch.jacobian(point)

    model.set_objective(unopy.MINIMIZE, watch.objective, objective_gradient)
    model.set_constraints(
        len(problem.lower),
        rows,
        problem.lower.tolist(),
        problem.upper.tolist(),
        len(problem.jacobian_rows),
        problem.jacobian_rows.tolist(),
        problem.jacobian_columns.tolist(),
        jacobian,
    )
    model.set_initial_primal_iterate(x.tolist())
    backend = unopy.UnoSolver()
    backend.set_preset("filtersqp")
    backend.set_logger_stream(io.StringIO())  # Uno would print to standard output
    settings = {
        "logger": "SILENT",
        "print_solution": False,
        "primal_tolerance": options.tolerance,
        "dual_tolerance": options.tolerance,
        "TR_radius": radius,
        "max_iterations": options.max_iterations,
        "time_limit": float(options.time_limit),
    }
    for key, value in settings.items():
        backend.set_option(key, value)
    backend.set_termination_callback(terminate)
    return backend.optimize(model)
