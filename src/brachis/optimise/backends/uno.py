"""Uno (Vanaret and Leyffer), the default solver: an active-set SQP method with a filter and a trust region.

Bang-bang optima are vertices of the feasible set. An active-set method reaches vertices in a few steps. The Hessian is
Uno's limited-memory approximation, or that of `secant` if part of the Hessian is known. Uno's BQPD solves subproblems.
https://github.com/cvanaret/Uno
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from brachis.optimise.backends.monitor import Function, SolveMonitor, objective_at
from brachis.optimise.backends.protocol import (
    NonlinearProgram,
    SolverReport,
    SolveStatus,
)
from brachis.optimise.backends.secant import SecantHessian

NAME = "uno"

_RESTARTS = ((1.0, False), (1.0, True), (0.2, True))
"""Initial trust region radius and whether variables are scaled, for the first run and after each stall or breakdown.

With Uno's default radius of 10, solves stall on 1 of 8 random lines. If nothing fails, scaled variables are a tenth
slower.
"""
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
    "USER_TERMINATION": SolveStatus.ITERATION_LIMIT,
}


_FAR = 0.5
"""Violation of a limit, as a fraction of it, above which a restoration counts as far from feasible motions."""
_LOST_AFTER = 15
"""Number of iterations after which a restoration is abandoned if its violation has hardly decreased."""
_LOST = 0.9
"""A restoration is abandoned if more than this fraction of the violation is left after `_LOST_AFTER` iterations."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
"""Golden ratio: its multiples, modulo 1, are spread evenly."""


def run(monitor: SolveMonitor, x: np.ndarray) -> SolverReport:
    """Solve the monitor's program from `x`."""
    learnt = monitor.options.learnt
    with monitor:
        for radius, scaled in _RESTARTS:
            units = _units(monitor.program, x) if scaled else np.ones(len(x))
            stall = _Stall(monitor, units)
            hessian = SecantHessian.of(monitor.program, x, learnt)
            learnt = None  # this matrix may have caused the failure
            settings = {"TR_radius": radius * monitor.options.first_step}
            result = call_uno(monitor, x, units, settings, stall, hessian)
            x = units * np.array(result.primal_solution)
            ending = result.optimization_status.name
            solution = result.solution_status.name
            small = solution == "FEASIBLE_SMALL_STEP"
            has_failed = stall.seen or small or ending == "ALGORITHMIC_ERROR"
            if not has_failed or monitor.must_stop():
                break
    status = None
    if stall.seen:
        status = SolveStatus.STALLED
    elif stall.is_lost:
        status = SolveStatus.INFEASIBLE
    report = report_result(monitor, NAME, result, x, status)
    if hessian is None or not report.status.usable:
        return report
    return replace(report, learnt=hessian.learnt)


def report_result(
    monitor: SolveMonitor,
    name: str,
    result: Any,
    x: np.ndarray,
    status: SolveStatus | None = None,
) -> SolverReport:
    """Report Uno's result, with x, (v,), as the solution. If `status` is given, it replaces Uno's own status."""
    ending = result.optimization_status.name
    solution = result.solution_status.name
    if ending == "USER_INTERRUPTION":  # Uno has a SIGINT handler of its own
        monitor.failure = KeyboardInterrupt()
    status = status or _STOPPED.get(ending) or _STATUS.get(solution, SolveStatus.FAILED)
    message = f"{ending.lower()}, {solution.lower()}"
    multipliers = np.array(result.constraint_dual_solution)
    return monitor.report(name, status, x, multipliers, message)


@cache
def _solve_first_program() -> None:
    """Minimise x^2, once in each process.

    Rounding errors in Uno depend on the first program that a process solves. Without this program, results would depend
    on earlier plans.
    """
    import unopy

    def write_slope(point: np.ndarray, out: np.ndarray) -> None:
        out[:] = 2.0 * np.array(point)

    model = unopy.Model(
        unopy.PROBLEM_NONLINEAR, 1, [-1.0], [1.0], unopy.ZERO_BASED_INDEXING
    )
    model.set_objective(unopy.MINIMIZE, lambda point: float(point[0] ** 2), write_slope)
    model.set_initial_primal_iterate([0.5])
    _backend({}).optimize(model)


def _backend(settings: dict[str, Any]) -> Any:
    """Return Uno's solver with the given settings and without output."""
    import unopy

    backend = unopy.UnoSolver()
    backend.set_preset(settings.pop("preset", "filtersqp"))
    backend.set_logger_stream(io.StringIO())  # Uno would print to standard output
    silent = {"logger": "SILENT", "print_solution": False}
    for key, value in (silent | settings).items():
        backend.set_option(key, value)
    return backend


def _units(program: NonlinearProgram, x: np.ndarray) -> np.ndarray:
    """Return units of the variables, (v,). In them the largest slopes of rows at x become their square roots.

    Uno's subproblem solver breaks down if slopes differ by four orders of magnitude, as with 100 intervals in a short
    time.
    """
    slopes = np.ones(len(x))
    np.maximum.at(slopes, program.jacobian_columns, np.abs(program.jacobian(x)))
    return 1.0 / np.sqrt(slopes)


class _Stall:
    """Uno's termination callback, which also stops solves that creep.

    Occasionally the first steps spoil the Hessian approximation. Steps then stay tiny for hundreds of iterations, far
    from stationarity. In other cases a subproblem fails, and Uno stays forever in restoration at a feasible point,
    where its stationarity measure is meaningless. A new approximation, scaled variables and a smaller trust region
    solve both problems.

    If a restoration creeps while a limit is far exceeded, nothing helps: no motion close to the start is feasible.
    """

    def __init__(self, monitor: SolveMonitor, units: np.ndarray) -> None:
        self._monitor = monitor
        self._units = units
        self._objectives: list[float] = []
        self._restored: list[float] = []
        self.seen = False
        self.is_lost = False

    def __call__(self, point: np.ndarray, *state: Any) -> bool:
        *_, objective_multiplier, infeasibility, stationarity, _complementarity = state
        monitor = self._monitor
        restores = objective_multiplier == 0.0
        is_near = stationarity <= 0.1 and not restores
        # In a restoration Uno appends elastic variables.
        x = self._units * point[: len(self._units)]
        objective = objective_at(monitor.program, x)
        self._objectives.append(objective)
        if not restores:
            monitor.keep(x, objective, infeasibility)
        stop = monitor.between_iterations(objective)
        stop = stop or monitor.iterations >= monitor.options.max_iterations
        counts = is_near or (monitor.options.anywhere and not restores)
        is_done = monitor.has_settled(objective, infeasibility if counts else np.inf)
        stop = stop or is_done
        recent = self._objectives[-7:]
        creeps = len(recent) == 7 and max(recent) - min(recent) < 1e-3 * abs(objective)
        self.seen = creeps and infeasibility < 1e-3 and not is_near and not stop
        self._restored = [*self._restored, infeasibility] if restores else []
        if len(self._restored) > _LOST_AFTER:
            before = self._restored[-_LOST_AFTER]
            self.is_lost = infeasibility > max(_FAR, _LOST * before)
        return stop or self.seen or self.is_lost


def call_uno(
    monitor: SolveMonitor,
    x: np.ndarray,
    units: np.ndarray,
    settings: dict[str, Any],
    terminate: Callable[..., bool],
    hessian: SecantHessian | None = None,
) -> Any:
    """Call Uno, which is untyped, once from x, (v,). Uno's variables are x / `units`."""
    import unopy

    _solve_first_program()
    program = monitor.program
    options = monitor.options
    model = unopy.Model(
        unopy.PROBLEM_NONLINEAR,
        len(x),
        (program.x_lower / units).tolist(),
        (program.x_upper / units).tolist(),
        unopy.ZERO_BASED_INDEXING,
    )

    def scale(function: Function, factors: np.ndarray | float) -> Callable[..., None]:
        """Wrap a function so that its variables are scaled and its values multiplied by `factors`."""

        def write(point: np.ndarray, out: np.ndarray) -> None:
            out[:] = factors * function(units * point)

        return write

    model.set_objective(
        unopy.MINIMIZE,
        lambda point: monitor.objective(units * point),
        scale(monitor.gradient, units),
    )
    widening = min(options.widening, options.tolerance)
    lower, upper = _spread_bounds(program.lower, program.upper, widening)
    model.set_constraints(
        len(lower),
        scale(monitor.rows, 1.0),
        lower.tolist(),
        upper.tolist(),
        len(program.jacobian_rows),
        program.jacobian_rows.tolist(),
        program.jacobian_columns.tolist(),
        scale(monitor.jacobian, units[program.jacobian_columns]),
    )
    if hessian is not None:
        _set_hessian(model, partial(monitor.hessian, hessian), units)
    model.set_initial_primal_iterate((x / units).tolist())
    settings = {
        "primal_tolerance": options.tolerance,
        "dual_tolerance": options.tolerance,
        "max_iterations": options.max_iterations,
        "time_limit": float(options.time_limit),
        **settings,
    }
    backend = _backend(settings)
    backend.set_termination_callback(terminate)
    return backend.optimize(model)


def _spread_bounds(
    lower: np.ndarray, upper: np.ndarray, max_widening: float
) -> tuple[np.ndarray, np.ndarray]:
    """Widen bounds of rows, (c,), each by a different amount, up to a fraction `max_widening`.

    In the fastest motion, hundreds of neighbouring rows reach their bounds together. The subproblems are then
    degenerate, and take an active-set solver seconds instead of hundredths of a second. Simplex codes perturb bounds
    for the same reason.
    Bounds of zero do not change, because a condition on a sign is strict. Rows with equal bounds do not change either.
    Bounds above 1 are widened as if they were 1.
    """
    widening = max_widening * (np.arange(1, len(lower) + 1) * _GOLDEN % 1.0)
    widening[lower == upper] = 0.0
    wider = upper + widening * np.minimum(np.abs(upper), 1.0)
    return lower - widening * np.minimum(np.abs(lower), 1.0), wider


def _set_hessian(
    model: Any, hessian: Callable[..., np.ndarray], units: np.ndarray
) -> None:
    """Make Uno use a given Hessian in place of its own approximation."""
    import unopy

    rows, columns = np.tril_indices(len(units))
    factors = units[rows] * units[columns]

    def write(
        point: np.ndarray, multiplier: float, multipliers: np.ndarray, out: np.ndarray
    ) -> None:
        """Write the lower triangle of the Hessian with respect to the scaled variables."""
        matrix = hessian(units * point, multiplier, np.array(multipliers))
        out[:] = factors * matrix[rows, columns]

    entries = (rows.tolist(), columns.tolist())
    model.set_lagrangian_hessian(len(rows), unopy.LOWER_TRIANGLE, *entries, write)
