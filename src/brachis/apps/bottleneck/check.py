"""Check of the multipliers' predictions, by raising each limit in turn and solving the program again.

Knots, collocation points and branch margins do not change. Every solve begins at the original solution and uses a
tighter tolerance. A solution counts as an optimum if least squares find multipliers for it, whatever status the solver
reports. If the change of the end time is not as predicted, the unchanged problem is solved again from the new solution:
the step may have led to a different local optimum, which is not an effect of the limit.

Multipliers are derivatives. Within a finite step, other limits may become active; the saving is then smaller than
predicted.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.common.summary import Summary
from brachis.common.threads import use_one_thread
from brachis.errors import PlanningError, UnreachableError
from brachis.explain import (
    LimitBound,
    Sensitivities,
    Sensitivity,
    figures_of,
    multipliers_of,
)
from brachis.limits.tool import PROCESS_SPEED
from brachis.optimise.backends import SolverOptions, residual, solvers_for
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.program import Program

STEP = 0.01
"""Default fraction by which limits are raised."""
_FEASIBLE = 1e-7
"""Maximum violation of a row of the program at a solution, dimensionless."""


@dataclass(frozen=True)
class CheckedSensitivity:
    """A predicted change of the end time t_E, and the change found by solving again.

    Attributes
    ----------
    sensitivity : Sensitivity
    predicted : float
        Change of the end time that the multipliers predict, s.
    re_solved : float
        Change of the end time found by solving again, s.
    other_optimum : float
        0 unless the solve ended at a different local optimum. Then it is the end time of this optimum for the unchanged
        problem minus `t_end`, s, and `re_solved` is the change from this optimum.
    optimal : bool
        False if the solve ended without an optimum, so that `re_solved` is only approximate.
    """

    sensitivity: Sensitivity
    predicted: float
    re_solved: float
    other_optimum: float
    optimal: bool

    @property
    def deviation(self) -> float:
        """Error of the prediction, as a fraction of the re-solved change; 0 if both changes are 0."""
        if self.predicted == self.re_solved:
            return 0.0
        off = abs(self.predicted - self.re_solved)
        return off / abs(self.re_solved) if self.re_solved else np.inf

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        label = self.sensitivity.label
        return {
            "subject": label.subject,
            "kind": label.kind,
            "end": self.sensitivity.side,
            "predicted_s": self.predicted,
            "re_solved_s": self.re_solved,
            "other_optimum_s": self.other_optimum,
            "difference_s": self.predicted - self.re_solved,
            "deviation": self.deviation,
            "optimal": self.optimal,
        }


@dataclass(frozen=True, repr=False)
class SensitivityCheck(Summary):
    """All predictions, and the changes found by solving again.

    Attributes
    ----------
    step : float
        Fraction by which every limit was raised.
    t_end : float
        End time of the unchanged problem at the tighter tolerance, s.
    entries : tuple of CheckedSensitivity
        Results in the order of the sensitivities.
    wall_time : float
        Wall time of the check, s.
    """

    step: float
    t_end: float
    entries: tuple[CheckedSensitivity, ...]
    wall_time: float

    def worst_deviation(self, above: float = 1e-4) -> float:
        """Largest deviation among the `larger` changes that were solved to an optimum; 0 if there is none."""
        optimal = [entry for entry in self.larger(above) if entry.optimal]
        return max((entry.deviation for entry in optimal), default=0.0)

    def larger(self, above: float = 1e-4) -> tuple[CheckedSensitivity, ...]:
        """Entries whose change, predicted or re-solved, is larger than `above`, s."""
        return tuple(
            entry
            for entry in self.entries
            if max(abs(entry.predicted), abs(entry.re_solved)) > above
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "step": self.step,
            "t_end_s": self.t_end,
            "entries": [entry.to_dict() for entry in self.entries],
            "worst_deviation_of_changes_above_1e-4_s": self.worst_deviation(),
            "wall_time_s": self.wall_time,
        }


def check_sensitivities(
    refined: SolvedProgram,
    predictions: Sensitivities,
    *,
    step: float = STEP,
) -> SensitivityCheck:
    """Solve the refined program again with every limit raised, and compare with the multipliers' predictions.

    Parameters
    ----------
    refined : SolvedProgram
        Solved program to check, ``result.candidate.optimum``.
    predictions : Sensitivities
        Predictions to check: ``result.sensitivities``.
    step : float, optional
        Fraction by which each limit is relaxed; a negative fraction tightens it.

    Returns
    -------
    SensitivityCheck

    Raises
    ------
    PlanningError
        No solver could solve the unchanged problem again.
    """
    began = time.perf_counter()
    program = refined.program
    base = refined.report.x
    t_end = program.end_time
    checked = []
    with use_one_thread():
        if max(residual(program, base), _stationarity(program, base)) > 1e-9:
            base, _ = _solve_again(program, base)
        figures = figures_of(program)
        for entry in predictions.limits:
            bounds = figures.get((entry.label, entry.side))
            if bounds is None or entry.label.cause == PROCESS_SPEED:
                continue  # the speed determines s(t), so no row of the program represents this speed
            # If a limit changes nothing, the solution remains an optimum.
            if abs(entry.change(step)) <= 1e-9 * t_end(base):
                same = CheckedSensitivity(entry, 0.0, 0.0, 0.0, optimal=True)
                checked.append(same)
            else:
                checked.append(_check_limit(entry, step, program, base, bounds))
    wall_time = time.perf_counter() - began
    return SensitivityCheck(step, t_end(base), tuple(checked), wall_time)


def _check_limit(
    entry: Sensitivity,
    step: float,
    program: Program,
    base: np.ndarray,
    bounds: list[LimitBound],
) -> CheckedSensitivity:
    """Solve with one limit raised; if this may be another optimum, solve from there with the original limits too."""
    predicted = entry.change(step)
    raised = program
    for limit, bound in bounds:
        raised = raised.relax(limit, bound, step * entry.full_scale)
    answer, optimal = _solve_again(raised, base)
    t_end = program.end_time
    same = 1e-6 * t_end(base)  # end times of the same optimum differ by less
    before = base
    off = abs(predicted - (t_end(answer) - t_end(base)))
    if off > max(0.02 * abs(predicted), same):
        returned, is_optimum = _solve_again(program, answer)
        optimal = optimal and is_optimum
        if abs(t_end(returned) - t_end(base)) > same:
            before = returned
    return CheckedSensitivity(
        sensitivity=entry,
        predicted=predicted,
        re_solved=t_end(answer) - t_end(before),
        other_optimum=t_end(before) - t_end(base),
        optimal=optimal,
    )


def _solve_again(program: Program, x: np.ndarray) -> tuple[np.ndarray, bool]:
    """Solve the program to a tight tolerance from x, trying one backend after the other.

    Returns
    -------
    x : (v,) ndarray
    optimal : bool
        Whether x is an optimum.

    Raises
    ------
    PlanningError
        No backend found a feasible point, and the given x is not feasible either.
    """
    answers = []
    for solver in solvers_for("auto"):
        report = solver.solve(program, x, SolverOptions(tolerance=1e-8), None)
        if report.violation > _FEASIBLE:
            continue
        if _stationarity(program, report.x) <= 1e-5:
            return report.x, True
        answers.append(report.x)
    if residual(program, x) <= _FEASIBLE:
        answers.append(x)
    if not answers:
        raise PlanningError(
            "solving the planned motion again found no optimum",
            hint="Plan with a smaller solver.tolerance.",
        )
    return min(answers, key=program.end_time), False


def _stationarity(program: Program, x: np.ndarray) -> float:
    """Return the residual of the multipliers at x, (v,); infinite if the branch does not reach a collocation point."""
    try:
        return multipliers_of(program, x).residual
    except UnreachableError:
        return np.inf
