"""Re-checks a trajectory on a dense grid with Pinocchio, sharing no code with the optimiser.

Position errors come from forward kinematics of the saved joint polynomials against the path at the saved s(t), torques
from Pinocchio's rnea and the friction formula written out again, velocities and accelerations from differentiating the
polynomials. What is judged is the file that a controller would execute, not the optimiser's idea of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from brachis.path import build_path
from brachis.robot import Robot, TaskSpace
from brachis.trajectory import CONTINUOUS_TORQUE, Trajectory
from brachis.verify.report import Check, Verification

_JUMP = 1e-6


@dataclass(frozen=True)
class VerifyOptions:
    """What passes.

    Attributes
    ----------
    ratio_tolerance : float
        Largest excess over a limit, as a fraction of it.
    path_tolerance : float
        m or rad.
    points_per_interval : int
        Grid points per knot interval of the splines.
    """

    ratio_tolerance: float = 1e-4
    path_tolerance: float = 1e-9
    points_per_interval: int = 32


def verify_trajectory(
    trajectory: Trajectory, options: VerifyOptions | None = None, *, robot: Robot | None = None
) -> Verification:
    """Check path, limits, start and end, and continuity of a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
    options : VerifyOptions, optional
    robot : Robot, optional
        Check against this robot and not the saved one, for example a newer URDF.

    Returns
    -------
    Verification
        Pass or fail is in it; nothing is raised for a trajectory that fails.
    """
    options = options or VerifyOptions()
    robot = robot or trajectory.robot
    breaks = np.unique(trajectory.knots) * trajectory.t_end
    steps = (np.arange(options.points_per_interval) + 0.5) / options.points_per_interval  # between the nodes
    grid = (breaks[:-1, None] + np.diff(breaks)[:, None] * steps).ravel()
    t = np.union1d(grid, trajectory.times)
    q, qdot, qddot = (np.asarray(trajectory.pieces(t, nu=order)) for order in range(3))
    tau = _torques(robot, q, qdot, qddot)
    path_check = _path_error(trajectory, robot, t, q, options)
    limits = _limit_checks(robot, t, q, qdot, qddot, tau, options)
    checks = [
        path_check,
        *limits,
        *_progress_checks(trajectory, t),
        *_end_checks(trajectory, robot),
        *_continuity_checks(trajectory, robot),
    ]
    worst = max((check.value for check in limits), default=0.0)
    return Verification(tuple(checks), len(t), worst, path_check.value)


def _torques(robot: Robot, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> np.ndarray:
    """Joint torques (K, n): rnea, armature, viscous and Coulomb friction."""
    data = robot.model.createData()
    rigid = np.empty_like(q)
    for k in range(len(q)):
        rigid[k] = pin.rnea(robot.model, data, q[k], qdot[k], qddot[k])
    f = robot.friction
    return rigid + f.armature * qddot + f.viscous * qdot + f.coulomb * np.tanh(qdot / f.v_eps)


def _tool_placements(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (K, 3) and rotations (K, 3, 3) of the tool frame by forward kinematics."""
    data, frame = robot.model.createData(), robot.frame_id
    positions, rotations = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for k, posture in enumerate(q):
        pin.forwardKinematics(robot.model, data, posture)
        placement = pin.updateFramePlacement(robot.model, data, frame)
        positions[k], rotations[k] = placement.translation, placement.rotation
    return positions, rotations


def _path_error(trajectory: Trajectory, robot: Robot, t: np.ndarray, q: np.ndarray, options: VerifyOptions) -> Check:
    """Largest distance of the tool from the path at the saved s(t)."""
    task_space = TaskSpace.of(robot, trajectory.task.task_space)
    start = robot.posture(trajectory.task.start.joints, "start.joints")
    path = build_path(trajectory.task.path, task_space.value(robot.tool_placement(start)), task_space.rows)
    targets = path.sample(np.clip(trajectory.path_spline(t), 0.0, 1.0)).target
    miss = task_space.values(*_tool_placements(robot, q)) - targets
    positions = len(task_space.axes)
    angles = np.abs(np.remainder(miss[:, positions:] + np.pi, 2.0 * np.pi) - np.pi)
    errors = np.maximum(np.linalg.norm(miss[:, :positions], axis=1), angles.max(axis=1, initial=0.0))
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


def _progress_checks(trajectory: Trajectory, t: np.ndarray) -> list[Check]:
    """Check that the path is travelled once, forwards, from its beginning to its end."""
    spline = trajectory.path_spline
    backwards = float(max(0.0, -spline(t, nu=1).min()))
    ends = float(max(abs(spline(0.0)), abs(spline(trajectory.t_end) - 1.0)))
    return [
        Check("ds/dt below zero", backwards, 1e-9, "1/s", backwards <= 1e-9),  # noqa: PLR2004
        Check("s at the ends", ends, 1e-9, "-", ends <= 1e-9),  # noqa: PLR2004
    ]


def _end_checks(trajectory: Trajectory, robot: Robot) -> list[Check]:
    """Check that the motion begins and ends as the task says."""
    task = trajectory.task
    pieces, t_end = trajectory.pieces, trajectory.t_end
    checks = []
    wanted = {"start": (0.0, task.start), "end": (t_end, None if task.end == "free" else task.end)}
    for name, (time, posture) in wanted.items():
        if posture is not None:
            miss = np.abs(pieces(time) - robot.posture(posture.joints, f"{name}.joints"))
            checks.append(_worst_joint(f"{name} posture", miss, 1e-9, "rad, m", robot, time))
        checks.append(_worst_joint(f"{name} velocity", np.abs(pieces(time, nu=1)), 1e-8, "rad/s, m/s", robot, time))
        if task.spline.rest == "full":
            still = np.abs(pieces(time, nu=2))
            checks.append(_worst_joint(f"{name} acceleration", still, 1e-6, "rad/s2, m/s2", robot, time))
    return checks


def _continuity_checks(trajectory: Trajectory, robot: Robot) -> list[Check]:
    """Jumps of position, velocity, acceleration and torque where polynomial pieces join, relative to their size."""
    inner = trajectory.times[1:-1]
    pieces = trajectory.pieces
    left = [_one_sided(pieces.c, np.diff(trajectory.times), order, at_end=True)[:-1] for order in range(3)]
    right = [_one_sided(pieces.c, np.diff(trajectory.times), order, at_end=False)[1:] for order in range(3)]
    sides = {
        name: (before, after)
        for name, before, after in zip(("position", "velocity", "acceleration"), left, right, strict=True)
    }
    sides["torque"] = (_torques(robot, *left), _torques(robot, *right))
    if trajectory.degree < CONTINUOUS_TORQUE:  # the asked degree has them jump
        del sides["acceleration"], sides["torque"]
    checks = []
    for name, (before, after) in sides.items():
        scale = 1.0 + np.abs(before).max(initial=0.0)
        jumps = np.abs(after - before).max(axis=1, initial=0.0) / scale
        value = float(jumps.max(initial=0.0))
        time = float(inner[int(np.argmax(jumps))]) if len(jumps) else None
        checks.append(Check(f"{name} jump", value, _JUMP, "relative", value <= _JUMP, time=time))
    return checks


def _one_sided(c: np.ndarray, lengths: np.ndarray, order: int, *, at_end: bool) -> np.ndarray:
    """Differentiate Bernstein pieces c (6, L, n) at one end of every piece, (L, n)."""
    degree = len(c) - 1
    differences = np.diff(c, n=order, axis=0)
    factor = np.prod(np.arange(degree, degree - order, -1)) / lengths**order
    return differences[-1 if at_end else 0] * factor[:, None]


def _worst_joint(name: str, misses: np.ndarray, allowed: float, unit: str, robot: Robot, time: float) -> Check:
    joint = int(np.argmax(misses))
    return Check(
        name, float(misses[joint]), allowed, unit, bool(misses[joint] <= allowed), robot.joint_names[joint], time
    )
