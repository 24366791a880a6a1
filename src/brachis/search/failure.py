"""Why no motion was found.

What of a path a decomposition reaches, by random postures: out of reach, joint ranges, branches, static torques.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brachis import ik
from brachis.common.deadline import NEVER, Deadline
from brachis.errors import BrachisError, PathError, PlanningError, Remedy
from brachis.kinematics import ClosedFormMap
from brachis.limits import Limit, Moments
from brachis.optimise.candidate import Candidate
from brachis.problem.feasibility import in_figures, load_remedies
from brachis.problem.problem import Decomposition, Problem
from brachis.robot import Robot
from brachis.robot.joints import in_turn_of
from brachis.search.joint_path import ALL_POSTURES, DeadEnd
from brachis.task import SolverSettings, Task

_RANGE_SLACK = 1e-9
_SEARCHED = 400
_STATIONS = 101
_TOGETHER = 20_000
"""Postures that are looked for at once; the time is asked for in between."""
_HELD_CHECKS = 60
_FAR = 10.0  # m
_NO_TIME = "There was no time to find out why: raise search.time_limit"


def reason_out_of_reach(
    joint_map: ClosedFormMap,
    limits: Sequence[Limit],
    *,
    any_branch: bool = False,
    given: str = "start",
    deadline: Deadline = NEVER,
) -> BrachisError | str:
    """Why no motion was found: an error where the path is out of reach or too heavy to hold, else advice.

    Redundant joints are searched at random at stations along the path, so "out of reach" means that none of many
    postures reaches the target.

    Parameters
    ----------
    joint_map : ClosedFormMap
    limits : sequence of Limit
    any_branch : bool, optional
        Whether a motion may be on any branch, not the decomposition's alone.
    given : {"start", "end"}, optional
        Whose posture the decomposition's branch is of.
    deadline : Deadline, optional
        When the search for the reason ends; the advice then says so.

    Returns
    -------
    BrachisError or str
    """
    s = np.linspace(0.0, 1.0, _STATIONS)
    found = _answers_along(joint_map, s, deadline, opened=False)
    if found is None:
        return _NO_TIME
    branches = (
        slice(None) if any_branch else slice(joint_map.branch, joint_map.branch + 1)
    )
    own = _Answers(
        *(part[:, :, branches] for part in (found.q, found.exists, found.inside))
    )
    # Where the redundant joints' ranges leave no answer, wider ones tell whether the ranges or the arm are to blame.
    reached = found.exists.any(axis=(1, 2, 3)).all()
    anywhere = found if reached else _answers_along(joint_map, s, deadline, opened=True)
    if anywhere is None:
        return _NO_TIME
    within = np.asarray(found.within.any(axis=(1, 2, 3)))
    label = joint_map.branch_label
    reasons = (
        (
            found.exists.any(axis=(1, 2, 3)) | anywhere.exists.any(axis=(1, 2, 3)),
            "the path is out of reach from s = {first:.3g} on (no posture was found)",
            "Shorten or move the path, or choose another start posture",
            [],
        ),
        (
            within,
            "no posture within the joint ranges was found from s = {first:.3g} on"
            + _beyond(joint_map, within, found, anywhere),
            "Shorten or move the path, or widen the joint ranges",
            [],
        ),
        (
            own.within.any(axis=(1, 2, 3)),
            f"the branch {label!r} of the {given} posture does not reach s = {{first:.3g}}",
            f"Choose a {given} posture of another branch, or leave redundant_joints: auto",
            [],
        ),
        *(
            (
                allowed,
                f"the {limit.name} limit {limit.refusal} from s = {{first:.3g}} on{nearest}",
                "Lead the path elsewhere",
                remedies,
            )
            for limit in limits
            if limit.at_rest == "posture"
            for allowed, nearest, remedies in [_allowed(joint_map.robot, limit, own)]
        ),
    )
    for possible, problem, hint, remedies in reasons:
        if not possible.all():
            first = float(s[int(np.argmin(possible))])
            last = float(s[np.flatnonzero(~possible)[-1]])
            error = PathError(
                problem.format(first=first), s_interval=(first, last), hint=hint
            )
            return error.with_remedies(*remedies)
    others = f"try {'other redundant joints, ' if joint_map.r else ''}another {given} posture"
    return f"Every point of the path is within reach of this branch, but no joint path through them was found; {others}"


@dataclass(frozen=True)
class _Answers:
    """Closed-form postures at S stations for T random choices of the redundant joints, B branches and A alternatives.

    Attributes
    ----------
    q : (S, T, B, A, n) ndarray
    exists : (S, T, B, A) bool ndarray
    inside : (S, T, B, A, n) bool ndarray
        Which joints are within their ranges.
    """

    q: np.ndarray
    exists: np.ndarray
    inside: np.ndarray

    @property
    def within(self) -> np.ndarray:
        """Which postures exist within all joint ranges, (S, T, B, A)."""
        return np.asarray(self.exists & self.inside.all(axis=4))


def _answers_along(
    joint_map: ClosedFormMap, s: np.ndarray, deadline: Deadline, *, opened: bool
) -> _Answers | None:
    """Postures that reach stations s, (S,), with random redundant joints, angles turned into their ranges.

    None where the time is up.

    `opened` takes the ranges of the redundant joints for open ones; otherwise the start posture's are tried as well.
    """
    robot = joint_map.robot
    redundant = joint_map.redundant
    rest = joint_map.nonredundant
    lower = robot.limits.position_lower
    upper = robot.limits.position_upper
    turning = robot.revolute
    wide = np.isin(np.arange(robot.n), redundant) & opened
    near = np.clip(joint_map.start, lower, upper)
    low = np.where(turning, -np.pi, near - _FAR)
    high = np.where(turning, np.pi, near + _FAR)
    low = np.where(
        np.isfinite(lower) & ~wide,
        np.where(turning, lower, np.maximum(lower, low)),
        low,
    )
    high = np.where(
        np.isfinite(upper) & ~wide,
        np.where(turning, upper, np.minimum(upper, high)),
        high,
    )
    tries = _SEARCHED * len(redundant) ** 2 if redundant else 1
    q_r = np.random.default_rng(0).uniform(
        low[redundant], high[redundant], (tries, len(redundant))
    )
    if not opened:
        q_r[0] = np.clip(joint_map.start, low, high)[redundant]
    parts = []
    for targets in np.array_split(
        joint_map.path.sample(s).target, min(len(s), -(-len(s) * tries // _TOGETHER))
    ):
        if deadline.passed:
            return None
        answers = joint_map.solver.solve(
            np.repeat(targets, tries, axis=0), np.tile(q_r, (len(targets), 1))
        )
        answers = answers.reshape(len(targets), tries, *answers.shape[1:])
        postures = np.empty((*answers.shape[:-1], robot.n))
        postures[..., redundant] = q_r[:, None, None]
        postures[..., rest] = answers
        parts.append(in_turn_of(postures, 0.5 * (low + high), turning))
    turned = np.concatenate(parts)
    inside = (turned >= lower - _RANGE_SLACK) & (turned <= upper + _RANGE_SLACK)
    return _Answers(turned, np.asarray(np.isfinite(turned).all(axis=4)), inside)


def _beyond(joint_map: ClosedFormMap, within: np.ndarray, *found: _Answers) -> str:
    """Say in words which joint the posture that is nearest to the ranges has beyond its own, and by how much.

    At the first station without a posture within them, `within` is (S,) bool.
    """
    robot = joint_map.robot
    if within.all():
        return ""
    station = int(np.argmin(within))
    q = np.concatenate(
        [answers.q[station][answers.exists[station]] for answers in found]
    )
    if not len(q):
        return ""
    beyond = np.maximum(
        np.maximum(robot.limits.position_lower - q, q - robot.limits.position_upper),
        0.0,
    )
    nearest = beyond[np.argmin(beyond.max(axis=1))]
    joint = int(np.argmax(nearest))
    unit = robot.position_units[joint]
    low = robot.limits.position_lower[joint]
    high = robot.limits.position_upper[joint]
    return (
        f" (the nearest one has joint {robot.joint_names[joint]!r} {nearest[joint]:.2g} {unit} beyond its range, "
        f"{low:.4g} to {high:.4g} {unit})"
    )


def _allowed(
    robot: Robot, limit: Limit, found: _Answers
) -> tuple[np.ndarray, str, list[Remedy]]:
    """Tell at which stations a limit allows some posture at rest, (S,) bool; in words what is lacking, and what to do.

    What is lacking is told of the station whose best posture is farthest beyond the limit.
    """
    allowed = np.zeros(len(found.q), dtype=bool)
    worst = 0.0
    lack = ""
    remedies: list[Remedy] = []
    for station, (postures, exist) in enumerate(
        zip(found.q, found.within, strict=True)
    ):
        values = limit.values(Moments.at_rest(postures[exist][:_HELD_CHECKS]))
        beyond = limit.violation(values)
        if not len(beyond):
            continue
        best = int(np.argmin(beyond.max(axis=1)))
        column = int(np.argmax(beyond[best]))
        allowed[station] = bool(beyond[best, column] <= 0.0)
        if beyond[best, column] > worst:
            worst = float(beyond[best, column])
            label = limit.labels[column]
            remedies = load_remedies(robot, limit, column, 1.0 + worst)
            needed, bound = in_figures(limit, column, float(values[best, column]))
            lack = f" ({label.subject} needs {needed} {label.unit} and has {bound} {label.unit})"
    return allowed, lack, remedies


_GOOD_PART = 0.1
_LOOKED_AT = 2
_MOST_EFFORT = "exhaustive"
_SLOWER = 0.7
"""Part of a speed at an end that is tried first."""


def refuse_what_is_out_of_reach(
    decompositions: Sequence[Decomposition],
    candidates: Sequence[Candidate],
    deadline: Deadline,
) -> None:
    """Raise the reason where the path is out of reach, so that further candidates would be in vain.

    Where no lattice has a joint path, any part of it counts; where no lattice was looked at, a good part.

    Parameters
    ----------
    decompositions : sequence of Decomposition
    candidates : sequence of Candidate
        So far.
    deadline : Deadline
        Nothing is refused for a reason that is not found by then.

    Raises
    ------
    PathError
    """
    if not decompositions or _some_joint_path(candidates):
        return
    reasons = [
        _reason(decomposition, deadline)
        for decomposition in decompositions[:_LOOKED_AT]
    ]
    clear = [
        (reason.s_interval, reason)
        for reason in reasons
        if isinstance(reason, PathError) and reason.s_interval is not None
    ]
    if len(clear) < len(reasons):
        return
    if _lattices(candidates) or all(
        end - begin > _GOOD_PART for (begin, end), _ in clear
    ):
        raise max(clear, key=lambda item: item[0][0])[1]


def no_motion(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    candidates: Sequence[Candidate],
    dead_ends: Mapping[str, DeadEnd],
    deadline: Deadline,
) -> BrachisError:
    """Return the error that says why no motion was found.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
    candidates : sequence of Candidate
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
    reason = (
        _reason(decompositions[0], deadline)
        if search
        else _advice(problem.task, candidates)
    )
    if isinstance(reason, BrachisError):
        return reason
    if dead_ends and not joint_path:
        name, furthest = min(
            dead_ends.items(), key=lambda item: np.diff(item[1].interval)[0]
        )
        own = name if name == ALL_POSTURES else f"redundant joints {name}"
        others = (
            f" ({own}; the furthest of {len(dead_ends)} lattices)"
            if len(dead_ends) > 1
            else ""
        )
        start = "" if problem.start is None else "start in another posture, "
        return PathError(
            f"no joint path was found: {furthest}{others}",
            s_interval=furthest.interval,
            hint=f"{start}shorten or move the path, or widen the joint ranges".capitalize()
            + _what_is_missing(problem),
        )
    counts = Counter(candidate.status for candidate in candidates)
    outcomes = "; ".join(
        status if n == 1 else f"{status} ({n} times)" for status, n in counts.items()
    )
    along = " along any joint path" if joint_path else ""
    error = PlanningError(
        f"no motion within the limits was found{along}: {outcomes or 'no initial guess'}",
        hint=reason + _what_is_missing(problem),
    )
    ends = {
        f"boundary.{key}": getattr(problem.task.boundary, key)
        for key in ("start_speed", "end_speed")
    }
    remedies = [
        Remedy(key, speed, _SLOWER * speed, problem.task.speed_unit)
        for key, speed in ends.items()
        if speed
    ]
    return error.with_remedies(*remedies)


def out_of_time(task: Task, undone: Sequence[str]) -> PlanningError:
    """Return the error that says that the time was up, and what was left undone."""
    problem = f"no motion was found within the time limit of {task.search.time_limit:g} s: {'; '.join(undone)}"
    return PlanningError(problem, hint="Raise search.time_limit")


def _advice(task: Task, candidates: Sequence[Candidate]) -> str:
    """Say what may help where there are joint paths, but no motion along them: only what has not been tried."""
    statuses = " ".join(candidate.status for candidate in candidates)
    few = SolverSettings.model_fields
    tried = []
    if (
        "iteration limit" in statuses
        and task.solver.max_iterations < few["max_iterations"].default
    ):
        tried.append(
            f"raise solver.max_iterations, which is {task.solver.max_iterations}"
        )
    if "time limit" in statuses:
        name = (
            "solver" if task.solver.time_limit < few["time_limit"].default else "search"
        )
        tried.append(
            f"raise {name}.time_limit, which is {getattr(task, name).time_limit:g} s"
        )
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


def _lattices(candidates: Sequence[Candidate]) -> list[Candidate]:
    return [
        candidate for candidate in candidates if candidate.origin.startswith("lattice")
    ]


def _some_joint_path(candidates: Sequence[Candidate]) -> bool:
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
