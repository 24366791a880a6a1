"""The solved problem that belongs to a saved motion, which has neither collocation points nor multipliers.

Task, URDF, redundant joints and branch, or the chart, knots and control points are saved. The problem is laid down over
these knots, with the branch margin that the motion keeps, solved from the saved control points and refined as in a
plan. That takes a few iterations, since the start is an optimum already, and ends at the same one.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from threadpoolctl import ThreadpoolController

from brachis.deadline import Deadline
from brachis.errors import PlanningError, UnreachableError
from brachis.kinematics import ChartMap, ChartRows, JointMap, JointSpaceMap, chart_around
from brachis.nlp import Motion, Program
from brachis.problem import Problem, decompositions_of
from brachis.transcription import program_of
from brachis.refine import Refined, RefinementOptions, refine
from brachis.robot import ROLL_JOINT
from brachis.robot.task_map import JOINTS
from brachis.search.solving import MARGINS, solve_with
from brachis.solvers import solver_named
from brachis.trajectory import Trajectory

_SAME = 1e-3
"""End times that differ by a larger fraction, beyond what the task gave away, are those of two motions."""
_KEPT = 1e-4
"""A motion keeps a branch margin of which it falls short by less: solvers and interpolation are not exact."""


def solved_again(trajectory: Trajectory) -> Refined:
    """Solve the problem of a saved motion from where it ended.

    Parameters
    ----------
    trajectory : Trajectory
        As `brachis.plan` made it, or loaded.

    Returns
    -------
    Refined
        As ``result.attempt.refined`` of the plan.

    Raises
    ------
    InputError
        The closed form or the branch is not known here; see `brachis.plan`.
    PlanningError
        The motion is no optimum of its problem: no solver that the task allows came back to it.
    """
    with ThreadpoolController().limit(limits=1, user_api="blas"):  # as in `plan`: batches are small
        program, x = _problem(trajectory)
        found = list(_answers(program, x, trajectory))
    for refined in found:
        if _came_back(refined, trajectory):
            return refined
    ends = ", ".join(f"{refined.reports[-1].solver}: {refined.t_end:.6g} s" for refined in found)
    raise PlanningError(
        "solving again does not come back to the saved motion, so that its multipliers are not known",
        found=ends or "no answer",
        allowed=f"{trajectory.t_end:.6g} s",
        hint="Ask for the bottlenecks of the task itself",
    )


def _problem(trajectory: Trajectory) -> tuple[Program, np.ndarray]:
    """Lay the problem down over the saved knots; the motion is its point x."""
    joint_map: JointMap
    if len(trajectory.chart_rows):
        problem = Problem.of(trajectory.robot, trajectory.task)
        joint_map = _chart(problem, trajectory)
    elif trajectory.task.task_space == JOINTS:
        problem = Problem.of(trajectory.robot, trajectory.task)
        joint_map = JointSpaceMap(problem.robot, problem.path)
    else:
        names = tuple(name for name in trajectory.redundant_joints if name != ROLL_JOINT)
        task = trajectory.task.model_copy(update={"redundant_joints": names, "branch": trajectory.branch})
        (decomposition,) = decompositions_of(Problem.of(trajectory.robot, task))
        problem = decomposition.problem
        joint_map = decomposition.joint_map(trajectory.q[0], decomposition.branches[0])
    program = program_of(problem, joint_map, np.unique(trajectory.knots))
    motion = Motion(trajectory.t_end, trajectory.knots, trajectory.degree, trajectory.control_points)
    x = program.variables_from([motion])
    for margin in MARGINS:
        program = program.with_margin(margin)
        if program.safeguard_slack(x) >= -_KEPT:
            break
    return program, x


def _chart(problem: Problem, trajectory: Trajectory) -> ChartMap:
    """Lay the saved chart around the saved motion."""
    rows = ChartRows.of_arrays(trajectory.chart_rows, trajectory.chart_knots)
    s = trajectory.path_coordinate(trajectory.times)
    return chart_around(problem.task_map, problem.path, s, trajectory.q, rows)


def _came_back(refined: Refined, trajectory: Trajectory) -> bool:
    """Tell whether an answer is the fastest motion that a saved one was made from."""
    slower = trajectory.t_end / refined.t_end - 1.0
    return -_SAME <= slower <= trajectory.task.search.slower + _SAME


def _answers(program: Program, x: np.ndarray, trajectory: Trajectory) -> Iterator[Refined]:
    """Solve and refine with one backend after the other, until one comes back to the motion."""
    task = trajectory.task
    deadline, settings = Deadline.after(task.search.time_limit), task.refinement
    options = RefinementOptions(settings.tolerance, settings.density, settings.max_rounds, deadline)
    curved = any(limit.where == "whole" for limit in program.limits)
    for backend in solver_named(task.solver.name, curved=curved):
        if deadline.passed:
            return
        solve = solve_with(backend, task.solver, program.phases[0].joint_map, deadline, lambda _text: None)
        try:
            refined = refine(program, solve(program, x), solve, options)
        except (ImportError, UnreachableError):
            continue
        if refined.converged:
            yield refined
            if _came_back(refined, trajectory):
                return
