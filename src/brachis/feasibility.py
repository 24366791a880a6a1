"""What makes a task impossible, and where: start and end posture, branch, reach, torque against gravity."""

from __future__ import annotations

import numpy as np

from brachis.errors import BrachisError, PathError, StartError, UnknownNameError
from brachis.ik import Match
from brachis.kinematics import Decomposition
from brachis.path import Path
from brachis.robot import Robot, TaskSpace, dynamics

_RANGE_SLACK = 1e-9
_ON_PATH = 1e-6
_SEARCHED = 400
_STATIONS = 101


def check_start(robot: Robot, start: np.ndarray, end: np.ndarray | None, path: Path, task_space: TaskSpace) -> None:
    """Refuse start and end postures out of range, off the path, or too heavy to hold.

    Raises
    ------
    StartError
    """
    for name, posture, s in (("start", start, 0.0), ("end", end, 1.0)):
        if posture is None:
            continue
        _check_range(robot, posture, name)
        _check_holding(robot, posture, name)
        target = path.sample(np.array([s])).target[0]
        miss = task_space.difference(task_space.value(robot.tool_placement(posture)), target)
        if np.abs(miss).max() > _ON_PATH:
            worst = int(np.argmax(np.abs(miss)))
            raise StartError(
                f"the {name} posture is off the path",
                where=f"{name}.joints",
                found=f"{abs(miss[worst]):.3g} {task_space.units[worst]} off in {task_space.rows[worst]}",
                allowed=f"at most {_ON_PATH:g}",
                hint="Choose a posture whose tool is on the path, or leave end: free",
            )


def _check_range(robot: Robot, posture: np.ndarray, name: str) -> None:
    lower, upper = robot.limits.position_lower, robot.limits.position_upper
    for joint, value, low, high, unit in zip(
        robot.joint_names, posture, lower, upper, robot.position_units, strict=True
    ):
        if not low - _RANGE_SLACK <= value <= high + _RANGE_SLACK:
            raise StartError(
                f"joint {joint!r} is out of its range",
                where=f"{name}.joints",
                found=f"{value:.6g} {unit}",
                allowed=f"{low:.6g} {unit} to {high:.6g} {unit}",
                hint=f"Change the posture, or the range with robot.limits.position.{joint}",
            )


def _check_holding(robot: Robot, posture: np.ndarray, name: str) -> None:
    still = np.zeros((1, robot.n))
    tau = dynamics.torque(robot, posture[None], still, still)[0]
    for joint, value, limit, unit in zip(
        robot.joint_names, tau, robot.limits.torque, robot.position_units, strict=True
    ):
        if abs(value) > limit:
            nm = "Nm" if unit == "rad" else "N"
            raise StartError(
                f"joint {joint!r} cannot hold the arm against gravity",
                where=f"{name}.joints",
                found=f"{abs(value):.4g} {nm} needed at rest",
                allowed=f"{limit:.4g} {nm}",
                hint=f"Raise robot.limits.torque.{joint}, or choose another posture",
            )


def start_branch(robot: Robot, task_space: TaskSpace, candidate: Match, start: np.ndarray, wanted: str | None) -> int:
    """Index of the closed form's branch on which the start posture lies.

    Raises
    ------
    StartError
        The start posture lies on no branch's inside, or on another than the `wanted` one.
    UnknownNameError
        There is no branch of the wanted name.
    """
    solver = candidate.solver
    if wanted is not None and wanted not in solver.branches:
        raise UnknownNameError("branch", wanted, solver.branches, where="branch")
    redundant = [robot.joint_names.index(name) for name in candidate.redundant_joints]
    rest = [i for i in range(robot.n) if i not in redundant]
    target = task_space.value(robot.tool_placement(start))
    answers = solver.solve(target[None], start[None, redundant])[0]
    units = np.array(robot.position_units)[rest]
    gap = answers - start[rest]
    gap = np.where(units == "rad", np.remainder(gap + np.pi, 2.0 * np.pi) - np.pi, gap)
    gaps = np.where(np.isfinite(gap).all(axis=1), np.abs(gap).max(axis=1), np.inf)
    branch = int(np.argmin(gaps))
    margins = solver.branch_margins(start[None], branch)[0]
    if gaps[branch] > 1e-5 or np.any(margins <= 0.0):  # noqa: PLR2004
        raise StartError(
            f"the start posture is singular for redundant joints [{', '.join(candidate.redundant_joints)}]",
            where="start.joints",
            found="a posture where branches of the closed form meet",
            allowed="a posture inside a branch",
            hint="Bend the arm a little, or choose other redundant joints",
        )
    if wanted is not None and solver.branches[branch] != wanted:
        raise StartError(
            "the start posture is on another branch",
            where="branch",
            found=solver.branches[branch],
            allowed=wanted,
            hint="Leave branch out, or start in a posture of that branch",
        )
    return branch


def explain_failure(decomposition: Decomposition) -> BrachisError | str:
    """Why no motion was found: an error where the path is out of reach or too heavy to hold, else advice.

    Redundant joints are searched at random at stations along the path, so "out of reach" means that none of many
    postures reaches the target.
    """
    s = np.linspace(0.0, 1.0, _STATIONS)
    answers = _postures_along(decomposition, s)
    reached = np.isfinite(answers).all(axis=3)
    anyhow = reached.any(axis=(1, 2))
    if not anyhow.all():
        first = float(s[int(np.argmin(anyhow))])
        return PathError(
            f"the path is out of reach from s = {first:.3g} on",
            s_interval=(first, float(s[np.flatnonzero(~anyhow)[-1]])),
            hint="Shorten or move the path, or widen the joint ranges",
        )
    own = reached[:, :, decomposition.branch].any(axis=1)
    if not own.all():
        first = float(s[int(np.argmin(own))])
        label = decomposition.solver.branches[decomposition.branch]
        return PathError(
            f"the branch {label!r} of the start posture does not reach beyond s = {first:.3g}",
            s_interval=(first, float(s[np.flatnonzero(~own)[-1]])),
            hint="Start in a posture of another branch, or choose other redundant joints",
        )
    held = _held(decomposition, answers[:, :, decomposition.branch], reached[:, :, decomposition.branch])
    if not held.all():
        first = float(s[int(np.argmin(held))])
        return PathError(
            f"the torque limits cannot hold the arm against gravity from s = {first:.3g} on",
            s_interval=(first, float(s[np.flatnonzero(~held)[-1]])),
            hint="Raise robot.limits.torque, or choose other redundant joints",
        )
    return (
        "Every point of the path is within reach of this branch, but no course along it was found; "
        "try other redundant joints, another start posture, or more intervals"
    )


def _postures_along(decomposition: Decomposition, s: np.ndarray) -> np.ndarray:
    """All postures that reach stations s with random redundant joints: (S, tries, B, n), NaN where none does."""
    robot, redundant, rest = decomposition.robot, decomposition.redundant, decomposition.rest
    lower, upper = robot.limits.position_lower, robot.limits.position_upper
    turning = np.array([unit == "rad" for unit in robot.position_units])
    low = np.where(np.isfinite(lower), lower, np.where(turning, -np.pi, decomposition.start - 10.0))
    high = np.where(np.isfinite(upper), upper, np.where(turning, np.pi, decomposition.start + 10.0))
    tries = _SEARCHED if redundant else 1
    q_r = np.random.default_rng(0).uniform(low[redundant], high[redundant], (tries, len(redundant)))
    targets = decomposition.path.sample(s).target
    answers = decomposition.solver.solve(np.repeat(targets, tries, axis=0), np.tile(q_r, (len(s), 1)))
    branches = answers.shape[1]
    postures = np.empty((len(s), tries, branches, robot.n))
    postures[..., redundant] = q_r[None, :, None]
    postures[..., rest] = answers.reshape(len(s), tries, branches, -1)
    middle = 0.5 * (low + high)
    lifted = np.where(turning, postures - 2.0 * np.pi * np.round((postures - middle) / (2.0 * np.pi)), postures)
    inside = np.all((lifted >= lower - _RANGE_SLACK) & (lifted <= upper + _RANGE_SLACK), axis=-1, keepdims=True)
    return np.where(inside, lifted, np.nan)


def _held(decomposition: Decomposition, postures: np.ndarray, reached: np.ndarray) -> np.ndarray:
    """At which stations some posture is held by the torque limits, (S,) bool."""
    robot = decomposition.robot
    held = np.zeros(len(postures), dtype=bool)
    for station, (choices, exist) in enumerate(zip(postures, reached, strict=True)):
        q = choices[exist][:60]
        still = np.zeros_like(q)
        tau = np.abs(dynamics.torque(robot, q, still, still))
        held[station] = bool(np.any(np.all(tau <= robot.limits.torque, axis=1)))
    return held
