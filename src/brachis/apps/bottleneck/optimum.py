"""Re-planning a saved motion with itself as the first guess, for files without sensitivities and for checks.

The initial guess is already an optimum, so a single search from it is enough, and it ends at the same optimum.
"""

from __future__ import annotations

from collections.abc import Sequence

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener, ignore
from brachis.common.threads import use_one_thread
from brachis.errors import DecompositionError, PlanningError, UnknownNameError
from brachis.ik import Family
from brachis.problem.problem import Decompositions, Problem
from brachis.robot.custom_limits import LimitModel
from brachis.robot.task_map import JOINTS
from brachis.search.portfolio import Search
from brachis.search.stages import FinishedCandidate
from brachis.trajectory import Trajectory

_SAME = 1e-3
"""Relative difference below which two end times count as the same optimum."""


def plan_again(
    trajectory: Trajectory,
    listener: Listener = ignore,
    *,
    families: Sequence[Family] = (),
    own_limits: Sequence[LimitModel] = (),
) -> FinishedCandidate:
    """Plan a saved motion again, with its redundant joints and branch, starting from the motion itself.

    Parameters
    ----------
    trajectory : Trajectory
        A planned or loaded motion, without idle joints (`narrow_motion`).
    listener : callable, optional
        Function that is called with a text about every iteration.
    families, own_limits : sequence, optional
        The ones with which the motion was planned, as passed to `brachis.plan`. Families and limits are not saved with
        the motion.

    Returns
    -------
    FinishedCandidate

    Raises
    ------
    InputError
        The closed form or the branch is unknown; see `brachis.plan`.
    PlanningError
        The motion is not an optimum of its problem, so that the plan ended at a different motion; or the task's time
        limit was too short.
    """
    task = trajectory.task
    changes: dict[str, object] = {}
    if task.task_space != JOINTS and not len(trajectory.chart_rows):
        joints = trajectory.robot.urdf_joints
        names = tuple(name for name in trajectory.redundant_joints if name in joints)
        changes |= {"redundant_joints": names, "branch": trajectory.branch}
    task = task.model_copy(update=changes)
    problem = Problem.of(trajectory.robot, task, own_limits)
    deadline = Deadline.after(task.search.time_limit)
    try:
        planned = search_from(trajectory, problem, families, deadline, listener)
    except (DecompositionError, UnknownNameError) as error:
        raise DecompositionError(
            "the motion was planned with a closed form that is unknown here; pass it as "
            "brachis.bottleneck.report(motion, families=[...]), or install the package that provides it",
            redundant_joints=task.redundant_joints,
            found=f"{error}",
        ) from error
    slower = trajectory.t_end / planned.t_end - 1.0
    if -_SAME <= slower <= task.search.slower + _SAME:
        return planned
    hint = "Plan the task again, with a larger search.time_limit"
    if trajectory.own_limits and not own_limits:
        hint = (
            "Pass your own limits, which are not saved with the motion: "
            "brachis.bottleneck.report(motion, own_limits=[...])"
        )
    raise PlanningError(
        f"a {'faster' if slower > 0.0 else 'slower'} motion was found by planning this one "
        f"(t_E = {trajectory.t_end:.6g} s) again, so what its limits cost is unknown",
        found=f"t_E = {planned.t_end:.6g} s",
        hint=hint,
    )


def search_from(
    motion: Trajectory,
    problem: Problem,
    families: Sequence[Family],
    deadline: Deadline,
    listener: Listener,
) -> FinishedCandidate:
    """Search for the fastest motion of a problem, from a similar problem's; PlanningError if none is found."""
    search = Search(problem, Decompositions(problem, families), deadline, listener)
    with use_one_thread(), search.end_early():
        search.run(motion)
    return search.outcome().best
