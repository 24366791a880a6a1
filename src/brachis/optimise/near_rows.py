"""Solve a program with only the rows that are close to their bounds.

In a motion that is nearly as fast as possible, one or two limits are active at a time. Most other limits are far from
their bounds. A solver's effort grows with the number of rows. So the solver gets only the rows close to their bounds.
All rows are checked at its solution. Violated rows are added, and the solver continues from this solution.

An interior-point method moves away from the bounds at first. It therefore needs whole values: if a value, such as a
joint's torque, comes close to a bound anywhere, all of its rows along the path are included. If few rows are active,
any method needs whole values.
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
"""Distance from a row's bound, as a fraction of the limit, up to which the row counts as near."""
_AT_BOUND = 0.05
"""Distance from a row's bound, as a fraction of the limit, up to which the row counts as holding the motion back."""
_ROWS_A_VARIABLE = 2.0
"""Minimum number of rows per variable that hold the motion back. With fewer, as in a slower motion, the end time would
collapse."""
_ROWS_IF_CURVED = 1.0
"""Minimum number of these rows if part of the Hessian is known. Fewer suffice, because curvature shortens steps."""
_LEAST_KEPT = 0.2
"""Fraction of rows, beginning with the nearest, that is always kept. With too few rows the end time collapses."""
_MOST_KEPT = 0.6
"""Largest fraction of near rows with which it is worthwhile to leave out the other rows."""
_FIRST_VIOLATION = 0.5
"""Largest violation with which a starting point counts as a fast motion."""
_LAST_VIOLATION = 0.5
"""Violation of omitted rows above which the solution counts as a different motion, so that all rows are needed."""
_NEAR_ANYWHERE = 0.3
"""A value counts as near if it comes this close to its bound anywhere, as a fraction of the limit. In 12 of 13 solves
over the path, no other value exceeded its bound at the end. The solves took 0.4 times as long as with all values, and
0.9 times as long with a fraction of 0.5, or if near rows were chosen one by one."""
_ROUNDS = 4
"""Maximum number of solves, each with more rows."""
_FINAL = (SolveStatus.TIME_LIMIT, SolveStatus.ITERATION_LIMIT)
"""Statuses after which no further solve is tried."""


class NearRows:
    """A program without some of its rows. It is a `NonlinearProgram` itself.

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
        """Return the entries of the Jacobian that belong to the rows that are kept."""
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
        """Number of the value to which each row belongs, (c,). It is the same at all places."""


def solve_near_rows(
    program: HasValues,
    x: np.ndarray,
    solve: Callable[[NonlinearProgram, np.ndarray], SolverReport],
    *,
    is_answer: bool = False,
    kept_rows: Sequence[int] = (),
) -> SolverReport:
    """Solve a program from a point, with only the rows near their bounds if these rows are enough.

    Parameters
    ----------
    program : HasValues
    x : (v,) ndarray
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.
    is_answer : bool, optional
        Whether the point is a solution over different knots or collocation points. If so, and if too few rows are near,
        whole values are left out instead of single rows.
    kept_rows : sequence of int, optional
        Indices of rows that are kept at any distance from their bounds.

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
        # With all rows, the solve would run out of time or iterations too.
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
        Program whose ``value_numbers``, (c,), give the value to which each row belongs.
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
    """Combine the reports of several solves. The rows of the last solve have the indices `numbers`."""
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
