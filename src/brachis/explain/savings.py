"""The time that the motion would save if the task demanded less: no wait, no stop, no rest, or another end posture.

The cost of a stop or of rest comes from timings of the same joint path. The cost of a posture comes from the optimum,
to first order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from brachis.common import tolerances
from brachis.explain.task_figures import OptimalMotion
from brachis.explain.timings import lay_course, least_time
from brachis.kinematics import Newton
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.phase import Phase
from brachis.path import path_speed
from brachis.problem.problem import Problem
from brachis.robot.task_map import JointSpace
from brachis.trajectory.sensitivities import Accuracy, TaskSaving

_PLACES = 400
"""Number of points at which the joint path of a phase is timed: the cost of a stop is then accurate to within 1 %."""
_RAMPS = (slice(3), slice(-3, None))
"""Breaks of the two intervals next to rest, in which an acceleration that must be zero at rest costs time. On 15
motions, the estimated savings were 40 to 129 % of the savings found by planning again, with a median of 95 %; with one
interval, the estimates were lower."""
_RANGE_SHARE = 1e-3
"""Fraction of a joint's range by which a posture is changed. On 20 tasks, the estimated saving was up to 12 % off, with
a median of 2 %. With a fraction of 1 %, it was 4 to 23 % off on six tasks, and entirely wrong on one task."""
_SHARE_OF_SPEED = 0.1
"""Fraction by which the speed at an end of the path is raised; if the tool rests there, a fraction of the mean
speed."""
_SELF_MOTION_STEP = 1e-5
"""Change of a posture by which a derivative is computed from differences, m or rad."""

PhasePoint = tuple[Phase, np.ndarray]
"""A phase and its variables."""


def task_savings(
    problem: Problem, motion: SolvedProgram, answer: OptimalMotion
) -> tuple[TaskSaving, ...]:
    """List the time that different demands would save, largest first; demands that save nothing are left out.

    Parameters
    ----------
    problem : Problem
    motion : SolvedProgram
        A solved program of the problem.
    answer : OptimalMotion
    """
    phase_points = motion.program.split(motion.x)
    savings = [
        *_list_dwells(problem),
        *_list_stops(problem, phase_points),
        *_list_ends(problem, answer),
        *_list_rest(problem, phase_points),
        *_list_postures(problem, answer),
    ]
    costly = (saving for saving in savings if saving.saved > 0.0)
    return tuple(sorted(costly, key=lambda saving: -saving.saved))


def _list_dwells(problem: Problem) -> Iterator[TaskSaving]:
    """List the duration of each wait in the task."""
    for leg in problem.legs:
        yield TaskSaving(f"without the dwell at s = {leg.end:.4g}", leg.dwell)


def _list_stops(
    problem: Problem, phase_points: list[PhasePoint]
) -> Iterator[TaskSaving]:
    """Compute a bound on the time that the motion would save along the same joint path without each of its stops."""
    for number, leg in enumerate(problem.legs[:-1]):
        if not leg.stops:
            continue
        sides = ((phase_points[number], -1), (phase_points[number + 1], 0))
        saved = 0.0
        for (phase, x), end in sides:
            course = lay_course(phase, x, _PLACES)
            saved += least_time(course) - least_time(course, end)
        words = "with a blend in place of" if _is_corner(problem, number) else "without"
        change = f"{words} the stop at s = {leg.end:.4g}"
        yield TaskSaving(change, saved, "bound")


def _list_ends(problem: Problem, answer: OptimalMotion) -> Iterator[TaskSaving]:
    """Derive the time that would be saved if the tool moved faster at the ends of the path, or slowly where it rests.

    In this estimate, the redundant joints stay at rest there, although a motion that passes an end may move them too.
    """
    boundary = problem.task.boundary
    if boundary.periodic:
        return
    for end, name in ((0, "start"), (-1, "end")):
        key = f"{name}_speed"
        speed = boundary.given_speeds[end]
        if bool(problem.end_rates[end] or boundary.speeds[end]) and not speed:
            continue
        length = path_speed(problem.task_map, problem.path, float(-end))
        mean = length / answer.program.end_time(answer.x)
        increase = _SHARE_OF_SPEED * (speed or mean)
        changed = boundary.model_copy(update={key: speed + answer.step * increase})
        task = problem.task.model_copy(update={"boundary": changed})
        saved = -answer.change(replace(problem, task=task)) / answer.step
        change = f"boundary.{key}: {speed + increase:.2g} in place of {speed:.2g}"
        accuracy: Accuracy = "least" if problem.r and not speed else "estimate"
        yield TaskSaving(change, saved, accuracy)


def _list_rest(
    problem: Problem, phase_points: list[PhasePoint]
) -> Iterator[TaskSaving]:
    """Estimate the time that the motion would save if its accelerations could jump where it is at rest."""
    spline = problem.task.spline
    order = max((limit.order for limit in problem.limits), default=0)
    if spline.vanishing == 1 or order > 2:  # limits on jerk need a smooth acceleration
        return
    saved = 0.0
    for phase, x in phase_points:
        for end, conditions in enumerate((phase.boundary.start, phase.boundary.end)):
            derivatives = conditions[0].derivatives
            if len(derivatives) > 1 and not derivatives.any():
                ramp = _RAMPS[end]
                duration = float(np.ptp(phase.motion(x).breaks[ramp]))
                course = lay_course(phase, x, _PLACES, ramp)
                saved += duration - least_time(course)
    change = f"spline.rest: velocity in place of {spline.rest}"
    yield TaskSaving(change, saved, "estimate")


def _list_postures(problem: Problem, answer: OptimalMotion) -> Iterator[TaskSaving]:
    """Derive the time that would be saved if a self-motion changed the given postures at the ends."""
    if problem.task.boundary.periodic or isinstance(problem.task_map, JointSpace):
        return
    robot = problem.robot
    limits = robot.limits
    widths = limits.position_upper - limits.position_lower
    widths = np.where(np.isfinite(widths), widths, 2.0 * np.pi)
    for name, posture in problem.given_postures.items():
        null = Newton(problem.task_map).self_motions(posture[None])[0]
        changes = [
            answer.change(replace(problem, **{name: moved}))
            for moved in posture + _SELF_MOTION_STEP * null.T
        ]
        slopes = np.array(changes) / _SELF_MOTION_STEP
        direction = -null @ slopes
        shares = np.abs(direction) / widths
        if not shares.any():
            continue
        joint_index = int(np.argmax(shares))
        length = _RANGE_SHARE / shares[joint_index]
        step = length * direction
        moved = posture + step
        inside = moved.clip(limits.position_lower, limits.position_upper)
        if (moved != inside).any():
            continue
        saved = float(length * (slopes @ slopes))
        amount = f"{abs(step[joint_index]):.3g} {robot.position_units[joint_index]}"
        if robot.position_units[joint_index] == "rad":
            amount += f" ({np.degrees(abs(step[joint_index])):.3g} deg)"
        side = "higher" if step[joint_index] > 0.0 else "lower"
        joint = robot.joint_names[joint_index]
        change = f"another {name} posture, with {joint} {amount} {side} and the tool in the same place,"
        yield TaskSaving(change, saved, "estimate")


def _is_corner(problem: Problem, number: int) -> bool:
    """Tell whether the path changes its direction where a leg ends."""
    s = np.array([problem.legs[number].end])
    tangents = [path.sample(s).xi[0] for path in problem.leg_paths[number:][:2]]
    before, after = (tangent / np.linalg.norm(tangent) for tangent in tangents)
    return bool(np.linalg.norm(before - after) > tolerances.ANGLE)
