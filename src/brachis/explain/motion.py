"""What limits a planned motion, found from the multipliers of its own optimum without a further solve."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from brachis.explain.multipliers import LOOSE, NEAR, Multipliers, multipliers_of
from brachis.explain.placement import placement_gradients
from brachis.explain.savings import task_savings
from brachis.explain.sensitivities import sensitivities_at, sensitivities_of_timing
from brachis.explain.task_figures import (
    STEP_OF_TIMING,
    Lagrangian,
    LeastTime,
    OptimalMotion,
    figure_sensitivities,
)
from brachis.limits.tool import PROCESS_SPEED
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.retiming import SOLVER
from brachis.problem.problem import Problem
from brachis.trajectory.sensitivities import Gradient, Sensitivities, Sensitivity

_BALANCED = 0.02
"""Maximum fraction of the gradient that multipliers may leave unbalanced. If they leave more, timings of the motion are
more accurate."""


def explain_motion(
    problem: Problem, motion: SolvedProgram, optimum: SolvedProgram
) -> Sensitivities:
    """Derive the time that limits and figures of the task cost, and the time that different demands would save.

    Parameters
    ----------
    problem : Problem
        Problem from which the programs were made.
    motion : SolvedProgram
        `FinishedCandidate.refined`.
    optimum : SolvedProgram
        `FinishedCandidate.optimum`. A limit is assumed to cost the same fraction of this program's end time as of the
        motion's end time.

    Returns
    -------
    Sensitivities
        The sensitivities come from timings of the joint path if splines were laid along its timing and no program over
        time balances the gradient.

    Raises
    ------
    UnreachableError
        A collocation point is outside the branch.
    """
    program = optimum.program
    x = optimum.report.x
    multipliers = _find_multipliers(motion, optimum)
    time_ratio = motion.t_end / optimum.t_end
    if multipliers is None:
        costs = sensitivities_of_timing(motion)
        timed = (motion.program, motion.x, LeastTime(motion.program))
        answer = OptimalMotion(problem, *timed, step=STEP_OF_TIMING)
        time_ratio = 1.0
    else:
        costs = sensitivities_at(program, multipliers)
        lagrangian = Lagrangian(program, multipliers)
        answer = OptimalMotion(problem, program, x, lagrangian)
    figures = (*figure_sensitivities(answer), *costs.limits)
    limits = _merge_figures(figures, time_ratio)
    savings = () if problem.is_chain else task_savings(problem, motion, answer)
    if multipliers is None:
        multipliers = _find_multipliers(motion, optimum, LOOSE)
        if multipliers is not None:
            lagrangian = Lagrangian(program, multipliers)
            answer = OptimalMotion(problem, program, x, lagrangian)
            time_ratio = motion.t_end / optimum.t_end
    gradients = placement_gradients(answer, time_ratio)
    speeds = tuple(
        Gradient("tool", entry.label.kind, "m/s", entry.derivative)
        for entry in limits
        if entry.label.cause == PROCESS_SPEED
    )
    return replace(costs, limits=limits, task=savings, gradients=gradients + speeds)


def _find_multipliers(
    motion: SolvedProgram, optimum: SolvedProgram, distances: Sequence[float] = NEAR
) -> Multipliers | None:
    """Find the multipliers of the optimum; None if timings of the motion are more accurate."""
    report = optimum.report
    if report.solver == SOLVER:
        return None
    of_solver = report.multipliers
    multipliers = multipliers_of(optimum.program, report.x, of_solver, distances)
    is_timed = motion.report.solver == SOLVER
    return None if is_timed and multipliers.residual > _BALANCED else multipliers


def _merge_figures(
    costs: Iterable[Sensitivity], time_ratio: float
) -> tuple[Sensitivity, ...]:
    """Add up the costs of figures with the same name, multiplied by a ratio; some limits follow from process speeds."""
    joined: dict[tuple[str, str | None], Sensitivity] = {}
    for entry in costs:
        name = str(entry.label), entry.side
        before = joined.get(name, replace(entry, derivative=0.0))
        derivative = before.derivative + time_ratio * entry.derivative
        joined[name] = replace(before, derivative=derivative)
    return tuple(sorted(joined.values(), key=lambda entry: entry.change(1.0)))
