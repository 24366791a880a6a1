"""Refinement to truth: from limits at collocation points to limits everywhere.

After a solve the limits are evaluated on a grid many times denser. Where one is exceeded between collocation points,
points are added around the worst place of each stretch and the problem is solved again from where it stands, until the
worst ratio is within the tolerance. A last excess of the tolerance's own size is met by lengthening t_E by as little,
and by up to one per cent once the rounds, or the time, are used up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from brachis.deadline import NEVER, Deadline
from brachis.nlp import Transcription
from brachis.refine.excesses import dense_grid, merged, violations
from brachis.solvers import SolverReport

Solve = Callable[[Transcription, np.ndarray], SolverReport]
_LARGEST_STRETCH = 0.01
_GOAL = 0.5
"""Refinement aims at this part of the tolerance: the verification's grid is another one."""


@dataclass(frozen=True)
class RefinementOptions:
    """When refinement is content.

    Attributes
    ----------
    tolerance : float
        Largest excess over a limit, as a fraction of it.
    density : int
        Grid points per collocation point of the first solve.
    max_rounds : int
        Solves after the first one; with 0 the first answer is left as it is.
    deadline : Deadline
        No solve is begun after it.
    """

    tolerance: float = 1e-4
    density: int = 10
    max_rounds: int = 10
    deadline: Deadline = NEVER


@dataclass(frozen=True)
class Refined:
    """A solve and what refinement made of it.

    Attributes
    ----------
    problem : Transcription
        With all collocation points.
    reports : tuple of SolverReport
        Of every round, the first one included.
    x : (v,) ndarray
        The answer.
    excess : float
        Largest excess over a limit on the dense grid, as a fraction of it; infinite where out of reach.
    stretched : float
        Factor by which t_E was lengthened at the very end, 1 if not at all.
    """

    problem: Transcription
    reports: tuple[SolverReport, ...]
    x: np.ndarray
    excess: float
    stretched: float

    @property
    def converged(self) -> bool:
        """True where the first solve ended well, so that `x` is a motion and not a mere iterate."""
        return self.reports[0].status.usable


def refine(problem: Transcription, first: SolverReport, solve: Solve, options: RefinementOptions) -> Refined:
    """Add collocation points to a solved problem until the limits hold on the dense grid.

    Parameters
    ----------
    problem : Transcription
    first : SolverReport
        Of the problem's solve.
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.
    options : RefinementOptions

    Returns
    -------
    Refined
    """
    dense = problem.resampled(dense_grid(problem, options.density))
    goal = options.tolerance * _GOAL
    reports = [first]
    if not first.status.usable:
        return Refined(problem, (first,), first.x, np.inf, 1.0)
    for _ in range(options.max_rounds):
        answer = reports[-1].x
        excess, places = violations(dense, answer, goal)
        x, remaining = _stretched(dense, answer, excess, goal, options.tolerance)
        if remaining <= goal:
            return Refined(problem, tuple(reports), x, remaining, float(x[0] / answer[0]))
        tau = merged(problem, places)
        if len(tau) == len(problem.tau) or options.deadline.passed:
            break
        finer = problem.resampled(tau)
        report = solve(finer, answer)
        if not report.status.usable and not _still_good(report, reports[-1]):
            break
        problem = finer
        reports.append(report)
    answer = reports[-1].x
    excess, _ = violations(dense, answer, goal)
    x, remaining = _stretched(dense, answer, excess, goal, _LARGEST_STRETCH if options.max_rounds else 0.0)
    return Refined(problem, tuple(reports), x, remaining, float(x[0] / answer[0]))


def _still_good(report: SolverReport, before: SolverReport) -> bool:
    """Tell whether a solve that ended early left a feasible motion about as fast as the one before it."""
    return report.feasible and report.objective <= before.objective * (1.0 + _LARGEST_STRETCH)


def _stretched(
    dense: Transcription, x: np.ndarray, excess: float, goal: float, largest: float
) -> tuple[np.ndarray, float]:
    """Lengthen the time by a fraction of up to `largest` where that brings the excess to the goal.

    A longer time relieves torques that only accelerate by twice its own fraction, velocities by as much; those that
    gravity or friction add to by less. So this is tried, not trusted.
    """
    x, first = x.copy(), x[0]
    while goal < excess:
        t_end = x[0] * (1.0 + excess - 0.5 * goal)
        if not t_end <= first * (1.0 + largest):
            break
        x[0] = t_end
        before, (excess, _) = excess, violations(dense, x, goal)
        if excess > 0.99 * before:
            break
    return x, excess
