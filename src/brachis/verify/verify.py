"""Re-checks a trajectory on a dense grid with Pinocchio, sharing no code with the optimiser.

Position errors come from forward kinematics of the saved joint polynomials against the path at the saved s(t), torques
from Pinocchio's rnea and the friction formula written out again, velocities and accelerations from differentiating the
polynomials. What is judged is the file that a controller would execute, not the optimiser's idea of it.
"""

from __future__ import annotations

import numpy as np

from brachis.errors import InputError
from brachis.path import Path, path_of
from brachis.robot import Robot, TaskSpace, bind
from brachis.trajectory import Trajectory
from brachis.verify.checks import continuity_checks, end_checks, progress_checks, spline_checks
from brachis.verify.mechanics import torques
from brachis.verify.options import VerifyOptions
from brachis.verify.report import Check, Verification

_BISECTIONS = 50


def verify_trajectory(
    trajectory: Trajectory, options: VerifyOptions | None = None, *, robot: Robot | None = None
) -> Verification:
    """Check path, limits, progress, start and end, splines, and continuity of a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
    options : VerifyOptions, optional
    robot : Robot, optional
        Check against this robot and not the saved one, for example a newer URDF; its joints must have the same names
        in the same order.

    Returns
    -------
    Verification
        Pass or fail is in it; nothing is raised for a trajectory that fails.

    Raises
    ------
    InputError
        `robot` has other joints than the trajectory; or the trajectory's task does not fit the robot: its postures
        (`InputError`, `StartError`), task space (`InputError`) or path (`PathError`).
    """
    options = options or VerifyOptions()
    robot, task_space = bind(trajectory.robot if robot is None else robot, trajectory.task.task_space)
    if robot.joint_names != trajectory.joint_names:
        raise InputError(
            "the robot has other joints than the trajectory",
            where="robot",
            found=", ".join(robot.joint_names),
            allowed=", ".join(trajectory.joint_names),
        )
    breaks = np.unique(trajectory.knots) * trajectory.t_end
    steps = (np.arange(options.points_per_interval) + 0.5) / options.points_per_interval  # between the nodes
    grid = (breaks[:-1, None] + np.diff(breaks)[:, None] * steps).ravel()
    path = path_of(robot, task_space, trajectory.task)
    t = np.unique(np.concatenate([grid, trajectory.times, _times_within_pieces(trajectory, path.breaks, options)]))
    q, qdot, qddot = trajectory.position(t), trajectory.velocity(t), trajectory.acceleration(t)
    # Splines of degree 2 jump in acceleration at knots: there both sides are looked at.
    jumps = np.any(trajectory.qddot_before != trajectory.qddot, axis=1)
    t = np.concatenate([t, trajectory.times[jumps]])
    q, qdot = np.concatenate([q, trajectory.q[jumps]]), np.concatenate([qdot, trajectory.qdot[jumps]])
    qddot = np.concatenate([qddot, trajectory.qddot_before[jumps]])
    tau = torques(robot, q, qdot, qddot)
    path_check = _path_error(trajectory, robot, path, task_space, t, q, options)
    limits = _limit_checks(robot, t, q, qdot, qddot, tau, options)
    checks = [
        path_check,
        *limits,
        *progress_checks(trajectory, t, options),
        *end_checks(trajectory, robot, options),
        *spline_checks(trajectory, robot, options),
        *continuity_checks(trajectory, robot, options),
    ]
    worst = max((check.value for check in limits), default=0.0)
    return Verification(tuple(checks), len(t), worst, path_check.value)


def _times_within_pieces(trajectory: Trajectory, breaks: np.ndarray, options: VerifyOptions) -> np.ndarray:
    """Spread times over every piece of the path, however short: a small blend is not stepped over."""
    parts = np.linspace(0.0, 1.0, options.points_per_interval)
    wanted = (breaks[:-1, None] + np.diff(breaks)[:, None] * parts).ravel()
    low, high = np.zeros_like(wanted), np.full_like(wanted, trajectory.t_end)
    for _ in range(_BISECTIONS):  # s(t) does not decrease
        middle = 0.5 * (low + high)
        before = trajectory.path_spline(middle) < wanted
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return 0.5 * (low + high)


def _path_error(
    trajectory: Trajectory,
    robot: Robot,
    path: Path,
    task_space: TaskSpace,
    t: np.ndarray,
    q: np.ndarray,
    options: VerifyOptions,
) -> Check:
    """Largest distance of the tool from the path at the saved s(t)."""
    targets = path.sample(np.clip(trajectory.path_spline(t), 0.0, 1.0)).target
    miss = task_space.difference(task_space.values(*robot.tool_placements(q)), targets)
    positions = len(task_space.axes)
    errors = np.maximum(np.linalg.norm(miss[:, :positions], axis=1), np.linalg.norm(miss[:, positions:], axis=1))
    worst = int(np.argmax(errors))
    tolerance = options.path_tolerance
    return Check(
        "path error", float(errors[worst]), tolerance, "m, rad", bool(errors[worst] <= tolerance), time=float(t[worst])
    )


def _limit_checks(
    robot: Robot,
    t: np.ndarray,
    q: np.ndarray,
    qdot: np.ndarray,
    qddot: np.ndarray,
    tau: np.ndarray,
    options: VerifyOptions,
) -> list[Check]:
    """Worst ratio to every kind of limit that the robot has."""
    limits = robot.limits
    tables = {
        "torque": np.abs(tau) / limits.torque,
        "velocity": np.abs(qdot) / limits.velocity,
        "acceleration": np.abs(qddot) / limits.acceleration,
    }
    with np.errstate(invalid="ignore"):
        half = 0.5 * (limits.position_upper - limits.position_lower)
        middle = limits.position_lower + half
    closed = np.isfinite(half)
    tables["position"] = np.abs(q - np.where(closed, middle, 0.0)) / half
    one_sided = ~closed & (np.isfinite(limits.position_lower) | np.isfinite(limits.position_upper))
    beyond = np.maximum(limits.position_lower - q, q - limits.position_upper)
    tables["position"] = np.where(one_sided, 1.0 + beyond, tables["position"])
    limited = {
        "torque": np.isfinite(limits.torque).any(),
        "velocity": np.isfinite(limits.velocity).any(),
        "acceleration": np.isfinite(limits.acceleration).any(),
        "position": (closed | one_sided).any(),
    }
    checks = []
    for name, table in tables.items():
        if not limited[name]:
            continue
        k, joint = np.unravel_index(np.argmax(table), table.shape)
        value = float(table[k, joint])
        allowed = 1.0 + options.ratio_tolerance
        passed = bool(value <= allowed)
        checks.append(Check(f"{name} ratio", value, allowed, "-", passed, robot.joint_names[joint], float(t[k])))
    return checks
