"""Why no motion was found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from brachis import ik
from brachis.attempt import Attempt
from brachis.deadline import Deadline
from brachis.errors import BrachisError, PathError, PlanningError, Remedy
from brachis.problem import Decomposition, Problem
from brachis.search.joint_path import ALL_POSTURES, DeadEnd
from brachis.search.reach import reason_out_of_reach
from brachis.task import SolverSettings, Task

_GOOD_PART = 0.1
_LOOKED_AT = 2
_MOST_EFFORT = "exhaustive"
_SLOWER = 0.7
"""Part of a speed at an end that is tried first."""


def refuse_what_is_out_of_reach(
    decompositions: Sequence[Decomposition], candidates: Sequence[Attempt], deadline: Deadline
) -> None:
    """Raise the reason where the path is out of reach, so that further attempts would be in vain.

    Where no lattice has a joint path, any part of it counts; where no lattice was looked at, a good part.

    Parameters
    ----------
    decompositions : sequence of Decomposition
    candidates : sequence of Attempt
        So far.
    deadline : Deadline
        Nothing is refused for a reason that is not found by then.

    Raises
    ------
    PathError
    """
    if not decompositions or _some_joint_path(candidates):
        return
    reasons = [_reason(decomposition, deadline) for decomposition in decompositions[:_LOOKED_AT]]
    clear = [
        (reason.s_interval, reason)
        for reason in reasons
        if isinstance(reason, PathError) and reason.s_interval is not None
    ]
    if len(clear) < len(reasons):
        return
    if _lattices(candidates) or all(end - begin > _GOOD_PART for (begin, end), _ in clear):
        raise max(clear, key=lambda item: item[0][0])[1]


def no_motion(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    candidates: Sequence[Attempt],
    dead_ends: Mapping[str, DeadEnd],
    deadline: Deadline,
) -> BrachisError:
    """Return the error that says why no motion was found.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
    candidates : sequence of Attempt
    dead_ends : mapping of str to DeadEnd
        Where the lattices end, by the names of the redundant joints.
    deadline : Deadline
        When the search for the reason ends.

    Returns
    -------
    PathError or PlanningError
    """
    joint_path = _some_joint_path(candidates)
    search = bool(decompositions) and not joint_path
    reason = _reason(decompositions[0], deadline) if search else _advice(problem.task, candidates)
    if isinstance(reason, BrachisError):
        return reason
    if dead_ends and not joint_path:
        name, furthest = min(dead_ends.items(), key=lambda item: np.diff(item[1].interval)[0])
        own = name if name == ALL_POSTURES else f"redundant joints {name}"
        others = f" ({own}; the furthest of {len(dead_ends)} lattices)" if len(dead_ends) > 1 else ""
        start = "" if problem.start is None else "start in another posture, "
        return PathError(
            f"no joint path was found: {furthest}{others}",
            s_interval=furthest.interval,
            hint=f"{start}shorten or move the path, or widen the joint ranges".capitalize() + _what_is_missing(problem),
        )
    counts = Counter(candidate.status for candidate in candidates)
    outcomes = "; ".join(status if n == 1 else f"{status} ({n} times)" for status, n in counts.items())
    along = " along any joint path" if joint_path else ""
    error = PlanningError(
        f"no motion within the limits was found{along}: {outcomes or 'no initial guess'}",
        hint=reason + _what_is_missing(problem),
    )
    ends = {f"boundary.{key}": getattr(problem.task.boundary, key) for key in ("start_speed", "end_speed")}
    remedies = [Remedy(key, speed, _SLOWER * speed, problem.task.speed_unit) for key, speed in ends.items() if speed]
    return error.with_remedies(*remedies)


def out_of_time(task: Task, undone: Sequence[str]) -> PlanningError:
    """Return the error that says that the time was up, and what was left undone."""
    problem = f"no motion was found within the time limit of {task.search.time_limit:g} s: {'; '.join(undone)}"
    return PlanningError(problem, hint="Raise search.time_limit")


def _advice(task: Task, candidates: Sequence[Attempt]) -> str:
    """Say what may help where there are joint paths, but no motion along them: only what has not been tried."""
    statuses = " ".join(candidate.status for candidate in candidates)
    few = SolverSettings.model_fields
    tried = []
    if "iteration limit" in statuses and task.solver.max_iterations < few["max_iterations"].default:
        tried.append(f"raise solver.max_iterations, which is {task.solver.max_iterations}")
    if "time limit" in statuses:
        name = "solver" if task.solver.time_limit < few["time_limit"].default else "search"
        tried.append(f"raise {name}.time_limit, which is {getattr(task, name).time_limit:g} s")
    if not tried and task.search.effort != _MOST_EFFORT:
        tried.append(f"raise search.effort, which is {task.search.effort}")
    if not tried:
        tried.append("raise the limits, or try another start posture")
    advice = ", or ".join(tried)
    return advice[:1].upper() + advice[1:]


def _what_is_missing(problem: Problem) -> str:
    """Say which further choices of redundant joints EAIK might add where it is not installed."""
    if problem.task.redundant_joints != "auto":
        return ""
    missing = ik.missing_eaik(ik.find_all(problem.robot, problem.task_map))
    return f". {missing}" if missing else ""


def _lattices(candidates: Sequence[Attempt]) -> list[Attempt]:
    return [candidate for candidate in candidates if candidate.origin.startswith("lattice")]


def _some_joint_path(candidates: Sequence[Attempt]) -> bool:
    """Tell whether a lattice that was looked at has a joint path."""
    return any(candidate.branch for candidate in _lattices(candidates))


def _reason(decomposition: Decomposition, deadline: Deadline) -> BrachisError | str:
    problem = decomposition.problem
    given = problem.end if problem.start is None else problem.start
    posture = np.zeros(problem.robot.n) if given is None else given
    return reason_out_of_reach(
        decomposition.joint_map(posture, decomposition.branches[0]),
        problem.limits,
        any_branch=given is None,
        given="end" if problem.start is None else "start",
        deadline=deadline,
    )
