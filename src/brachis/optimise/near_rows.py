"""Solve a program with only the rows near their bounds.

From a motion that is nearly as fast as possible most limits stay far away: at a time one or two of them hold the motion
back. A solver's effort grows with all rows that it is given. So it is given those near their bounds, and all are
checked at its answer; those that are violated then are added, and it goes on from there.

An interior-point method leaves the bounds at first. It needs the rows of whole values, such as a joint's torque all
along the path, where these come near a bound anywhere. So does any method where few rows hold the motion.
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
"""Distance from its bound up to which a row is near, as a part of the limit."""
_AT_BOUND = 0.05
"""Distance from its bound up to which a row holds the motion, about."""
_ROWS_A_VARIABLE = 2.0
"""Rows that hold the motion, for every variable, no fewer: from a slower motion the end time would collapse."""
_ROWS_IF_CURVED = 1.0
"""The same where a part of the Hessian is known: curvature keeps steps short."""
_LEAST_KEPT = 0.2
"""Part of the rows, the nearest ones, that is kept whatever their distance: too few let the end time collapse."""
_MOST_KEPT = 0.6
"""Part of the rows: if more are near, leaving out the others gains nothing."""
_FIRST_VIOLATION = 0.5
"""Largest violation of a first point that counts as a fast motion."""
_LAST_VIOLATION = 0.5
"""Violation of other rows above which an answer is another motion: then all rows are needed."""
_NEAR_ANYWHERE = 0.3
"""Distance from its bound up to which a value is near, if it is anywhere: of 13 solves over the path all but one ended
with no other value violated, in 0.4 of the time; with 0.5, and with rows near their bounds, in 0.9 of it."""
_ROUNDS = 4
"""Solves with more and more rows, no more."""
_FINAL = (SolveStatus.TIME_LIMIT, SolveStatus.ITERATION_LIMIT)
"""Statuses after which no further solve is tried."""


class NearRows:
    """A program without some of its rows; a `NonlinearProgram`.

    Parameters
    ----------
    program : NonlinearProgram
    numbers : (c',) int ndarray
        Indices of the rows to keep, ascending.
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
        """Values of the rows that are left."""
        return self._program.rows(x)[self._numbers]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Entries of the Jacobian that are left."""
        return self._program.jacobian(x)[self._entries]

    def curvature(self, x: np.ndarray) -> Curvature | None:
        """Return what the program knows of its Hessian; multipliers of the rows that are left out are zero."""
        curvature = self._program.curvature(x)
        if curvature is None:
            return None

        def find_hessian(
            x: np.ndarray, objective_multiplier: float, multipliers: np.ndarray
        ) -> np.ndarray:
            """Return the known part by the multipliers of the rows that are left."""
            every = np.zeros_like(curvature.multipliers)
            every[self._numbers] = multipliers
            return curvature.hessian(x, objective_multiplier, every)

        return Curvature(find_hessian, curvature.multipliers[self._numbers])


class HasValues(NonlinearProgram, Protocol):
    """A problem whose rows are values of limits at places."""

    @property
    def value_numbers(self) -> np.ndarray:
        """Number of the value that each row holds at a place, (c,)."""


def solve_near_rows(
    program: HasValues,
    x: np.ndarray,
    solve: Callable[[NonlinearProgram, np.ndarray], SolverReport],
    *,
    is_answer: bool = False,
    kept_rows: Sequence[int] = (),
) -> SolverReport:
    """Solve a program from a point, with the rows near their bounds where that is enough.

    Parameters
    ----------
    program : HasValues
    x : (v,) ndarray
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.
    is_answer : bool, optional
        Whether the point is the answer of a solve over other knots or points. If too few rows are near, whole values
        are then left out.
    kept_rows : sequence of int, optional
        Numbers of rows that are kept whatever their distance.

    Returns
    -------
    SolverReport
        Of the program with all its rows.
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
        # With all rows the solve would use up time and iterations too.
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
    """Solve a program from a point, with the values that come near their bounds anywhere.

    Parameters
    ----------
    program : HasValues
        Its ``value_numbers``, (c,), tell of which value each row is.
    x : (v,) ndarray
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.

    Returns
    -------
    SolverReport
        Of the program with all its rows; some may be violated after many rounds.
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
    """Combine the reports; the last solve had the rows with these numbers."""
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
