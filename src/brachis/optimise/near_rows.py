"""Solve a program with only the rows that are close to their bounds.

In a motion that is nearly as fast as possible, one or two limits are active at a time, and most others are far from
their bounds. A solver's effort grows with the number of rows. So the solver gets only the rows close to their bounds,
and all rows are checked at its solution. Violated rows are added, and the solver continues from there.

An interior-point method moves away from the bounds at first. It therefore needs whole values: if a value, such as a
joint's torque, comes close to a bound anywhere, all of its rows along the path are included. Any method needs whole
values where few rows are active.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from brachis.optimise.backends import (
    FEASIBLE,
    Curvature,
    NonlinearProgram,
    SolverReport,
    SolveStatus,
    residual,
)
from brachis.optimise.backends.monitor import row_slack

_NEAR = 0.2
"""Distance from its bound up to which a row counts as near, as a fraction of the limit."""
_AT_BOUND = 0.05
"""Distance from its bound up to which a row is taken to hold the motion back."""
_ROWS_A_VARIABLE = 2.0
"""Minimum number of rows per variable that hold the motion back. With fewer, as in a slower motion, the end time would
collapse."""
_ROWS_IF_CURVED = 1.0
"""The same number where part of the Hessian is known, because curvature keeps steps short."""
_LEAST_KEPT = 0.2
"""Fraction of the rows, the nearest ones, that is kept at any distance. With too few rows the end time collapses."""
_MOST_KEPT = 0.6
"""Fraction of the rows. If more than this are near, leaving out the others gains nothing."""
_FIRST_VIOLATION = 0.5
"""Largest violation with which a starting point still counts as a fast motion."""
_LAST_VIOLATION = 0.5
"""Violation of the left-out rows above which the solution is a different motion. Then all rows are needed."""
_NEAR_ANYWHERE = 0.3
"""A value counts as near if it comes this close to its bound anywhere. Of 13 solves over the path, all but one ended
with no other value violated, in 0.4 of the time. With 0.5, and with single rows near their bounds, they took 0.9 of the
time."""
_ROUNDS = 4
"""Maximum number of solves with more and more rows."""
_FINAL = (SolveStatus.TIME_LIMIT, SolveStatus.ITERATION_LIMIT)
"""Statuses after which no further solve is tried."""


class NearRows:
    """A program without some of its rows; a `NonlinearProgram`.

    Parameters
    ----------
    program : NonlinearProgram
    numbers : (c',) int ndarray
        Indices of the rows that are kept, ascending.
    """

    def __init__(self, program: NonlinearProgram, numbers: np.ndarray) -> None:
        self._program = program
        self._numbers = numbers
        is_near = np.zeros(len(program.lower), dtype=bool)
        is_near[numbers] = True
        self._entries = np.flatnonzero(is_near[program.jacobian_rows])
        self.x_lower = program.x_lower
        self.x_upper = program.x_upper
        self.lower = program.lower[numbers]
        self.upper = program.upper[numbers]
        self.jacobian_rows = np.searchsorted(
            numbers, program.jacobian_rows[self._entries]
        )
        self.jacobian_columns = program.jacobian_columns[self._entries]
        self.objective = program.objective
        self.gradient = program.gradient

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Return the values of the rows that are kept."""
        return self._program.rows(x)[self._numbers]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Return the entries of the Jacobian in the rows that are kept."""
        return self._program.jacobian(x)[self._entries]

    def curvature(self, x: np.ndarray) -> Curvature | None:
        """Return the known part of the program's Hessian, with zero multipliers for the rows that are left out."""
        curvature = self._program.curvature(x)
        if curvature is None:
            return None

        def find_hessian(
            x: np.ndarray, objective_multiplier: float, multipliers: np.ndarray
        ) -> np.ndarray:
            """Return the known part for the multipliers of the rows that are kept."""
            every = np.zeros_like(curvature.multipliers)
            every[self._numbers] = multipliers
            return curvature.hessian(x, objective_multiplier, every)

        return Curvature(find_hessian, curvature.multipliers[self._numbers])


class HasValues(NonlinearProgram, Protocol):
    """A problem whose rows are values of limits at places along the motion."""

    @property
    def value_numbers(self) -> np.ndarray:
        """Number of the value in each row, (c,), the same at all places."""


def solve_near_rows(
    program: HasValues,
    x: np.ndarray,
    solve: Callable[[NonlinearProgram, np.ndarray], SolverReport],
    *,
    is_answer: bool = False,
    kept_rows: Sequence[int] = (),
) -> SolverReport:
    """Solve a program from a point, with only the rows near their bounds where these are enough.

    Parameters
    ----------
    program : HasValues
    x : (v,) ndarray
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.
    is_answer : bool, optional
        Whether the point is the solution of a solve over different knots or points. If too few rows are near, only
        whole values are then left out.
    kept_rows : sequence of int, optional
        Numbers of rows that are kept at any distance from their bounds.

    Returns
    -------
    SolverReport
        Report for the program with all its rows.
    """
    slack = row_slack(program, x)
    if slack.min() < -_FIRST_VIOLATION:
        return solve(program, x)
    is_curved = program.curvature(x) is not None
    needed = _ROWS_IF_CURVED if is_curved else _ROWS_A_VARIABLE
    holding = np.count_nonzero(slack < _AT_BOUND)
    numbers = np.flatnonzero(slack <= max(_NEAR, np.quantile(slack, _LEAST_KEPT)))
    if holding < needed * len(x) or len(numbers) > _MOST_KEPT * len(slack):
        report = solve_near_values(program, x, solve) if is_answer else None
        if report and report.status.usable and report.violation <= FEASIBLE:
            return report
        return solve(program, x)
    numbers = np.union1d(numbers, np.asarray(kept_rows, dtype=int))
    reports: list[SolverReport] = []
    for _ in range(_ROUNDS):
        report = solve(NearRows(program, numbers), x)
        reports.append(report)
        slack = row_slack(program, report.x)
        missing = np.setdiff1d(np.flatnonzero(slack < -FEASIBLE), numbers)
        # With all rows the solve would run out of time or iterations too.
        is_over = report.status in _FINAL
        if is_over or (report.status.usable and not len(missing)):
            return _complete(program, numbers, reports)
        if not report.status.usable or slack.min() < -_LAST_VIOLATION:
            break
        numbers = np.union1d(numbers, np.flatnonzero(slack < _NEAR))
        x = report.x
    return _complete(program, np.arange(len(slack)), [*reports, solve(program, x)])


def solve_near_values(
    program: HasValues,
    x: np.ndarray,
    solve: Callable[[NonlinearProgram, np.ndarray], SolverReport],
) -> SolverReport:
    """Solve a program from a point, with only the values that come close to their bounds anywhere.

    Parameters
    ----------
    program : HasValues
        Its ``value_numbers``, (c,), give the value to which each row belongs.
    x : (v,) ndarray
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.

    Returns
    -------
    SolverReport
        Report for the program with all its rows. After the last round some rows may be violated.
    """
    values = program.value_numbers
    is_near = np.zeros(1 + values.max(), dtype=bool)
    is_near[values[row_slack(program, x) <= _NEAR_ANYWHERE]] = True
    reports: list[SolverReport] = []
    for _ in range(_ROUNDS):
        numbers = np.flatnonzero(is_near[values])
        report = solve(NearRows(program, numbers), x)
        reports.append(report)
        x = report.x
        slack = row_slack(program, x)
        is_missing = (slack < -FEASIBLE) & ~is_near[values]
        if not report.status.usable or not is_missing.any():
            break
        is_near[values[slack <= _NEAR_ANYWHERE]] = True
    return _complete(program, numbers, reports)


def _complete(
    program: NonlinearProgram, numbers: np.ndarray, reports: Sequence[SolverReport]
) -> SolverReport:
    """Combine the reports of several solves; the last solve had the rows with these numbers."""
    last = reports[-1]
    multipliers = np.zeros(len(program.lower))
    multipliers[numbers] = last.multipliers
    return replace(
        last,
        violation=residual(program, last.x),
        multipliers=multipliers,
        iterations=sum(report.iterations for report in reports),
        wall_time=sum(report.wall_time for report in reports),
    )
