"""Checks before planning: a posture may be out of range, or need more torque than the joints have."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from brachis.common import tolerances
from brachis.common.words import name_first, write_apart
from brachis.errors import InputError, PathError, Remedy, StartError
from brachis.ik import Match
from brachis.limits import Limit, Moments, Role
from brachis.limits.joint import PositionLimit, position_measure
from brachis.path import Path, check_on_path
from brachis.robot import Robot, TaskMap
from brachis.robot.joints import complement, difference
from brachis.robot.plausibility import position_hint
from brachis.robot.task_map import JointSpace
from brachis.robot.task_map.protocol import TURN_ROWS
from brachis.task import SplineSettings, Task

_REGULAR = 1e-6
"""If the smallest singular value of the Jacobian, in m and rad, is below this, the posture counts as singular."""


_MOVE_BODIES = (
    "Move the body, choose another posture, or let the pair touch with collisions.disable; "
    "bodies of links are the <collision> elements of the URDF"
)


def check_postures(
    task: Task,
    task_map: TaskMap,
    limits: tuple[Limit, ...],
    postures: Mapping[str, np.ndarray],
    path: Path,
) -> tuple[Limit, ...]:
    """Refuse start and end postures that are out of range, exceed a limit at rest, or are off the path.

    Parameters
    ----------
    task : Task
    task_map : TaskMap
    limits : tuple of Limit
    postures : mapping of str to (n,) ndarray
        The postures that the task gives, by the names ``start`` and ``end``.
    path : Path

    Returns
    -------
    tuple of Limit
        The limits. A limit that a given posture or a prescribed joint path exceeds by up to ``refinement.tolerance`` is
        widened to include it.

    Raises
    ------
    StartError
    """
    robot = task_map.robot
    tolerance = task.refinement.tolerance
    for end, posture in postures.items():
        key = task.posture_key(end)
        _check_range(robot, posture[None], key, tolerance)
        _check_at_rest(robot, limits, posture, key, tolerance)
        limits = tuple(_widen(limit, posture[None], tolerance) for limit in limits)
    along = path.sample(np.linspace(0.0, 1.0, 401)).target
    if len(postures) == 2 and not (task_map.m or task.program):
        check_moves(*postures.values())
    if "end" in postures and task_map.m:
        key = task.posture_key("end")
        check_on_path(task_map, postures["end"], along[-1], "end", key)
    if isinstance(task_map, JointSpace):
        _check_range(robot, along, "path", tolerance)
        limits = tuple(
            _widen(limit, along, tolerance)
            if isinstance(limit, PositionLimit)
            else limit
            for limit in limits
        )
    return limits


def check_moves(start: np.ndarray, end: np.ndarray) -> None:
    """Refuse a move between two equal postures, (n,), by a PathError."""
    if np.abs(end - start).max() <= tolerances.WRITTEN:
        raise PathError(
            "the arm is already in this posture",
            where="end",
            allowed="another posture, or no move",
        )


def _widen(limit: Limit, postures: np.ndarray, tolerance: float) -> Limit:
    """Widen a limit so that it allows postures, (K, n), at rest that exceed it by up to the tolerance."""
    if limit.at_rest == "nothing":
        return limit
    values, beyond = beyond_at_rest(limit, postures, 0.0)
    excess = beyond.max(axis=0)
    is_near = (excess > 0.0) & (excess <= tolerance)
    if not is_near.any():
        return limit
    wider = copy.copy(limit)
    lowest = np.minimum(limit.lower, values.min(axis=0))
    highest = np.maximum(limit.upper, values.max(axis=0))
    wider.lower = np.where(is_near, lowest, limit.lower)
    wider.upper = np.where(is_near, highest, limit.upper)
    return wider


def _check_range(
    robot: Robot, postures: np.ndarray, where: str, tolerance: float
) -> None:
    """Refuse a posture, or a prescribed joint path, (K, n), that leaves a joint's range."""
    lower = robot.limits.position_lower
    upper = robot.limits.position_upper
    excess = np.maximum(lower - postures, postures - upper)
    beyond = excess - tolerance * position_measure(lower, upper)
    joints = np.flatnonzero(beyond.max(axis=0) > 0.0)
    if not len(joints):
        return
    i = int(joints[0])
    k = int(np.argmax(beyond[:, i]))
    name = robot.joint_names[i]
    unit = robot.position_units[i]
    value = float(postures[k, i])
    ends = (float(lower[i]), float(upper[i]))
    position, first, last = write_apart(value, *ends, digits=6)
    error: type[InputError] = StartError
    place = ""
    advice = "Change the posture, or the range with"
    if where == "path":
        error = PathError
        place = f" at s = {k / (len(postures) - 1):.3g}"
        advice = "Move the path, or raise"
    hint = position_hint(value, *ends, unit)
    raise error(
        f"joint {name!r} is out of its range",
        where=where,
        found="; likewise ".join(
            [
                f"{position} {unit}{place}",
                *np.array(robot.joint_names)[joints[1:]],
            ]
        ),
        allowed=f"{first} {unit} to {last} {unit}",
        hint=hint or f"{advice} robot.limits.position.{name}",
    )


def beyond_at_rest(
    limit: Limit, q: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return a limit's values, (K, c), in postures (K, n) at rest, and their violations minus the tolerance."""
    values = limit.values(Moments.at_rest(q))
    return values, limit.violation(values) - tolerance


def _check_at_rest(
    robot: Robot,
    limits: Sequence[Limit],
    posture: np.ndarray,
    where: str,
    tolerance: float,
) -> None:
    """Refuse a posture in which a limit is exceeded even though the arm stands still."""
    for limit in limits:
        if limit.at_rest == "nothing":
            continue
        (values,), (beyond,) = beyond_at_rest(limit, posture[None], tolerance)
        weak = [limit.labels[i] for i in np.flatnonzero(beyond > 0.0)]
        if not weak:
            continue
        worst = int(np.argmax(beyond))
        label = limit.labels[worst]
        reached, allowed = in_figures(limit, worst, float(values[worst]))
        remedies = load_remedies(robot, limit, worst, 1.0 + float(beyond[worst]))
        subjects = [weaker.subject for weaker in weak if weaker is not label]
        further_subjects = name_first(subjects, ", ")
        likewise = ""
        if further_subjects:
            # If several joints exceed their limits, changing the limit of one joint is not enough.
            likewise = f"; likewise {further_subjects}"
            remedies = [remedy for remedy in remedies if remedy.key != label.key]
        hint = "Choose another posture"
        keys = dict.fromkeys(weaker.key for weaker in weak if weaker.key)
        if keys and label.key not in {remedy.key for remedy in remedies}:
            hint += f", or change {', '.join(keys)}"
        if limit.role is Role.SCENE:
            hint = _MOVE_BODIES
        raise StartError(
            f"the {label.kind} limit of {label.subject!r} {limit.refusal}",
            where=where,
            found=f"{reached}{label.after} at rest{likewise}",
            allowed=f"{allowed}{label.after}",
            hint=hint,
        ).with_remedies(*remedies)


def load_remedies(
    robot: Robot, limit: Limit, column: int, ratio: float
) -> list[Remedy]:
    """List remedies if holding the arm needs `ratio` times a limit: a higher limit, or a smaller payload.

    A smaller payload is no remedy for a limit that depends on the posture alone.
    """
    label = limit.labels[column]
    scale = getattr(robot.settings.limits.scale, limit.kind, 1.0)
    remedies = []
    for bound in limit.bounds if label.key else ():
        if bound.column == column and bound.side is None:
            figure = bound.figure / scale
            # The new limit is 5 % above the value needed to hold the arm.
            enough = 1.05 * ratio * figure
            remedies.append(Remedy(label.key, figure, enough, label.unit))
    payload = robot.settings.payload
    if payload is not None and payload.mass and not limit.is_of_postures:
        mass = payload.mass
        remedies.append(Remedy("robot.payload.mass", mass, mass / ratio, "kg"))
    return remedies


def check_smoothness(limits: Sequence[Limit], spline: SplineSettings) -> None:
    """Refuse limits on a derivative that is unbounded because the next lower derivative jumps at knots or at the ends.

    Raises
    ------
    InputError
    """
    for limit in limits:
        jumping = {2: "velocity", 3: "acceleration"}[limit.order]
        requirement = f"the {limit.name} limit needs a continuous {jumping}"
        if spline.degree < limit.order:
            raise InputError(
                requirement,
                where="spline.degree",
                found=f"{spline.degree}, with which it jumps at knots",
                allowed=f">= {limit.order}",
            )
        if spline.vanishing + 1 < limit.order:
            raise InputError(
                requirement,
                where="spline.rest",
                found=f"{spline.rest}, with which it jumps at the ends",
                allowed="full or jerk",
            )


def in_figures(limit: Limit, column: int, value: float) -> tuple[str, str]:
    """Write a value and its bounds in the unit of the value's label, without naming the unit."""
    bounds = [bound for bound in limit.bounds if bound.column == column]
    if not bounds:
        written, low, high = write_apart(
            value, limit.lower[column], limit.upper[column]
        )
        return written, f"{low} to {high}"
    first = bounds[0]
    if first.side is None:  # the value is a ratio to one figure
        written, allowed = write_apart(abs(value) * first.figure, first.figure)
        return written, allowed
    level = limit.lower[column] if first.side == "lower" else limit.upper[column]
    reached = first.figure + (value - level) / first.per_unit
    written, *figures = write_apart(reached, *(bound.figure for bound in bounds))
    ends = {bound.side: figure for bound, figure in zip(bounds, figures, strict=True)}
    if len(ends) == 2:
        return written, f"{ends['lower']} to {ends['upper']}"
    word = "at least" if first.side == "lower" else "at most"
    return written, f"{word} {figures[0]}"


def check_regular(
    task: Task, task_map: TaskMap, postures: Mapping[str, np.ndarray]
) -> None:
    """Refuse a start or end posture that is a singularity of the arm, because no coordinates describe motions there.

    Raises
    ------
    StartError
    """
    for end, posture in postures.items():
        jacobian = task_map.jacobian(task_map.twists(posture[None]))
        if _least_singular_values(jacobian)[0] < _REGULAR:
            raise StartError(
                f"the {end} posture is singular",
                where=task.posture_key(end),
                found="a posture in which the tool cannot move in all directions of the task space",
                allowed="a posture in which it can",
                hint="Bend the arm a little",
            )


_TURNS_ALONE = (
    "rx, ry and rz are rotations of the tool about x, y, z; if it turns about only one of these axes, prescribe "
    "rows of its position, and yaw, pitch or roll"
)


def check_independent(task_map: TaskMap) -> None:
    """Refuse rows of the task space that no joint changes, such as z of a planar arm, or that depend on each other.

    Raises
    ------
    InputError
    """
    rows = task_map.rows
    jacobians = task_map.sample_jacobians()
    if _least_singular_values(jacobians).max() >= _REGULAR:
        return
    numbers = range(len(rows))
    subsets = [
        subset
        for size in range(1, len(rows) + 1)
        for subset in combinations(numbers, size)
        if _least_singular_values(jacobians[:, list(subset)]).max() < _REGULAR
    ]
    fixed = [subset[0] for subset in subsets if len(subset) == 1]
    dependent = fixed or subsets[0]
    together = ", ".join(rows[row] for row in dependent)
    problem = f"no joint changes {together} of the tool"
    left_out = fixed
    stated = f"[{', '.join(rows)}]"
    if not fixed:
        robot = task_map.robot
        sizes = np.abs(jacobians[:, list(dependent)]).max(axis=(0, 1))
        joints = [robot.joint_names[i] for i in np.flatnonzero(sizes > _REGULAR)]
        problem = f"{together} of the tool depend on each other and cannot be prescribed together"
        left_out = [dependent[-1]]
        stated += f", where {together} are moved by {', '.join(joints)}"
    remaining = [name for row, name in enumerate(rows) if row not in left_out]
    is_usual = bool(remaining) and not {*remaining} & {*TURN_ROWS}
    raise InputError(
        problem,
        where="task_space",
        found=stated,
        allowed=f"[{', '.join(remaining)}]" if is_usual else None,
        hint=None if is_usual else _TURNS_ALONE,
    )


def _least_singular_values(jacobians: np.ndarray) -> np.ndarray:
    """Return the smallest singular values, (K,), of Jacobians, (K, m, n)."""
    return np.asarray(np.linalg.svd(jacobians, compute_uv=False)[:, -1])


def branch_of(task_map: TaskMap, match: Match, posture: np.ndarray, key: str) -> int:
    """Return the index of the closed form's branch that contains a start or end posture; `key` is its task key.

    Raises
    ------
    StartError
        Branches of the closed form meet at the posture.
    """
    robot = task_map.robot
    solver = match.solver
    redundant = [robot.joint_names.index(joint) for joint in match.redundant_joints]
    non_redundant = complement(robot.n, redundant)
    target = task_map.value(posture)
    answers = solver.solve(target[None], posture[None, redundant])[0]
    gap = difference(answers, posture[non_redundant], robot.revolute[non_redundant])
    gaps = np.nan_to_num(np.abs(gap).max(axis=2), nan=np.inf).min(axis=1)
    branch = int(np.argmin(gaps))
    margins = solver.branch_margins(posture[None], branch)[0]
    if gaps[branch] > tolerances.POSTURE or np.any(margins <= tolerances.ANGLE):
        raise StartError(
            f"the posture is singular for redundant joints [{', '.join(match.redundant_joints)}]",
            where=key,
            found="a posture where branches of the closed form meet",
            allowed="a posture inside a branch",
            hint="Bend the arm a little, or choose other redundant joints",
        )
    return branch
