"""The solved problem that belongs to a saved motion, which has neither collocation points nor multipliers.

Task, URDF, redundant joints, branch, knots and control points are saved. The problem is laid down over these knots,
with the branch margin that the motion keeps, solved from the saved control points and refined as in a plan. That takes
a few iterations, since the start is an optimum already, and ends at the same one.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from threadpoolctl import ThreadpoolController

from brachis.bspline import spread
from brachis.deadline import Deadline
from brachis.errors import PlanningError, UnreachableError
from brachis.nlp import Motion, Transcription
from brachis.refine import Refined, RefinementOptions, refine
from brachis.robot import ROLL_JOINT
from brachis.search.solving import MARGINS, solve_with
from brachis.setting import Setting, choices, derivatives_at_rest
from brachis.solvers import solver_named
from brachis.trajectory import Trajectory

_SAME = 1e-3
"""End times that differ by a larger fraction are those of two motions."""
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
        problem, x = _problem(trajectory)
        found = list(_answers(problem, x, trajectory))
    for refined in found:
        if abs(refined.x[0] / trajectory.t_end - 1.0) <= _SAME:
            return refined
    ends = ", ".join(f"{refined.reports[-1].solver}: {refined.x[0]:.6g} s" for refined in found)
    raise PlanningError(
        "solving again does not come back to the saved motion, so that its multipliers are not known",
        found=ends or "no answer",
        allowed=f"{trajectory.t_end:.6g} s",
        hint="Ask for the bottlenecks of the task itself",
    )


def _problem(trajectory: Trajectory) -> tuple[Transcription, np.ndarray]:
    """Lay the problem down over the saved knots; the motion is its point x."""
    names = tuple(name for name in trajectory.redundant_joints if name != ROLL_JOINT)
    task = trajectory.task.model_copy(update={"redundant_joints": names, "branch": trajectory.branch})
    (choice,) = choices(Setting.of(trajectory.robot, task))
    decomposition = choice.decomposition(trajectory.q[0], choice.branches[0])
    knots, degree = trajectory.knots, trajectory.degree
    problem = Transcription(
        decomposition,
        choice.setting.limits,
        degree=degree,
        knots=knots,
        derivatives_at_rest=derivatives_at_rest(task),
        tau=spread(np.unique(knots), task.spline.points_per_interval),
        end=choice.setting.end,
        start_free=choice.setting.start is None,
    )
    x = problem.variables_from(Motion(trajectory.t_end, knots, degree, trajectory.control_points))
    for margin in MARGINS:
        problem = problem.with_margin(margin)
        if problem.guard_slack(x) >= -_KEPT:
            break
    return problem, x


def _answers(problem: Transcription, x: np.ndarray, trajectory: Trajectory) -> Iterator[Refined]:
    """Solve and refine with one backend after the other, until one comes back to the motion."""
    task = trajectory.task
    deadline, settings = Deadline.after(task.search.time_limit), task.refinement
    options = RefinementOptions(settings.tolerance, settings.density, settings.max_rounds, deadline)
    for backend in solver_named(task.solver.name):
        if deadline.passed:
            return
        solve = solve_with(backend, task.solver, problem.decomposition.r, deadline, lambda _text: None)
        try:
            refined = refine(problem, solve(problem, x), solve, options)
        except (ImportError, UnreachableError):
            continue
        if refined.converged:
            yield refined
            if abs(refined.x[0] / trajectory.t_end - 1.0) <= _SAME:
                return
