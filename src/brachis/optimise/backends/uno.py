"""Uno (Vanaret and Leyffer): an active-set SQP with a filter and a trust region, the default.

Bang-bang optima are vertices of the feasible set, which an active-set method reaches in a few steps. The Hessian is
Uno's limited-memory approximation, the subproblem solver its BQPD. https://github.com/cvanaret/Uno
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from brachis.optimise.backends.child_process import apart_if_large, one_at_a_time
from brachis.optimise.backends.monitor import Watch, from_finite_numbers, objective_at
from brachis.optimise.backends.protocol import (
    Problem,
    Progress,
    SolverOptions,
    SolverReport,
    SolveStatus,
)

name = "uno"

_RESTARTS = ((1.0, False), (1.0, True), (0.2, True))
"""First trust region radius, and whether the variables are scaled: at first, and after a stall or a breakdown.

Uno's own radius of 10 stalls on 1 of 8 random lines. Scaled variables are slower by a tenth where nothing fails.
"""
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
def solve(
    problem: Problem, x: np.ndarray, options: SolverOptions, progress: Progress | None
) -> SolverReport:
    """See `brachis.optimise.backends.protocol.Solver`."""
    with Watch(problem, options, progress) as watch:
        for radius, scaled in _RESTARTS:
            units = _units(problem, x) if scaled else np.ones(len(x))
            stall = _Stall(watch, units)
            result = _run(watch, x, units, radius, stall)
            x = units * np.array(result.primal_solution)
            ending = result.optimization_status.name
            found = result.solution_status.name
            if ending == "USER_INTERRUPTION":  # Uno has a SIGINT handler of its own
                watch.interrupt = KeyboardInterrupt()
            broken_down = (
                ending == "ALGORITHMIC_ERROR" or found == "FEASIBLE_SMALL_STEP"
            )
            if not (stall.seen or broken_down) or watch.must_stop():
                break
    status = _STOPPED.get(ending) or _STATUS.get(found, SolveStatus.FAILED)
    if stall.seen:
        status = SolveStatus.STALLED
    elif ending == "USER_TERMINATION":
        status = SolveStatus.ITERATION_LIMIT
    message = f"{ending.lower()}, {found.lower()}"
    return watch.report(
        name, status, x, np.array(result.constraint_dual_solution), message
    )


def _units(problem: Problem, x: np.ndarray) -> np.ndarray:
    """Units of the variables, (v,), in which the largest slopes of rows at x are the square roots of what they are.

    Uno's subproblem solver breaks down where slopes differ by four orders of magnitude: 100 intervals, a short time.
    """
    slopes = np.ones(len(x))
    np.maximum.at(slopes, problem.jacobian_columns, np.abs(problem.jacobian(x)))
    return np.asarray(1.0 / np.sqrt(slopes))


class _Stall:
    """Uno's termination callback, which also stops a solve that creeps.

    Now and then the first steps wreck the Hessian approximation: steps then stay tiny for hundreds of iterations, far
    from stationarity. Or a subproblem fails, and Uno restores at a feasible point for ever, where its stationarity says
    nothing. A new approximation, scaled variables and a smaller trust region cure it.
    """

    def __init__(self, watch: Watch, units: np.ndarray) -> None:
        self._watch = watch
        self._units = units
        self._objectives: list[float] = []
        self.seen = False

    def __call__(self, point: np.ndarray, *rest: object) -> bool:
        *_, objective_multiplier, infeasibility, stationarity, _complementarity = rest
        settled = stationarity <= _STALL_STATIONARITY and objective_multiplier != 0.0  # type: ignore[operator]
        problem = self._watch.problem
        # In restoration Uno appends elastic variables.
        objective = objective_at(problem, self._units * point[: len(self._units)])
        self._objectives.append(objective)
        stop = (
            self._watch.between_iterations(objective)
            or self._watch.iterations >= self._watch.options.max_iterations
        )
        counts = settled or (
            self._watch.options.anywhere and objective_multiplier != 0.0
        )
        missed = infeasibility if counts else np.inf
        is_done = self._watch.has_settled(objective, missed)  # type: ignore[arg-type]
        stop = is_done or stop
        recent = self._objectives[-_STALL_ITERATIONS:]
        self.seen = (
            not stop
            and len(recent) == _STALL_ITERATIONS
            and max(recent) - min(recent) < _STALL_PROGRESS * abs(objective)
            and infeasibility < _STALL_PROGRESS  # type: ignore[operator]
            and not settled
        )
        return stop or self.seen


def _run(
    watch: Watch, x: np.ndarray, units: np.ndarray, radius: float, terminate: _Stall
) -> Any:
    """One call of Uno, which is untyped; its variables are x in units."""
    import unopy

    problem = watch.problem
    options = watch.options
    bounds = (problem.x_lower / units).tolist(), (problem.x_upper / units).tolist()
    model = unopy.Model(
        unopy.PROBLEM_NONLINEAR, len(x), *bounds, unopy.ZERO_BASED_INDEXING
    )
    entry_units = units[problem.jacobian_columns]

    def objective(point: np.ndarray) -> float:
        return watch.objective(units * point)

    def objective_gradient(point: np.ndarray, out: np.ndarray) -> None:
        out[:] = units * watch.gradient(units * point)

    def rows(point: np.ndarray, out: np.ndarray) -> None:
        out[:] = watch.rows(units * point)

    def jacobian(point: np.ndarray, out: np.ndarray) -> None:
        out[:] = entry_units * watch.jacobian(units * point)

    model.set_objective(unopy.MINIMIZE, objective, objective_gradient)
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
    model.set_initial_primal_iterate((x / units).tolist())
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
