"""Refinement to truth: from limits at collocation points to limits everywhere.

After a solve the limits are evaluated on a grid many times denser. Where one is violated between collocation points,
points are added around the worst place of each stretch and the problem is solved again from where it stands, until the
worst ratio is within the tolerance. A last violation of the tolerance's own size is met by lengthening t_E by as
little, and by up to one per cent once the rounds, or the time, are used up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from brachis.deadline import NEVER, Deadline
from brachis.nlp import Program
from brachis.refine.violations import dense_grid, merged, violations
from brachis.solvers import SolverReport
from brachis.summary import Summary

Solve = Callable[[Program, np.ndarray], SolverReport]
_LONGEST = 0.01
_GOAL = 0.5
"""Refinement aims at this part of the tolerance: the verification's grid is another one."""


@dataclass(frozen=True)
class RefinementOptions:
    """When refinement is content.

    Attributes
    ----------
    tolerance : float
        Largest violation of a limit, as a fraction of it.
    density : int
        Grid points per collocation point of the first solve.
    max_rounds : int
        Solves after the first one; with 0 the first answer is left as it is.
    deadline : Deadline
        No solve is begun after it.
    longest : float
        End time beyond which it is not lengthened, s.
    """

    tolerance: float = 1e-4
    density: int = 10
    max_rounds: int = 10
    deadline: Deadline = NEVER
    longest: float = np.inf


@dataclass(frozen=True, repr=False)
class Refined(Summary):
    """A solve and what refinement made of it.

    Attributes
    ----------
    program : Program
        With all collocation points.
    reports : tuple of SolverReport
        Of every round, the first one included.
    x : (v,) ndarray
        The answer.
    violation : float
        Largest violation of a limit on the dense grid, as a fraction of it; infinite where out of reach.
    time_scaled : float
        Factor by which t_E was lengthened at the very end, 1 if not at all.
    """

    program: Program
    reports: tuple[SolverReport, ...]
    x: np.ndarray
    violation: float
    time_scaled: float

    @property
    def t_end(self) -> float:
        """End time of the answer, s."""
        return self.program.end_time(self.x)

    @property
    def converged(self) -> bool:
        """True where the first solve ended well, so that `x` is a motion and not a mere iterate."""
        return self.reports[0].status.usable


def refine(program: Program, first: SolverReport, solve: Solve, options: RefinementOptions) -> Refined:
    """Add collocation points to a solved program until the limits hold on the dense grid.

    Parameters
    ----------
    program : Program
    first : SolverReport
        Of the program's solve.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    options : RefinementOptions

    Returns
    -------
    Refined
    """
    dense = program.resampled([dense_grid(phase, options.density) for phase in program.phases])
    goal = options.tolerance * _GOAL
    reports = [first]
    if not first.status.usable:
        return Refined(program, (first,), first.x, np.inf, 1.0)
    for _ in range(options.max_rounds):
        answer = reports[-1].x
        violation, places = violations(dense, answer, goal)
        longest = min(program.end_time(answer) * (1.0 + options.tolerance), options.longest)
        x, remaining = _time_scaled(dense, answer, violation, goal, longest)
        if remaining <= goal:
            return Refined(program, tuple(reports), x, remaining, program.end_time(x) / program.end_time(answer))
        extended = [merged(phase, extra) for phase, extra in zip(program.phases, places, strict=True)]
        finer = program.resampled(extended)
        if finer.collocation_points == program.collocation_points or options.deadline.passed:
            break
        report = solve(finer, answer)
        if not report.status.usable and not _still_good(report, reports[-1]):
            break
        program = finer
        reports.append(report)
    answer = reports[-1].x
    violation, _ = violations(dense, answer, goal)
    longest = min(program.end_time(answer) * (1.0 + (_LONGEST if options.max_rounds else 0.0)), options.longest)
    x, remaining = _time_scaled(dense, answer, violation, goal, longest)
    return Refined(program, tuple(reports), x, remaining, program.end_time(x) / program.end_time(answer))


def _still_good(report: SolverReport, before: SolverReport) -> bool:
    """Tell whether a solve that ended early left a feasible motion about as fast as the one before it."""
    return report.feasible and report.objective <= before.objective * (1.0 + _LONGEST)


def _time_scaled(
    dense: Program, x: np.ndarray, violation: float, goal: float, longest: float
) -> tuple[np.ndarray, float]:
    """Lengthen the time to `longest`, s, at most where that brings the violation to the goal.

    A longer time relieves torques that only accelerate by twice its own fraction, velocities by as much; those that
    gravity or friction add to by less, and least speeds not at all. So this is tried, and the best is kept.
    """
    best = x, violation
    while goal < violation:
        factor = 1.0 + violation - 0.5 * goal
        if not dense.end_time(x) * factor <= longest:
            break
        x = dense.time_scaled(x, factor)
        before, (violation, _) = violation, violations(dense, x, goal)
        best = min(best, (x, violation), key=lambda pair: pair[1])
        if violation > 0.99 * before:
            break
    return best
