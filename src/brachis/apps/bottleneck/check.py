"""Predictions checked by solving again: the same problem with one limit after the other raised.

Knots, collocation points and branch margins stay; every solve begins at the answer and is held to a tighter tolerance.
An answer counts as an optimum where least squares find multipliers for it, whatever the solver says of itself. Where a
change is not as predicted, the unchanged problem is solved again from the new answer: a step into the valley of another
local optimum is not an effect of the limit.

The change of t_E for a limit that rises by a finite step, from the problem linearised at its answer.

Multipliers are derivatives: they hold for steps so small that the same rows stay active. The linear program

    minimise dt_E    over dx    subject to    lower <= rows(x) + J dx <= upper

with the raised limit lets other rows take over within the step. Its optimum is not lower than what the multipliers
promise, since they are feasible for its dual; it tells how much of the promise other limits take back.
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
    multipliers_of,
    rows_and_jacobian,
    sensitivities,
)
from brachis.common.summary import Summary
from brachis.errors import PlanningError, UnreachableError
from brachis.optimise.backends import SolverOptions, residual, solver_named
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.program import Program

_NEAR = 0.1
"""Rows farther from their bounds are left out at first; dimensionless."""
_LARGEST_STEP = 1.0
"""Of any variable: directions that change nothing to first order are not followed without end."""
STEP = 0.01
"""Fraction by which limits are raised, unless asked otherwise."""
_OPTIONS = SolverOptions(tolerance=1e-8)
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
            "end": entry.bound.side,
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
        """Largest deviation among `larger` changes that were solved to an optimum; 0 if there are none."""
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
    refined: SolvedProgram,
    predictions: Sensitivities | None = None,
    *,
    step: float = STEP,
) -> SensitivityCheck:
    """Solve the refined program again with every limit raised, and compare with what the multipliers predict.

    Parameters
    ----------
    refined : SolvedProgram
        ``result.candidate.refined``.
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
        return _check_limits(refined, predictions or sensitivities(refined), step)


def _check_limits(
    refined: SolvedProgram, predictions: Sensitivities, step: float
) -> SensitivityCheck:
    """Compare limit by limit."""
    began = time.perf_counter()
    program = refined.program
    base = refined.reports[-1].x
    t_end = program.end_time
    if residual(program, base) > _EXACT or _stationarity(program, base) > _EXACT:
        base, _ = _solve_again(program, base)
    checked = []
    for entry in predictions.limits:
        if abs(entry.change(step)) <= _NO_CHANGE * t_end(base):
            checked.append(CheckedSensitivity(entry, 0.0, 0.0, 0.0, 0.0, optimal=True))
        else:
            raised = program.relax(
                entry.limit, entry.bound, step * entry.bound.full_scale
            )
            checked.append(_compare(entry, entry.change(step), program, raised, base))
    return SensitivityCheck(
        step, t_end(base), tuple(checked), time.perf_counter() - began
    )


def _compare(
    entry: Sensitivity,
    predicted: float,
    program: Program,
    raised: Program,
    base: np.ndarray,
) -> CheckedSensitivity:
    """Solve with one limit raised, and back where the change is suspicious."""
    linearised = linearised_change(raised, base)
    answer, optimal = _solve_again(raised, base)
    t_end = program.end_time
    before = base
    off = abs(predicted - (t_end(answer) - t_end(base)))
    if off > _SUSPICIOUS * abs(predicted) and off > _SAME * t_end(base):
        before, sure = _solve_again(program, answer)
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


def linearised_change(program: Program, x: np.ndarray) -> float | None:
    """Predict the change of t_E from the answer to a problem with less strict limits.

    Parameters
    ----------
    program : Program
        With the raised limit.
    x : (v,) ndarray
        Answer to the problem before.

    Returns
    -------
    float or None
        s; None where the linear program has no answer.

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    from scipy import sparse

    rows, jacobian = rows_and_jacobian(program, x)
    below = np.isfinite(program.lower)
    above = np.isfinite(program.upper)
    slopes = sparse.vstack(
        [-jacobian[np.flatnonzero(below)], jacobian[np.flatnonzero(above)]],
        format="csr",
    )
    room = np.concatenate(
        [(rows - program.lower)[below], (program.upper - rows)[above]]
    )
    lowest = np.clip(program.x_lower - x, -_LARGEST_STEP, 0.0)
    highest = np.clip(program.x_upper - x, 0.0, _LARGEST_STEP)
    kept = room < _NEAR
    gradient = program.gradient(x)
    while True:
        step = _solve_linear_program(
            gradient,
            slopes[np.flatnonzero(kept)].toarray(),
            room[kept],
            lowest,
            highest,
        )
        if step is None:
            return None
        overrun = slopes @ step > room + 1e-9
        if not (overrun & ~kept).any():
            return float(gradient @ step)
        kept |= overrun


def _solve_linear_program(
    gradient: np.ndarray,
    slopes: np.ndarray,
    room: np.ndarray,
    lowest: np.ndarray,
    highest: np.ndarray,
) -> np.ndarray | None:
    """Solve the linear program over some of the rows; None where it has no answer."""
    from scipy.optimize import linprog

    bounds = list(zip(lowest.tolist(), highest.tolist(), strict=True))
    found = linprog(gradient, A_ub=slopes, b_ub=room, bounds=bounds, method="highs")
    return np.asarray(found.x) if found.success else None


def _solve_again(program: Program, x: np.ndarray) -> tuple[np.ndarray, bool]:
    """Solve to a tight tolerance from x with one backend after the other; tell whether it is an optimum.

    Raises
    ------
    PlanningError
        No backend found a feasible point, and x is not feasible either.
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
        if _stationarity(program, report.x) <= 1e-5:
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


def _stationarity(program: Program, x: np.ndarray) -> float:
    try:
        return multipliers_of(program, x).residual
    except UnreachableError:
        return np.inf
