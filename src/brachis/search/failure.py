"""Why a plan failed: errors that explain why a path cannot be followed.

Random postures at stations along the path show which part of the path a decomposition reaches, and whether a station is
out of reach, beyond the joint ranges, on another branch, or too heavy to hold.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from brachis import ik
from brachis.common import tolerances
from brachis.common.deadline import NEVER, Deadline
from brachis.errors import BrachisError, PathError, PlanningError, Remedy
from brachis.limits import Limit, Role
from brachis.problem.feasibility import load_remedies
from brachis.problem.plausibility import of_places, say_how_far
from brachis.problem.problem import Decomposition, Problem
from brachis.robot import Robot
from brachis.robot.joints import in_turn_of
from brachis.search.closed_form_lattice import solve_all
from brachis.search.hopeless import speeds_of
from brachis.search.joint_path import (
    ALL_POSTURES,
    DeadEnd,
    least_excess,
    reaches,
    sampling_box,
)
from brachis.search.stages import Candidate
from brachis.task import SolverSettings, Task

_NO_TIME = "The reason was not found in time: raise search.time_limit"


def explain_reach(
    decomposition: Decomposition, deadline: Deadline = NEVER
) -> PathError | str:
    """Tell why a decomposition has no joint path.

    Parameters
    ----------
    decomposition : Decomposition
    deadline : Deadline, optional
        When the search for the reason ends; if no reason was found by then, the advice says so.

    Returns
    -------
    PathError or str
        The error, or a text of advice if every station is within reach or the time is up.
    """
    problem = decomposition.problem
    robot = problem.robot
    posture_name = "end" if problem.start is None else "start"
    posture = problem.end if problem.start is None else problem.start
    near = np.zeros(robot.n) if posture is None else posture
    s = np.linspace(0.0, 1.0, 101)
    postures = _sample_postures(decomposition, s, near, deadline)
    if postures is None:
        return _NO_TIME
    anywhere = postures
    if not _has_any(_exist(postures)).all():
        # Wider ranges show whether the ranges of the redundant joints or the arm itself is to blame.
        wider = _sample_postures(decomposition, s, near, deadline, opened=True)
        if wider is None:
            return _NO_TIME
        anywhere = np.concatenate([postures, wider], axis=1)

    for possible, cause, hint, remedies in _find_obstacles(
        decomposition, posture_name, s, postures, anywhere
    ):
        if not possible.all():
            first, last = (float(end) for end in s[~possible][[0, -1]])
            far = say_how_far(problem.task_map, problem.path, first)
            what = cause.format(first=first, far=far)
            error = PathError(what, s_interval=(first, last), hint=hint)
            return error.with_remedies(*remedies)

    joint_advice = "other redundant joints, " if decomposition.redundant else ""
    return (
        "Every point of the path is within reach of this branch, but no joint path through all of them was found; "
        f"try {joint_advice}another {posture_name} posture"
    )


def _find_obstacles(
    decomposition: Decomposition,
    posture_name: str,
    s: np.ndarray,
    postures: np.ndarray,
    anywhere: np.ndarray,
) -> Iterator[tuple[np.ndarray, str, str, Sequence[Remedy]]]:
    """Yield for each obstacle the stations, (S,) bool, that are free of it, and the cause, a hint and remedies.

    The redundant joints of `postures`, (S, T, B, A, n), are within their ranges; `anywhere` also has postures beyond
    these ranges. If the task gives a posture, named ``start`` or ``end``, the last obstacles are those on its branch.
    """
    problem = decomposition.problem
    robot = problem.robot
    branch = decomposition.branches[0]
    has_posture = problem.start is not None or problem.end is not None
    on_branch = postures[:, :, [branch]] if has_posture else postures
    exists = _has_any(_exist(anywhere))
    if not exists.all() and reaches(problem, float(s[np.argmin(exists)])):
        exists[:] = True
    yield (
        exists,
        "the path is out of reach from s = {first:.3g} on{far} (no posture was found)",
        _unit_hint(problem)
        or "Shorten or move the path, or choose another start posture",
        (),
    )
    within = _has_any(_are_within(robot, postures))
    yield (
        within,
        "no posture within the joint ranges was found from s = {first:.3g} on"
        + _describe_nearest(robot, anywhere[np.argmin(within)]),
        "Shorten or move the path, or widen the joint ranges",
        (),
    )
    label = decomposition.match.solver.branches[branch]
    yield (
        _has_any(_are_within(robot, on_branch)),
        f"the branch {label!r} of the {posture_name} posture does not reach s = {{first:.3g}}",
        f"Choose a {posture_name} posture of another branch, or leave redundant_joints: auto",
        (),
    )
    for limit in problem.limits:
        if limit.at_rest == "posture" and limit.role is not Role.SCENE:
            allowed, nearest, remedies = _check_at_rest(robot, limit, on_branch)
            cause = f"the {limit.name} limit {limit.refusal} from s = {{first:.3g}} on{nearest}"
            yield allowed, cause, "Move the path", remedies


def _unit_hint(problem: Problem) -> str | None:
    """Say which figure of the path may be in the wrong unit; None if all figures are plausible."""
    issues = [issue for issue in of_places(problem) if issue.where == "path"]
    texts = [
        f"{issue.message[:1].upper()}{issue.message[1:]}: {issue.found}"
        for issue in issues
    ]
    return "; ".join(texts) or None


def _exist(q: np.ndarray) -> np.ndarray:
    """Tell which postures, (..., n), exist, (...,) bool; the others are NaN."""
    return np.isfinite(q).all(axis=-1)


def _are_within(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Tell which postures, (..., n), exist and are within the joint ranges, (...,) bool."""
    return np.all(_excess(robot, q) <= tolerances.COORDINATE, axis=-1)


def _excess(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return how far joints are beyond their ranges, (..., n), rad or m; negative inside, NaN without a posture."""
    limits = robot.limits
    return np.maximum(limits.position_lower - q, q - limits.position_upper)


def _has_any(mask: np.ndarray) -> np.ndarray:
    """Tell at which stations, (S,), any entry of a mask, (S, T, B, A), is true."""
    return np.asarray(mask.any(axis=(1, 2, 3)))


def _sample_postures(
    decomposition: Decomposition,
    s: np.ndarray,
    near: np.ndarray,
    deadline: Deadline,
    *,
    opened: bool = False,
) -> np.ndarray | None:
    """Draw T values of the redundant joints; return postures (S, T, B, A, n) at stations s, (S,), on all branches.

    Angles are moved into their ranges by whole turns, and postures that do not exist are NaN. If the time is up, the
    result is None. With `opened`, the ranges of the redundant joints are ignored; otherwise the redundant joints of the
    posture `near` are tried as well.
    """
    robot = decomposition.problem.robot
    redundant = list(decomposition.redundant)
    low, high = sampling_box(robot, near, opened=redundant if opened else [])
    tries = 400 * len(redundant) ** 2 if redundant else 1
    q_r = np.random.default_rng(0).uniform(
        low[redundant], high[redundant], (tries, len(redundant))
    )
    if not opened:
        q_r[0] = np.clip(near, low, high)[redundant]
    targets = decomposition.problem.path.sample(s).target
    postures = []
    # No more than 20,000 postures are computed at once, so that the deadline is noticed.
    for block in np.array_split(targets, min(len(s), -(-len(s) * tries // 20_000))):
        if deadline.passed:
            return None
        repeated = np.repeat(block, tries, axis=0)
        q = solve_all(decomposition, repeated, np.tile(q_r, (len(block), 1)))
        q = q.reshape(len(block), tries, *q.shape[1:])
        postures.append(in_turn_of(q, 0.5 * (low + high), robot.revolute))
    return np.concatenate(postures)


def _describe_nearest(robot: Robot, q: np.ndarray) -> str:
    """Say which joint is out of its range, and how far, in the posture out of (T, B, A, n) closest to the ranges."""
    q = q[_exist(q)]
    if not len(q):
        return ""
    excess = np.maximum(_excess(robot, q), 0.0)
    nearest = excess[np.argmin(excess.max(axis=1))]
    joint = np.argmax(nearest)
    unit = robot.position_units[joint]
    low = robot.limits.position_lower[joint]
    high = robot.limits.position_upper[joint]
    return (
        f" (in the nearest one, joint {robot.joint_names[joint]!r} is {nearest[joint]:.2g} {unit} beyond its range, "
        f"{low:.4g} to {high:.4g} {unit})"
    )


def _check_at_rest(
    robot: Robot, limit: Limit, q: np.ndarray
) -> tuple[np.ndarray, str, list[Remedy]]:
    """Tell at which stations, (S,) bool, a limit allows at least one posture of (S, T, B, A, n) at rest.

    Also say by how much the limit is exceeded at the station where even the best posture exceeds it most, and what to
    change.
    """
    allowed = np.zeros(len(q), dtype=bool)
    worst = 0.0
    lack = ""
    remedies = []
    for station, postures in enumerate(q):
        # A few dozen postures of each station are enough.
        within = postures[_are_within(robot, postures)][:60]
        if not len(within):
            continue
        beyond, column, text = least_excess(limit, within[:, None])
        allowed[station] = beyond <= 0.0
        if beyond > worst:
            worst = beyond
            remedies = load_remedies(robot, limit, column, 1.0 + worst)
            lack = f" ({limit.labels[column].subject}: {text})"
    return allowed, lack, remedies


def explain_first_failures(
    decompositions: Sequence[Decomposition],
    candidates: Sequence[Candidate],
    deadline: Deadline,
) -> PathError | None:
    """Tell whether the path is out of reach, because then no further candidates need to be tried.

    If lattices were searched and none has a joint path, any unreachable part of the path counts. If no lattice was
    searched, the unreachable part has to be more than a tenth of the path.

    Parameters
    ----------
    decompositions : sequence of Decomposition
    candidates : sequence of Candidate
        Candidates so far.
    deadline : Deadline
        If no reason is found by then, the result is None.
    """
    if not decompositions or _has_joint_path(candidates):
        return None
    failures = []
    for decomposition in decompositions[:2]:
        reason = explain_reach(decomposition, deadline)
        if isinstance(reason, str) or reason.s_interval is None:
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
    not_completed: Sequence[str] = (),
) -> BrachisError:
    """Tell why no motion was found.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
    candidates : sequence of Candidate
    dead_ends : mapping of str to DeadEnd
        The place where each lattice ends; the keys are the names of the lattice's redundant joints.
    deadline : Deadline
        When the search for the reason ends.
    not_completed : sequence of str, optional
        Work for which there was not enough time. Lack of time is then given as the reason, unless the lattices show a
        better one.
    """
    has_joint_path = _has_joint_path(candidates)
    if not_completed:
        limit = f"within the time limit of {problem.task.search.time_limit:g} s"
        undone = "; ".join(not_completed)
        if dead_ends and not has_joint_path:
            hint_end = f". The search was not completed {limit} ({undone}): raise search.time_limit"
            return _explain_dead_ends(problem.task, dead_ends, hint_end)
        return PlanningError(
            f"no motion was found {limit}: {undone}", hint="Raise search.time_limit"
        )
    advice: PathError | str = _advise(problem.task, candidates)
    if decompositions and not has_joint_path:
        advice = explain_reach(decompositions[0], deadline)
    if isinstance(advice, PathError):
        return advice
    missing = ""
    if problem.task.redundant_joints == "auto":
        missing = ik.missing_eaik(ik.find_all(problem.robot, problem.task_map))
    hint_end = f". {missing}" if missing else ""
    if dead_ends and not has_joint_path:
        return _explain_dead_ends(problem.task, dead_ends, hint_end)
    counts = Counter(candidate.status for candidate in candidates)
    outcomes = "; ".join(
        status if n == 1 else f"{status} ({n} times)" for status, n in counts.items()
    )
    along = " along any joint path" if has_joint_path else ""
    error = PlanningError(
        f"no motion within the limits was found{along}: {outcomes or 'no initial guess'}",
        hint=advice + hint_end,
    )
    remedies = [
        replace(speed, key=problem.key_of(number, speed.key)).lower_to(
            0.7 * speed.figure
        )
        for number, part in enumerate(problem.parts)
        for speed in speeds_of(part)
    ]
    return error.with_remedies(*remedies)


def _explain_dead_ends(
    task: Task, dead_ends: Mapping[str, DeadEnd], hint_end: str
) -> PathError:
    """Say where the lattice that got farthest along the path ends."""
    name = min(dead_ends, key=lambda name: np.diff(dead_ends[name].interval)[0])
    lattice_name = name if name == ALL_POSTURES else f"redundant joints {name}"
    lattice_note = f" ({lattice_name}; the furthest of {len(dead_ends)} lattices)"
    start = "" if task.start == "free" else "start in another posture, "
    scene = ", move bodies of the scene" if task.scene else ""
    hint = f"{start}shorten or move the path{scene}, or widen the joint ranges"
    return PathError(
        f"no continuous joint path was found: {dead_ends[name]}{lattice_note if len(dead_ends) > 1 else ''}",
        s_interval=dead_ends[name].interval,
        hint=hint.capitalize() + hint_end,
    )


def _advise(task: Task, candidates: Sequence[Candidate]) -> str:
    """Say what may help if joint paths were found, but no motion along them; name only what has not been tried."""
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
    """Tell whether any lattice that was searched has a joint path."""
    return any(
        candidate.branch for candidate in candidates if _is_of_lattice(candidate)
    )
