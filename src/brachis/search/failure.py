"""Why a plan failed: the `Failure` that every explanation makes, and explanations of paths that cannot be followed.

What a decomposition reaches of a path is found by random postures at stations along it: is a station out of reach,
beyond the joint ranges, on another branch, or too heavy to hold?
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from brachis import ik
from brachis.common import tolerances
from brachis.common.deadline import NEVER, Deadline
from brachis.errors import BrachisError, PathError, PlanningError, Remedy
from brachis.limits import Limit, Moments, Role
from brachis.optimise.candidate import Candidate
from brachis.problem.feasibility import in_figures, load_remedies
from brachis.problem.plausibility import of_places, say_how_far
from brachis.problem.problem import Decomposition, Problem
from brachis.robot import Robot
from brachis.robot.joints import in_turn_of
from brachis.search.closed_form_lattice import solve_all
from brachis.search.joint_path import ALL_POSTURES, DeadEnd, sampling_box
from brachis.task import SolverSettings, Task

_NO_TIME = "The reason was not found in time: raise search.time_limit"


@dataclass(frozen=True)
class Failure:
    """Why a plan failed.

    Attributes
    ----------
    cause : str
        What is wrong, in words.
    phase : {"path", "motion"}
        Whether the path itself cannot be followed (`PathError`), or no motion along it was found (`PlanningError`).
    s_interval : tuple of float or None
        Where on the path.
    where, found, needed : str or None
        Key of the task, or name of the limit; what was found there, and what would be accepted.
    hint : str
        What to try.
    remedies : sequence of Remedy
        Numbers of the task to change.
    """

    cause: str
    phase: str = "motion"
    s_interval: tuple[float, float] | None = None
    where: str | None = None
    found: str | None = None
    needed: str | None = None
    hint: str = ""
    remedies: Sequence[Remedy] = ()

    def error(self) -> BrachisError:
        """Make the error that says so."""
        facts = {
            "where": self.where,
            "found": self.found,
            "allowed": self.needed,
            "hint": self.hint,
        }
        error = (
            PathError(self.cause, s_interval=self.s_interval, **facts)
            if self.phase == "path"
            else PlanningError(self.cause, **facts)
        )
        return error.with_remedies(*self.remedies)


def explain_reach(
    decomposition: Decomposition, deadline: Deadline = NEVER
) -> Failure | str:
    """Tell why a decomposition has no joint path.

    Parameters
    ----------
    decomposition : Decomposition
    deadline : Deadline, optional
        When the search for the reason ends; the advice then says so.

    Returns
    -------
    Failure or str
        Advice where every station is within reach.
    """
    problem = decomposition.problem
    given = "end" if problem.start is None else "start"
    posture = problem.end if problem.start is None else problem.start
    near = np.zeros(problem.robot.n) if posture is None else posture
    branch = decomposition.branches[0]
    s = np.linspace(0.0, 1.0, 101)
    found = _sample_postures(decomposition, s, near, deadline)
    if found is None:
        return _NO_TIME
    anywhere = found
    if not _has_any(_exist(found)).all():
        # Wider ranges tell whether the ranges of the redundant joints or the arm are to blame.
        wider = _sample_postures(decomposition, s, near, deadline, opened=True)
        if wider is None:
            return _NO_TIME
        anywhere = np.concatenate([found, wider], axis=1)
    own = found if posture is None else found[:, :, [branch]]

    def fail(
        possible: np.ndarray, cause: str, hint: str, remedies: Sequence[Remedy] = ()
    ) -> Failure | None:
        """Say where along the path something is not possible, (S,) bool; None if it is everywhere."""
        if possible.all():
            return None
        first, last = (float(end) for end in s[np.flatnonzero(~possible)[[0, -1]]])
        return Failure(
            cause.format(
                first=first, far=say_how_far(problem.task_map, problem.path, first)
            ),
            phase="path",
            s_interval=(first, last),
            hint=hint,
            remedies=remedies,
        )

    robot = problem.robot
    label = decomposition.match.solver.branches[branch]
    within = _has_any(_are_within(robot, found))
    failure = (
        fail(
            _has_any(_exist(anywhere)),
            "the path is out of reach from s = {first:.3g} on{far} (no posture was found)",
            _unit_hint(problem)
            or "Shorten or move the path, or choose another start posture",
        )
        or fail(
            within,
            "no posture within the joint ranges was found from s = {first:.3g} on"
            + _describe_nearest(robot, anywhere[np.argmin(within)]),
            "Shorten or move the path, or widen the joint ranges",
        )
        or fail(
            _has_any(_are_within(robot, own)),
            f"the branch {label!r} of the {given} posture does not reach s = {{first:.3g}}",
            f"Choose a {given} posture of another branch, or leave redundant_joints: auto",
        )
    )
    for limit in problem.limits:
        is_load = limit.at_rest == "posture" and limit.role is not Role.SCENE
        if failure is None and is_load:
            allowed, nearest, remedies = _check_at_rest(robot, limit, own)
            cause = f"the {limit.name} limit {limit.refusal} from s = {{first:.3g}} on{nearest}"
            failure = fail(allowed, cause, "Move the path", remedies)
    others = "other redundant joints, " if decomposition.redundant else ""
    return failure or (
        "Every point of the path is within reach of this branch, but no joint path through them was found; "
        f"try {others}another {given} posture"
    )


def _unit_hint(problem: Problem) -> str | None:
    """Say what figure of the path looks like another unit; None if all are plausible."""
    issues = [issue for issue in of_places(problem) if issue.where == "path"]
    texts = [
        f"{issue.message[:1].upper()}{issue.message[1:]}: {issue.found}"
        for issue in issues
    ]
    return "; ".join(texts) or None


def _exist(q: np.ndarray) -> np.ndarray:
    """Tell which postures, (..., n), exist, (...,) bool; the others are NaN."""
    return np.asarray(np.isfinite(q).all(axis=-1))


def _are_within(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Tell which postures, (..., n), are within the joint ranges, (...,) bool."""
    return np.asarray(
        _exist(q) & (_excess(robot, q) <= tolerances.COORDINATE).all(axis=-1)
    )


def _excess(robot: Robot, q: np.ndarray) -> np.ndarray:
    """How far joints are beyond their ranges, (..., n), rad or m; negative within."""
    limits = robot.limits
    return np.maximum(limits.position_lower - q, q - limits.position_upper)


def _has_any(those: np.ndarray) -> np.ndarray:
    """Tell at which stations there is a posture, (S,), for random joints, branches and alternatives, (S, T, B, A)."""
    return np.asarray(those.any(axis=(1, 2, 3)))


def _sample_postures(
    decomposition: Decomposition,
    s: np.ndarray,
    given: np.ndarray,
    deadline: Deadline,
    *,
    opened: bool = False,
) -> np.ndarray | None:
    """Draw T random redundant joints: postures (S, T, B, A, n) that reach stations s, (S,), on all branches.

    Angles are turned into their ranges, and what does not exist is NaN; None if the time is up. `opened` ignores the
    ranges of the redundant joints; otherwise those of the given posture are tried as well.
    """
    robot = decomposition.problem.robot
    redundant = list(decomposition.redundant)
    low, high = sampling_box(robot, given, opened=redundant if opened else [])
    tries = 400 * len(redundant) ** 2 if redundant else 1
    q_r = np.random.default_rng(0).uniform(
        low[redundant], high[redundant], (tries, len(redundant))
    )
    if not opened:
        q_r[0] = np.clip(given, low, high)[redundant]
    targets = decomposition.problem.path.sample(s).target
    parts = []
    # No more than 20,000 postures at once, so that the deadline is noticed.
    for those in np.array_split(targets, min(len(s), -(-len(s) * tries // 20_000))):
        if deadline.passed:
            return None
        several = np.repeat(those, tries, axis=0)
        q = solve_all(decomposition, several, np.tile(q_r, (len(those), 1)))
        q = q.reshape(len(those), tries, *q.shape[1:])
        parts.append(in_turn_of(q, 0.5 * (low + high), robot.revolute))
    return np.concatenate(parts)


def _describe_nearest(robot: Robot, q: np.ndarray) -> str:
    """Say which joint the posture nearest to the ranges, of (T, B, A, n), has beyond its own, and by how much."""
    q = q[_exist(q)]
    if not len(q):
        return ""
    excess = np.maximum(_excess(robot, q), 0.0)
    nearest = excess[np.argmin(excess.max(axis=1))]
    joint = int(np.argmax(nearest))
    unit = robot.position_units[joint]
    low = robot.limits.position_lower[joint]
    high = robot.limits.position_upper[joint]
    return (
        f" (the nearest one has joint {robot.joint_names[joint]!r} {nearest[joint]:.2g} {unit} beyond its range, "
        f"{low:.4g} to {high:.4g} {unit})"
    )


def _check_at_rest(
    robot: Robot, limit: Limit, q: np.ndarray
) -> tuple[np.ndarray, str, list[Remedy]]:
    """Tell at which stations a limit allows some posture of (S, T, B, A, n) at rest, (S,) bool.

    Also say what is lacking at the station whose best posture is farthest beyond the limit, and what to change.
    """
    allowed = np.zeros(len(q), dtype=bool)
    worst = 0.0
    lack = ""
    remedies: list[Remedy] = []
    for station, postures in enumerate(q):
        # A few dozen postures tell enough.
        within = postures[_are_within(robot, postures)][:60]
        values = limit.values(Moments.at_rest(within))
        beyond = limit.violation(values)
        if not len(beyond):
            continue
        best = int(np.argmin(beyond.max(axis=1)))
        column = int(np.argmax(beyond[best]))
        allowed[station] = beyond[best, column] <= 0.0
        if beyond[best, column] > worst:
            worst = float(beyond[best, column])
            label = limit.labels[column]
            remedies = load_remedies(robot, limit, column, 1.0 + worst)
            needed, bound = in_figures(limit, column, float(values[best, column]))
            lack = f" ({label.subject}: {needed}{label.after} at best, allowed: {bound}{label.after})"
    return allowed, lack, remedies


def explain_first_failures(
    decompositions: Sequence[Decomposition],
    candidates: Sequence[Candidate],
    deadline: Deadline,
) -> Failure | None:
    """Tell whether the path is out of reach, so that further candidates would be in vain.

    Where no lattice has a joint path, any part of the path counts; where no lattice was looked at, a tenth of it.

    Parameters
    ----------
    decompositions : sequence of Decomposition
    candidates : sequence of Candidate
        So far.
    deadline : Deadline
        A reason that is not found by then is not given.
    """
    if not decompositions or _has_joint_path(candidates):
        return None
    failures = []
    for decomposition in decompositions[:2]:
        reason = explain_reach(decomposition, deadline)
        if not isinstance(reason, Failure) or reason.s_interval is None:
            return None
        failures.append((reason.s_interval, reason))
    is_clear = all(end - begin > 0.1 for (begin, end), _ in failures)
    if not is_clear and not any(map(_is_of_lattice, candidates)):
        return None
    return max(failures, key=lambda item: item[0][0])[1]


def explain_no_motion(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    candidates: Sequence[Candidate],
    dead_ends: Mapping[str, DeadEnd],
    deadline: Deadline,
) -> Failure:
    """Tell why no motion was found.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
    candidates : sequence of Candidate
    dead_ends : mapping of str to DeadEnd
        Where the lattices end, by the names of the redundant joints.
    deadline : Deadline
        When the search for the reason ends.
    """
    has_joint_path = _has_joint_path(candidates)
    reason: Failure | str = _advise(problem.task, candidates)
    if decompositions and not has_joint_path:
        reason = explain_reach(decompositions[0], deadline)
    if isinstance(reason, Failure):
        return reason
    missing = ""
    if problem.task.redundant_joints == "auto":
        missing = ik.missing_eaik(ik.find_all(problem.robot, problem.task_map))
    more = f". {missing}" if missing else ""
    if dead_ends and not has_joint_path:
        return _explain_dead_ends(problem.task, dead_ends, more)
    counts = Counter(candidate.status for candidate in candidates)
    outcomes = "; ".join(
        status if n == 1 else f"{status} ({n} times)" for status, n in counts.items()
    )
    along = " along any joint path" if has_joint_path else ""
    boundary = problem.task.boundary
    speeds = [
        ("boundary.start_speed", boundary.start_speed, problem.task.speed_unit),
        ("boundary.end_speed", boundary.end_speed, problem.task.speed_unit),
    ]
    speeds += [
        (f"tool_limits.process_speed[{number}].speed", part.speed, "m/s")
        for number, part in enumerate(problem.task.tool_limits.process_speed)
    ]
    return Failure(
        f"no motion within the limits was found{along}: {outcomes or 'no initial guess'}",
        hint=reason + more,
        remedies=[
            Remedy(key, speed, 0.7 * speed, unit)
            for key, speed, unit in speeds
            if speed
        ],
    )


def _explain_dead_ends(
    task: Task, dead_ends: Mapping[str, DeadEnd], more: str
) -> Failure:
    """Say where the lattice ends that reached farthest."""
    name = min(dead_ends, key=lambda name: np.diff(dead_ends[name].interval)[0])
    own = name if name == ALL_POSTURES else f"redundant joints {name}"
    others = f" ({own}; the furthest of {len(dead_ends)} lattices)"
    start = "" if task.start == "free" else "start in another posture, "
    scene = ", move bodies of the scene" if task.scene else ""
    hint = f"{start}shorten or move the path{scene}, or widen the joint ranges"
    return Failure(
        f"no joint path was found: {dead_ends[name]}{others if len(dead_ends) > 1 else ''}",
        phase="path",
        s_interval=dead_ends[name].interval,
        hint=hint.capitalize() + more,
    )


def explain_time_limit(
    task: Task,
    not_completed: Sequence[str],
    candidates: Sequence[Candidate],
    dead_ends: Mapping[str, DeadEnd],
) -> Failure:
    """Say that the time was up, and what was not completed; where lattices ended, if none has a joint path."""
    if dead_ends and not _has_joint_path(candidates):
        limit = f"within the time limit of {task.search.time_limit:g} s"
        more = f". Not all was done {limit}: {'; '.join(not_completed)}: raise search.time_limit"
        return _explain_dead_ends(task, dead_ends, more)
    return Failure(
        f"no motion was found within the time limit of {task.search.time_limit:g} s: {'; '.join(not_completed)}",
        hint="Raise search.time_limit",
    )


def _advise(task: Task, candidates: Sequence[Candidate]) -> str:
    """Say what may help where there are joint paths, but no motion along them: only what has not been tried."""
    statuses = " ".join(candidate.status for candidate in candidates)
    defaults = SolverSettings()
    solver = task.solver
    advice = []
    if (
        "iteration limit" in statuses
        and solver.max_iterations < defaults.max_iterations
    ):
        advice.append(f"raise solver.max_iterations, which is {solver.max_iterations}")
    if "time limit" in statuses:
        key = "solver" if solver.time_limit < defaults.time_limit else "search"
        advice.append(
            f"raise {key}.time_limit, which is {getattr(task, key).time_limit:g} s"
        )
    if not advice and task.search.effort != "exhaustive":
        advice.append(f"raise search.effort, which is {task.search.effort}")
    text = ", or ".join(advice) or "raise the limits, or try another start posture"
    return text[:1].upper() + text[1:]


def _is_of_lattice(candidate: Candidate) -> bool:
    return candidate.origin.startswith("lattice")


def _has_joint_path(candidates: Sequence[Candidate]) -> bool:
    """Tell whether a lattice that was looked at has a joint path."""
    return any(each.branch for each in candidates if _is_of_lattice(each))
