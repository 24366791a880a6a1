"""Predictions checked by solving again: the same problem with one limit after the other raised.

Knots, collocation points and branch margins stay; every solve begins at the answer and is held to a tighter tolerance.
An answer counts as an optimum where least squares find multipliers for it, whatever the solver says of itself. Where a
change is not as predicted, the unchanged problem is solved again from the new answer: a step into the valley of another
local optimum is no change that the limit makes.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from brachis.apps.bottleneck.sensitivities import (
    Sensitivities,
    Sensitivity,
    linearised_change,
    multipliers_of,
    sensitivities,
)
from brachis.common.summary import Summary
from brachis.errors import PlanningError, UnreachableError
from brachis.optimise.backends import SolverOptions, residual, solver_named
from brachis.optimise.program import Program
from brachis.optimise.refine import Refined

STEP = 0.01
"""Fraction by which limits are raised, unless asked otherwise."""
_OPTIONS = SolverOptions(tolerance=1e-8)
_OPTIMAL = 1e-5
_FEASIBLE = 1e-7
_EXACT = 1e-9
"""An answer that violates no row and leaves no gradient beyond this is not solved again."""
_SUSPICIOUS = 0.02
"""A change that is off by a larger fraction may be one to another local optimum, which solving back tells."""
_SAME = 1e-6
"""End times that differ by a smaller fraction are those of one optimum."""
_NO_CHANGE = 1e-9
"""A limit that is predicted to change t_E by a smaller fraction of it does not press: the answer stays an optimum."""


@dataclass(frozen=True)
class CheckedSensitivity:
    """A prediction beside the change that solving again gives.

    Attributes
    ----------
    sensitivity : Sensitivity
    predicted : float
        Change of t_E that the multipliers promise, s.
    linearised : float
        Change by `linearised_change`, which lets other limits take over within the step, s.
    re_solved : float
        Change found by solving again, s.
    other_optimum : float
        Where the solve again came to another local optimum: how much longer the unchanged problem takes there, s.
        `re_solved` is then the change from there. 0 otherwise.
    optimal : bool
        False where the solve again ended without an optimum, so that `re_solved` says little.
    """

    sensitivity: Sensitivity
    predicted: float
    linearised: float
    re_solved: float
    other_optimum: float
    optimal: bool

    @property
    def deviation(self) -> float:
        """How far the multipliers' promise is off, as a fraction of the re-solved change; 0 where neither changes."""
        return _deviation(self.predicted, self.re_solved)

    @property
    def linearised_deviation(self) -> float:
        """As `deviation`, of `linearised`."""
        return _deviation(self.linearised, self.re_solved)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        entry = self.sensitivity
        return {
            "subject": entry.label.subject,
            "kind": entry.label.kind,
            "end": entry.bound.end,
            "predicted_s": self.predicted,
            "linearised_s": self.linearised,
            "re_solved_s": self.re_solved,
            "other_optimum_s": self.other_optimum,
            "difference_s": self.predicted - self.re_solved,
            "deviation": self.deviation,
            "linearised_deviation": self.linearised_deviation,
            "optimal": self.optimal,
        }


def _deviation(predicted: float, found: float) -> float:
    if found == predicted:
        return 0.0
    return abs(predicted - found) / abs(found) if found else np.inf


@dataclass(frozen=True, repr=False)
class SensitivityCheck(Summary):
    """All predictions beside the changes that solving again gives.

    Attributes
    ----------
    step : float
        Fraction by which every limit left more room.
    t_end : float
        Of the unchanged problem at the tighter tolerance, s.
    entries : tuple of CheckedSensitivity
        In the order of the sensitivities.
    wall_time : float
        s.
    """

    step: float
    t_end: float
    entries: tuple[CheckedSensitivity, ...]
    wall_time: float

    def worst_deviation(self, above: float = 1e-4) -> float:
        """Largest deviation among `larger` changes that were solved to an optimum; 0 where there are none."""
        return max(
            (entry.deviation for entry in self.larger(above) if entry.optimal),
            default=0.0,
        )

    def larger(self, above: float = 1e-4) -> tuple[CheckedSensitivity, ...]:
        """Entries whose change, as predicted or as solved again, is larger than `above`, s."""
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
    refined: Refined, predictions: Sensitivities | None = None, *, step: float = STEP
) -> SensitivityCheck:
    """Solve the refined program again with every limit raised, and compare with what the multipliers predict.

    Parameters
    ----------
    refined : Refined
        ``result.attempt.refined``.
    predictions : Sensitivities, optional
        What is checked; by default what `sensitivities` says.
    step : float, optional
        Fraction by which each limit leaves more room; less where it is negative.

    Returns
    -------
    SensitivityCheck

    Raises
    ------
    PlanningError
        No solver could solve the unchanged problem again.
    """
    with ThreadpoolController().limit(
        limits=1, user_api="blas"
    ):  # as in `plan`: batches are small
        return _checked(refined, predictions or sensitivities(refined), step)


def _checked(
    refined: Refined, predictions: Sensitivities, step: float
) -> SensitivityCheck:
    """Compare limit by limit."""
    began = time.perf_counter()
    program = refined.program
    base, t_end = refined.reports[-1].x, program.end_time
    if residual(program, base) > _EXACT or _unbalanced(program, base) > _EXACT:
        base, _ = _solved_again(program, base)
    checked = []
    for entry in predictions.limits:
        if abs(entry.change(step)) <= _NO_CHANGE * t_end(base):
            checked.append(CheckedSensitivity(entry, 0.0, 0.0, 0.0, 0.0, optimal=True))
        else:
            raised = program.relaxed(entry.limit, entry.bound, step * entry.bound.whole)
            checked.append(_compared(entry, entry.change(step), program, raised, base))
    return SensitivityCheck(
        step, t_end(base), tuple(checked), time.perf_counter() - began
    )


def _compared(
    entry: Sensitivity,
    predicted: float,
    program: Program,
    raised: Program,
    base: np.ndarray,
) -> CheckedSensitivity:
    """Solve with one limit raised, and back where the change is suspicious."""
    linearised = linearised_change(raised, base)
    answer, optimal = _solved_again(raised, base)
    t_end = program.end_time
    before, off = base, abs(predicted - (t_end(answer) - t_end(base)))
    if off > _SUSPICIOUS * abs(predicted) and off > _SAME * t_end(base):
        before, sure = _solved_again(program, answer)
        optimal = optimal and sure
        if abs(t_end(before) - t_end(base)) <= _SAME * t_end(base):
            before = base
    return CheckedSensitivity(
        sensitivity=entry,
        predicted=predicted,
        linearised=predicted if linearised is None else linearised,
        re_solved=t_end(answer) - t_end(before),
        other_optimum=t_end(before) - t_end(base),
        optimal=optimal,
    )


def _solved_again(program: Program, x: np.ndarray) -> tuple[np.ndarray, bool]:
    """Solve to a tight tolerance from x with one backend after the other; tell whether it is an optimum.

    Raises
    ------
    PlanningError
        No backend found a feasible point, and x is none.
    """
    answers: list[np.ndarray] = []
    curved = any(limit.guarantee.is_mean for limit in program.limits)
    for solver in solver_named("auto", curved=curved):
        try:
            report = solver.solve(program, x, _OPTIONS, None)
        except ImportError:
            continue
        if report.violation > _FEASIBLE:
            continue
        if _unbalanced(program, report.x) <= _OPTIMAL:
            return report.x, True
        answers.append(report.x)
    if residual(program, x) <= _FEASIBLE:
        answers.append(x)
    if not answers:
        raise PlanningError(
            "the answer could not be solved again",
            hint="Plan with a smaller solver.tolerance.",
        )
    return min(answers, key=program.end_time), False


def _unbalanced(program: Program, x: np.ndarray) -> float:
    try:
        return multipliers_of(program, x).residual
    except UnreachableError:
        return np.inf
