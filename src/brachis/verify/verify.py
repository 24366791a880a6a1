"""Verification of a trajectory on a dense grid, which shares no code with the optimiser.

Tool positions come from the saved joint polynomials and the kinematics of the URDF, and are compared with the path at
the saved s(t). Torques come from Newton's and Euler's equations and from the friction formula, both implemented
separately. Velocities and accelerations are derivatives of the polynomials. This verifies the motion that a controller
would execute, not the optimiser's internal model of the motion.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import spread
from brachis.errors import BrachisWarning, InputError
from brachis.path import path_of
from brachis.robot import Robot, bind
from brachis.robot.custom_limits import LimitModel
from brachis.robot.task_map import JointSpace, RowsAndAngle
from brachis.robot.urdf_bodies import turns_about
from brachis.trajectory import MotionSource, Trajectory, motion_of
from brachis.verify.checks import (
    check_continuity,
    check_ends,
    check_process_speed,
    check_progress,
    check_splines,
    check_stops,
)
from brachis.verify.limits import check_limits
from brachis.verify.limits.margins import find_margins
from brachis.verify.mechanics import tool_placements
from brachis.verify.motion import CheckedMotion
from brachis.verify.report import Check, Verification, VerifyOptions


def verify_trajectory(
    trajectory: MotionSource,
    options: VerifyOptions | None = None,
    *,
    robot: Robot | None = None,
    own_limits: Sequence[LimitModel] = (),
) -> Verification:
    """Check the path, limits, progress, stops, given speeds, ends, splines and continuity of a trajectory.

    Parameters
    ----------
    trajectory : Trajectory, Result or path
        The motion to verify, or the file of a result.
    options : VerifyOptions, optional
        Tolerances. By default, limits may be exceeded by the task's ``refinement.tolerance``.
    robot : Robot, optional
        Robot to use instead of the saved one, for example from a newer URDF. Its joints must have the same names in the
        same order. For a program, its differences from the saved robot hold in all parts.
    own_limits : sequence of LimitModel, optional
        The user's own limits with which the trajectory was planned, in addition to those that its task names.

    Returns
    -------
    Verification
        All checks, and whether the trajectory passed. A trajectory that fails raises no error.

    Raises
    ------
    InputError
        `robot` has different joints than the trajectory; or the postures (`InputError`, `StartError`), the task space
        (`InputError`) or the path (`PathError`) of the task do not fit the robot; or the motion would have to be
        checked at more than 2,000,000 instants.

    Warns
    -----
    BrachisWarning
        The motion was planned with one of the user's own limits that is not among `own_limits`.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> brachis.verify_trajectory(result.trajectory).passed
    True
    """
    trajectory = motion_of(trajectory)
    options = options or VerifyOptions(
        ratio_tolerance=trajectory.task.refinement.tolerance
    )
    task = trajectory.task
    robot = robot or trajectory.robot
    robot, task_map = bind(robot, task.task_space, task.tolerances)
    if robot.joint_names != trajectory.joint_names:
        raise InputError(
            "the joints of the robot are not those of the trajectory",
            where="robot",
            found=", ".join(robot.joint_names),
            allowed=", ".join(trajectory.joint_names),
        )
    motion = CheckedMotion(
        trajectory, robot, task_map, path_of(task_map, task), options
    )
    if trajectory.components:
        return _verify_program(motion, own_limits)
    # The motion is processed in parts, because the placements of all joints take up much memory.
    surveys = [
        (
            path_errors(motion, states.q, states.s, states.joints),
            find_margins(motion, states),
        )
        for states in motion.states.split()
    ]
    errors, margins = zip(*surveys, strict=True)
    path_check = _check_path(motion, np.concatenate(errors))
    ratios = check_limits(motion, own_limits)
    names = Counter(check.limit for check in ratios)
    left_out = Counter(trajectory.own_limits) - names
    if left_out:
        warnings.warn(
            f"some of your own limits are not checked: {', '.join(left_out)}; the motion was planned with them, but "
            "they are not saved with it. Pass them as brachis.verify_trajectory(motion, own_limits=[...])",
            BrachisWarning,
            stacklevel=2,
        )
    checks = [
        path_check,
        *ratios,
        *check_progress(motion),
        *check_stops(motion),
        *check_process_speed(motion),
        *check_ends(motion),
        *check_splines(motion),
        *check_continuity(motion),
    ]
    worst = max((check.value for check in ratios), default=0.0)
    least = (
        min(same, key=lambda margin: margin.value)
        for same in zip(*margins, strict=False)
    )
    return Verification(
        tuple(checks), len(motion.states.t), worst, path_check.value, tuple(least)
    )


def _verify_program(
    motion: CheckedMotion, own_limits: Sequence[LimitModel]
) -> Verification:
    """Verify the motion of a program: every component by itself, and the motion as a whole at their ends.

    Of each check of the components, the worst is returned, with the name of its part.
    """
    trajectory = motion.trajectory
    worst: dict[str, Check] = {}
    verified: list[Verification] = []
    for begin, component in trajectory.components:
        robot = _robot_of(component, motion)
        # The first component warns of limits that are not checked.
        checked = replace(component, own_limits=()) if verified else component
        part = verify_trajectory(
            checked, motion.options, robot=robot, own_limits=own_limits
        )
        verified.append(part)
        for check in part.checks:
            placed = place_in_program(trajectory, begin, check, component.t_end)
            _keep_worse(worst, placed)
    whole = [
        _check_components(motion),
        *check_progress(motion),
        *check_ends(motion),
        *check_continuity(motion),
    ]
    for check in (*whole, *_check_closure(motion)):
        _keep_worse(worst, check)
    return Verification(
        tuple(worst.values()),
        sum(part.points for part in verified),
        max(part.worst_ratio for part in verified),
        max(part.path_error for part in verified),
    )


def _keep_worse(worst: dict[str, Check], check: Check) -> None:
    """Put a check in place of the one with the same name, unless that is at least as bad; NaN is the worst."""
    before = worst.get(check.name)
    if before is None or not check.share <= before.share:
        worst[check.name] = check


def _robot_of(component: Trajectory, motion: CheckedMotion) -> Robot:
    """Return the robot for a component: its own, with the differences of the given robot from the saved one."""
    given = motion.robot
    saved = motion.trajectory.robot
    if given.settings == saved.settings and given.urdf == saved.urdf:
        return component.robot
    changes = {
        key: value
        for key, value in given.settings
        if value != getattr(saved.settings, key)
    }
    settings = component.robot.settings.model_copy(update=changes)
    return Robot.from_settings(settings, given.source, given.urdf)


def place_in_program(
    trajectory: Trajectory, begin: float, check: Check, duration: float = np.inf
) -> Check:
    """Return a check of a component that begins at a time, s, with its time in the whole motion and its part."""
    if not trajectory.parts:
        return check
    time = begin if check.time is None else begin + check.time
    # A time at which two parts of the component meet belongs to the later one.
    rounding = tolerances.TIME * trajectory.t_end
    last = min(time + rounding, begin + duration - rounding)
    names = (part.name for part in trajectory.parts if part.end > last)
    name = next(names, trajectory.parts[-1].name)
    subject = f"{check.subject}, {name}" if check.subject else name
    return replace(check, time=None if check.time is None else time, subject=subject)


def _check_components(motion: CheckedMotion) -> Check:
    """Check that the whole motion is that of its components, and at rest between them.

    Between the nodes, the positions also show whether the velocities are equal where components meet.
    """
    trajectory = motion.trajectory
    misses = []
    begins = [begin for begin, _ in trajectory.components[1:]]
    triples = zip(trajectory.components, [*begins, trajectory.t_end], strict=True)
    for (begin, part), next_begin in triples:
        times = spread(part.times, 4)
        joints = trajectory.position((begin + times).clip(max=trajectory.t_end))
        misses.append(np.abs(joints - part.position(times)[:, : joints.shape[1]]).max())
        waiting = np.linspace(min(begin + part.t_end, next_begin), next_begin, 5)
        misses.append(np.abs(trajectory.position(waiting) - joints[-1]).max())
    allowed = motion.options.posture_tolerance
    return Check("motion of the parts", max(misses), allowed, "rad, m")


def _check_closure(motion: CheckedMotion) -> list[Check]:
    """Check that a motion that closes ends in the posture in which it begins."""
    if motion.task.end != "start":
        return []
    first, last = motion.trajectory.q[[0, -1]]
    joint = int(np.argmax(np.abs(last - first)))
    allowed = motion.options.posture_tolerance
    miss = abs(last - first)[joint]
    subject = motion.robot.joint_names[joint]
    return [Check("closure", miss, allowed, "rad, m", subject)]


def path_errors(
    motion: CheckedMotion,
    q: np.ndarray,
    s: np.ndarray,
    joints: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return the larger of the distance, m, and the axis angle, rad, (K,), of the tool from the path at given s.

    Parameters
    ----------
    motion : CheckedMotion
    q : (K, n) ndarray
        Postures of the robot, rad or m.
    s : (K,) ndarray
    joints : tuple
        Result of `joint_placements` in these postures.
    """
    task_map = motion.task_map
    targets = motion.path.derivatives(np.clip(s, 0.0, 1.0), 0)[0]
    if isinstance(task_map, JointSpace):
        return np.linalg.norm(q - targets, axis=1)
    positions, rotations = tool_placements(motion.robot, q, joints)
    axes = list(task_map.axes)
    distances = np.linalg.norm(positions[:, axes] - targets[:, : len(axes)], axis=1)
    if not task_map.angles:
        return distances
    if isinstance(task_map, RowsAndAngle):
        # Compare in the plane, because the axes of URDFs with rounded figures are slightly tilted.
        axis = task_map.world_axis
        pointers = np.delete(rotations, axis, axis=1)[:, :, [task_map.tool_axis]]
        turned = turns_about(np.eye(3)[axis], targets[:, -1])
        axes_of_target = np.delete(turned, axis, axis=1)[:, :, [task_map.plane[0]]]
    else:
        pointers = rotations
        axes_of_target = targets[:, -9:].reshape(-1, 3, 3)
    chords = np.linalg.norm(pointers - axes_of_target, axis=1).max(axis=1)
    return np.maximum(distances, 2.0 * np.arcsin((0.5 * chords).clip(max=1.0)))


def _check_path(motion: CheckedMotion, errors: np.ndarray) -> Check:
    """Check the tool's largest distance, out of (K,), from the path at the saved s(t)."""
    worst = np.argmax(errors)
    tolerance = motion.options.path_tolerance
    remark = ""
    recovered = motion.trajectory.recovered
    if recovered is not None:
        tolerance = max(tolerance, recovered.tolerance)
        remark = "the path was recovered from the motion"
    error = errors[worst]
    time = motion.states.t[worst]
    return Check("path error", error, tolerance, "m, rad", time=time, remark=remark)
