"""What is checked besides the path and the limits: progress, ends, splines and continuity."""

from __future__ import annotations

import numpy as np

from brachis.path import Path
from brachis.robot import Robot, TaskMap
from brachis.robot.units import UNITS
from brachis.trajectory import CONTINUOUS_TORQUE, Trajectory
from brachis.verify.motion import Pieces, States
from brachis.verify.options import VerifyOptions
from brachis.verify.report import Check

_ROUNDING = 1e-6
"""m or rad by which a task's postures may be off its path, since they are written with so many digits."""


def progress_checks(trajectory: Trajectory, t: np.ndarray, options: VerifyOptions) -> list[Check]:
    """Check that the path is travelled once, forwards, from its beginning to its end.

    ds/dt is looked at where it is smallest: at the times t, (K,), at knots, and where its derivative vanishes.
    """
    from scipy.interpolate import PPoly  # noqa: PLC0415  (imports in 0.3 s)

    spline, allowed = trajectory.path_spline, options.progress_tolerance
    turning = PPoly.from_spline(spline.derivative(2).tck).roots(discontinuity=True, extrapolate=False)
    times = np.concatenate([t, np.unique(spline.t), turning[np.isfinite(turning)]])
    velocity = spline(times, nu=1)
    backwards = float(np.maximum(0.0, -velocity).max())
    ends = float(np.abs([spline(0.0), spline(trajectory.t_end) - 1.0]).max())
    time = float(times[int(np.argmin(velocity))]) if backwards else None
    return [
        Check("ds/dt below zero", backwards, allowed, "1/s", backwards <= allowed, time=time),
        Check("s at the ends", ends, allowed, "-", ends <= allowed),
    ]


def end_checks(
    trajectory: Trajectory, robot: Robot, task_map: TaskMap, path: Path, options: VerifyOptions
) -> list[Check]:
    """Check that the motion begins and ends as the task says."""
    task, boundary = trajectory.task, trajectory.task.boundary
    checks = []
    wanted = {
        "start": (0.0, task.start, boundary.start_speed),
        "end": (trajectory.t_end, task.end, boundary.end_speed),
    }
    for name, (time, posture, given_speed) in wanted.items():
        if posture != "free":
            given = robot.posture(posture.joints, f"{name}.joints")
            place = path.sample(np.array([time / trajectory.t_end])).target
            miss = np.abs(trajectory.position(time) - _on_path(given, task_map, place))
            checks.append(_worst_joint(f"{name} posture", miss, options.posture_tolerance, "position", robot, time))
        if boundary.periodic:
            continue
        if given_speed:
            checks += _moving_end(name, trajectory, task_map, path, given_speed, time, options)
            continue
        speed, allowed = np.abs(trajectory.velocity(time)), options.rest_velocity_tolerance
        checks.append(_worst_joint(f"{name} velocity", speed, allowed, "velocity", robot, time))
        if task.spline.vanishing > 1:
            bend, allowed = np.abs(trajectory.acceleration(time)), options.rest_acceleration_tolerance
            checks.append(_worst_joint(f"{name} acceleration", bend, allowed, "acceleration", robot, time))
        if task.spline.vanishing > 2:  # noqa: PLR2004  (jerk)
            jerk = np.abs(trajectory.jerk(time)) / (1.0 + np.abs(trajectory.jerk(trajectory.times)).max())
            checks.append(_worst_joint(f"{name} jerk", jerk, options.rest_jerk_tolerance, "relative", robot, time))
    return checks


def _moving_end(
    name: str,
    trajectory: Trajectory,
    task_map: TaskMap,
    path: Path,
    wanted: float,
    time: float,
    options: VerifyOptions,
) -> list[Check]:
    """Check that an end is passed at the speed that the task asks for, which is constant there with full rest."""
    q, qdot = trajectory.position(time)[None], trajectory.velocity(time)
    position, angle = task_map.norms(task_map.jacobian(task_map.twists(q))[0] @ qdot)
    moves = float(task_map.norms(path.sample(trajectory.path_spline([time])).xi)[0][0]) > _ROUNDING
    off, allowed = abs(float(position if moves else angle) - wanted), options.rest_velocity_tolerance * (1.0 + wanted)
    unit = "m/s" if moves else "rad/s"
    checks = [Check(f"{name} speed", off, allowed, unit, off <= allowed, time=time)]
    if trajectory.task.spline.vanishing > 1:
        rate, bend = (abs(float(trajectory.path_spline(time, nu=order))) for order in (1, 2))
        change, allowed = wanted * bend / rate if rate else np.inf, options.rest_acceleration_tolerance
        checks.append(
            Check(f"{name} acceleration along the path", change, allowed, f"{unit}^2", change <= allowed, time=time)
        )
    return checks


def seam_checks(trajectory: Trajectory, pieces: Pieces, robot: Robot, options: VerifyOptions) -> list[Check]:
    """Check that a periodic motion goes on where it ends as it begins."""
    if not trajectory.task.boundary.periodic:
        return []
    last = len(pieces.lengths) - 1
    before = States.at(pieces, robot, np.array([last]), np.ones(1))
    after = States.at(pieces, robot, np.array([0]), np.zeros(1))
    return _jumps(before, after, " over the seam", trajectory.degree, options)


def _on_path(given: np.ndarray, task_map: TaskMap, place: np.ndarray) -> np.ndarray:
    """Return the posture nearest to a given one, (n,), whose tool is at a place, (1, c), that it misses by rounding."""
    miss = task_map.difference(place, task_map.values(given[None]))[0]
    if np.abs(miss).max(initial=0.0) > _ROUNDING:
        return given
    jacobian = task_map.jacobian(task_map.twists(given[None]))[0]
    return np.asarray(given + np.linalg.lstsq(jacobian, miss, rcond=None)[0])


def spline_checks(trajectory: Trajectory, robot: Robot, states: States, options: VerifyOptions) -> list[Check]:
    """Check that the splines of the redundant joints are their motion."""
    if not trajectory.redundant_joints:
        return []
    joints = [robot.joint_names.index(name) for name in trajectory.redundant_joints]
    misses = np.zeros_like(states.q)
    misses[:, joints] = np.abs(trajectory.redundant_spline(states.t) - states.q[:, joints])
    worst = int(np.argmax(misses.max(axis=1)))
    time = float(states.t[worst])
    allowed = options.spline_tolerance
    return [_worst_joint("redundant joints' splines", misses[worst], allowed, "position", robot, time)]


def continuity_checks(trajectory: Trajectory, pieces: Pieces, robot: Robot, options: VerifyOptions) -> list[Check]:
    """Jumps of position, velocity, acceleration and torque where polynomial pieces join, relative to their size."""
    behind = np.arange(1, len(pieces.lengths))
    before = States.at(pieces, robot, behind - 1, np.ones(len(behind)))
    after = States.at(pieces, robot, behind, np.zeros(len(behind)))
    return _jumps(before, after, " jump", trajectory.degree, options)


def _jumps(before: States, after: States, what: str, degree: int, options: VerifyOptions) -> list[Check]:
    """Compare the states on both sides of places."""
    names = {"position": "q", "velocity": "qdot", "acceleration": "qddot", "torque": "tau"}
    if degree < CONTINUOUS_TORQUE:  # the asked degree has them jump
        del names["acceleration"], names["torque"]
    checks, allowed = [], options.jump_tolerance
    for name, part in names.items():
        left, right = getattr(before, part), getattr(after, part)
        scale = 1.0 + np.abs(left).max(initial=0.0)
        jumps = np.abs(right - left).max(axis=1, initial=0.0) / scale
        value = float(jumps.max(initial=0.0))
        time = float(after.t[int(np.argmax(jumps))]) if len(jumps) else None
        checks.append(Check(f"{name}{what}", value, allowed, "relative", value <= allowed, time=time))
    return checks


def _worst_joint(name: str, misses: np.ndarray, allowed: float, kind: str, robot: Robot, time: float) -> Check:
    """Make a check of the joint that misses most; `kind` is a key of `UNITS`, or the unit of all joints."""
    joint = int(np.argmax(misses))
    unit = UNITS[kind][robot.position_units[joint]] if kind in UNITS else kind
    value = float(misses[joint])
    return Check(name, value, allowed, unit, value <= allowed, robot.joint_names[joint], time)
