"""What holds a planned motion back, from the multipliers of its own optimum: no solve."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from brachis.explain.given_speeds import Lagrangian, speed_sensitivities
from brachis.explain.multipliers import multipliers_of
from brachis.explain.sensitivities import sensitivities_at, sensitivities_of_timing
from brachis.explain.stops import stop_savings
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.retiming import SOLVER
from brachis.problem.problem import Problem
from brachis.trajectory.sensitivities import Sensitivities, Sensitivity, TaskSaving

_BALANCED = 0.02
"""Part of the gradient that multipliers may leave unbalanced before the timings of the motion say more than they."""


def explain_motion(
    problem: Problem, motion: SolvedProgram, optimum: SolvedProgram
) -> Sensitivities:
    """Derive what limits, process speeds, dwells and stops cost.

    Parameters
    ----------
    problem : Problem
        Of which the programs are made.
    motion : SolvedProgram
        `FinishedCandidate.refined`.
    optimum : SolvedProgram
        `FinishedCandidate.optimum`: what limits cost is the same part of its end time as of the motion's.

    Returns
    -------
    Sensitivities
        From timings of the joint path if splines were laid along its timing, and no program over time balances the
        gradient.

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    savings = [*_list_dwells(problem), *stop_savings(problem, motion)]
    savings.sort(key=lambda saving: -saving.saved)
    of_task = tuple(savings)
    program = optimum.program
    report = optimum.report
    is_timed = motion.report.solver == SOLVER
    if report.solver == SOLVER:
        return replace(sensitivities_of_timing(motion), task=of_task)
    multipliers = multipliers_of(program, report.x, report.multipliers)
    if is_timed and multipliers.residual > _BALANCED:
        return replace(sensitivities_of_timing(motion), task=of_task)
    costs = sensitivities_at(program, multipliers)
    lagrangian = Lagrangian(program, report.x, multipliers)
    speeds = speed_sensitivities(problem, lagrangian)
    time_ratio = motion.t_end / optimum.t_end
    scaled_costs = (
        replace(entry, derivative=time_ratio * entry.derivative)
        for entry in costs.limits
    )
    return replace(costs, limits=_merge_speed_costs(scaled_costs, speeds), task=of_task)


def _merge_speed_costs(
    limit_costs: Iterable[Sensitivity], speed_costs: Iterable[Sensitivity]
) -> tuple[Sensitivity, ...]:
    """Join what the limits in the leads of process speeds cost with what these speeds cost themselves."""
    joined = {(entry.label, entry.side): entry for entry in speed_costs}
    for entry in limit_costs:
        figure = entry.label, entry.side
        derivative = entry.derivative
        if figure in joined:
            derivative += joined[figure].derivative
        joined[figure] = replace(entry, derivative=derivative)
    return tuple(sorted(joined.values(), key=lambda entry: entry.change(1.0)))


def _list_dwells(problem: Problem) -> list[TaskSaving]:
    """List what the task's waits take."""
    return [
        TaskSaving(f"without the dwell at s = {leg.end:.4g}", leg.dwell)
        for leg in problem.legs
        if leg.dwell
    ]
