"""All checks of the verification except those of the path and the limits.

This module checks progress, ends, stops and dwells, given speeds of the tool, splines, and continuity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from brachis.common import tolerances
from brachis.kernel import Spline, blossom
from brachis.path.legs import Leg
from brachis.robot import TaskMap
from brachis.robot.joints import TURN, UNITS
from brachis.task import FREE
from brachis.trajectory import CONTINUOUS_TORQUE, MotionPhase
from brachis.verify.limits.protocol import Worst, worst_between
from brachis.verify.limits.tool import tool_sizes
from brachis.verify.motion import CheckedMotion, MotionStates, turns
from brachis.verify.report import Check

_DWELL = 1e-9
"""Allowed deviation of a dwell from the requested time, due to rounding, s."""
_SPEED = 1e-6
"""Allowed relative deviation from a given speed, due to rounding and to interpolation between nodes."""
_RESOLUTION = 1e-3
"""Unit of the deviations passed to `worst_between`, which distinguishes values that differ by 5e-6 units."""


def check_progress(motion: CheckedMotion) -> list[Check]:
    """Check that the path is travelled once, forwards, from its beginning to its end.

    Between knots, ds/dt is a polynomial; it is checked at both ends and at its extrema.
    """
    trajectory = motion.trajectory
    allowed = motion.options.progress_tolerance
    spline = trajectory.path_spline.derivative
    breaks = np.unique(spline.knots)
    speeds = _bernstein_coefficients(spline, breaks)
    index, u, slowest = turns(speeds)
    velocity = np.concatenate([speeds[0], speeds[-1], slowest])
    turning = breaks[index] + u * np.diff(breaks)[index]
    times = np.concatenate([breaks[:-1], breaks[1:], turning])
    backwards = abs(np.minimum(0.0, velocity).min())
    time = times[np.argmin(velocity)] if backwards else None
    s = np.array([[phase.s_begin, phase.s_end] for phase in trajectory.phases])
    ends = np.abs([s[0, 0], s[-1, -1] - 1.0]).max()
    checks = [
        Check("ds/dt below zero", backwards, allowed, "1/s", time=time),
        Check("s at the ends", ends, allowed, "-"),
    ]
    if len(s) > 1:
        jumps = np.abs(s[1:, 0] - s[:-1, 1])
        worst = np.argmax(jumps)
        time = trajectory.phases[worst].end
        jump = jumps[worst]
        checks.append(Check("s where phases meet", jump, allowed, "-", time=time))
    return checks


def _bernstein_coefficients(spline: Spline, breaks: np.ndarray) -> np.ndarray:
    """Return Bernstein coefficients, (d + 1, F), of a spline's polynomials between its knots, (F + 1,)."""
    begins = breaks[:-1]
    ends = breaks[1:]
    index = np.searchsorted(spline.knots, begins, side="right") - 1
    points = spline.control_points[:, None]
    degree = spline.degree
    sides = ([begins] * (degree - i) + [ends] * i for i in range(degree + 1))
    return np.hstack([blossom(spline.knots, points, index, side) for side in sides]).T


def check_ends(motion: CheckedMotion) -> list[Check]:
    """Check that the motion begins and ends as the task requires."""
    task = motion.task
    boundary = task.boundary
    states = motion.states
    checks = []
    for name, number, s in (("start", 0, 0.0), ("end", -1, 1.0)):
        state = states.only([number])
        joints = task.joints_at(name)
        speed = boundary.speeds[number]
        if joints is not None:
            posture = motion.robot.posture(*joints)
            target = motion.path.sample(np.array([s])).target
            miss = state.q - _move_onto(posture, motion.task_map, target)
            allowed = motion.options.posture_tolerance
            title = f"{name} posture"
            checks.append(
                check_joints(motion, title, miss, state.t, "position", allowed)
            )
        if boundary.periodic or speed == FREE:
            continue
        if speed:
            checks += _check_speed(motion, name, float(speed), state)
        else:
            checks += check_rest(motion, f"{name} {{}}", state)
    return checks


def _check_speed(
    motion: CheckedMotion, name: str, task_speed: float, state: MotionStates
) -> list[Check]:
    """Check that an end is passed at the speed that the task requires, which with full rest must be constant there."""
    task_map = motion.task_map
    spline = motion.trajectory.path_spline
    time = state.t[0]
    jacobian = task_map.jacobian(task_map.twists(state.q))[0]
    position, angle = task_map.norms(jacobian @ state.qdot[0])
    per_s, _ = task_map.norms(motion.path.sample(state.s).xi)
    moves = per_s[0] > tolerances.WRITTEN
    unit = "m/s" if moves else "rad/s"
    off = abs(float(position if moves else angle) - task_speed)
    allowed = motion.options.rest_velocity_tolerance * (1.0 + task_speed)
    checks = [Check(f"{name} speed", off, allowed, unit, time=time)]
    if motion.task.spline.vanishing > 1:
        rate = abs(float(spline(time, nu=1)))
        bend = abs(float(spline(time, nu=2)))
        checks.append(
            Check(
                f"{name} acceleration along the path",
                task_speed * bend / rate if rate else np.inf,
                motion.options.rest_acceleration_tolerance,
                f"{unit}^2",
                time=time,
            )
        )
    return checks


def _move_onto(
    posture: np.ndarray, task_map: TaskMap, target: np.ndarray
) -> np.ndarray:
    """Return the posture closest to a given one, (n,), that has the tool at the target, (1, c)."""
    miss = task_map.difference(target, task_map.values(posture[None]))[0]
    if np.abs(miss).max(initial=0.0) > tolerances.WRITTEN:
        return posture
    jacobian = task_map.jacobian(task_map.twists(posture[None]))[0]
    return posture + np.linalg.lstsq(jacobian, miss, rcond=None)[0]


def check_stops(motion: CheckedMotion) -> list[Check]:
    """Check that a phase ends at every stop, and that the arm is at rest there for the requested time."""
    # The longest dwell comes first: of equally good ones, the first is named.
    stops = sorted(
        (leg for leg in motion.legs if leg.stops), key=lambda leg: -leg.dwell
    )
    if not stops:
        return []
    options = motion.options
    trajectory = motion.trajectory
    ends = np.array([phase.s_end for phase in trajectory.phases])
    misses = [np.abs(ends - leg.end).min() for leg in stops]
    dwells = [
        [phase for phase in _phases_up_to(motion, leg) if phase.is_dwell]
        for leg in stops
    ]
    waits = [sum(phase.duration for phase in phases) for phases in dwells]
    off = [abs(wait - leg.dwell) for wait, leg in zip(waits, stops, strict=True)]
    places = [
        (
            f"s = {leg.end:g}",
            min((phase.end for phase in _phases_up_to(motion, leg)), default=None),
        )
        for leg in stops
    ]
    checks = [
        _check_worst("s at stops", misses, options.progress_tolerance, "-", places),
        _check_worst("duration of dwells", off, _DWELL, "s", places),
    ]
    index, u = motion.pieces.place(times_of_stops(motion))
    before = index[(u == 0.0) & (index > 0)] - 1
    sides = (np.append(before, index), np.append(np.ones(len(before)), u))
    states = MotionStates.at(motion.pieces, *sides)
    checks += check_rest(motion, "{} at stops", states)
    dwell_states = [motion.during(phase) for phases in dwells for phase in phases]
    if dwell_states:
        still = MotionStates.join(dwell_states)
        allowed = options.rest_velocity_tolerance
        title = "velocity in dwells"
        checks.append(
            check_joints(motion, title, still.qdot, still.t, "velocity", allowed)
        )
    return checks


def check_rest(motion: CheckedMotion, title: str, states: MotionStates) -> list[Check]:
    """Check that derivatives vanish where the arm is at rest; `title` has a placeholder for their names."""
    options = motion.options
    jerks = states.qdddot / (1.0 + np.abs(motion.pieces.jerk[[0, -1]]).max())
    derivatives = (
        ("velocity", "velocity", states.qdot, options.rest_velocity_tolerance),
        (
            "acceleration",
            "acceleration",
            states.qddot,
            options.rest_acceleration_tolerance,
        ),
        ("jerk", "relative", jerks, options.rest_jerk_tolerance),
    )
    count = max(motion.task.spline.vanishing, 1)
    return [
        check_joints(motion, title.format(name), values, states.t, kind, allowed)
        for name, kind, values, allowed in derivatives[:count]
    ]


def times_of_stops(motion: CheckedMotion) -> np.ndarray:
    """Return the times, s, at which phases end or begin at stops of the task.

    For a program these are the ends of all phases: where phases meet in motion, its components are checked themselves.
    """
    if motion.trajectory.components:
        return motion.trajectory.phase_ends
    stops = [leg for leg in motion.legs if leg.stops]
    ends = [phase.end for leg in stops for phase in _phases_up_to(motion, leg)]
    return np.unique(ends)


def check_process_speed(motion: CheckedMotion) -> list[Check]:
    """Check that the tool moves at every given speed, and that each part with a given speed is a phase of the motion.

    For a recorded motion, only the speed is checked, because its phases are those between its stops.
    """
    legs = [leg for leg in motion.legs if leg.speed is not None]
    if not legs:
        return []
    deviations = [_worst_deviation(motion, leg) for leg in legs]
    worst = deviations[
        int(np.argmax([deviation.ratio for deviation in deviations]))
    ]  # NaN too
    speed = (worst.ratio, _SPEED, "relative", worst.subject, worst.time, worst.remark)
    check = Check("process speed", *speed)
    if motion.trajectory.recovered is not None:
        return [check]
    title = "s where process speeds begin and end"
    misses = [_distance(_nearest_phase(motion, leg), leg) for leg in legs]
    places = [(deviation.subject, deviation.time) for deviation in deviations]
    tolerance = motion.options.progress_tolerance
    return [check, _check_worst(title, misses, tolerance, "-", places)]


def _worst_deviation(motion: CheckedMotion, leg: Leg) -> Worst:
    """Find the largest relative deviation from the given speed of a leg."""

    def deviations(states: MotionStates) -> np.ndarray:
        """Return relative deviations from the speed, (K, 1), in units of `_RESOLUTION`."""
        speeds = tool_sizes(motion.robot, states, "speed")
        return np.abs(speeds / leg.speed - 1.0)[:, None] / _RESOLUTION

    phase = _nearest_phase(motion, leg)
    if motion.trajectory.recovered is not None:
        begin, end = _rows_within(motion, leg)
        phase = replace(phase, begin=begin, end=end)
    subject = f"tool, s = {leg.begin:g} to {leg.end:g}"
    worst = worst_between(motion, deviations, (subject,), motion.during(phase))
    return worst._replace(ratio=worst.ratio * _RESOLUTION)


def _rows_within(motion: CheckedMotion, leg: Leg) -> tuple[float, float]:
    """Return the times, s, of the first and the last row of a recorded motion within a leg."""
    times = motion.pieces.times
    index, u = motion.pieces.place_on_path(np.array([leg.begin, leg.end]))
    begin, end = times[index] + u * motion.pieces.lengths[index]
    inside = times[(times >= begin) & (times <= end)]
    if len(inside) < 2:
        return float(begin), float(end)
    return float(inside[0]), float(inside[-1])


def _nearest_phase(motion: CheckedMotion, leg: Leg) -> MotionPhase:
    """Return the phase whose ends are closest to those of a leg."""
    return min(motion.trajectory.phases, key=lambda phase: _distance(phase, leg))


def _distance(phase: MotionPhase, leg: Leg) -> float:
    """Return how far the ends of a phase are from the ends of a leg, as a difference of s."""
    return max(abs(phase.s_begin - leg.begin), abs(phase.s_end - leg.end))


def _phases_up_to(motion: CheckedMotion, leg: Leg) -> list[MotionPhase]:
    """List the phases that end where a leg ends."""
    tolerance = motion.options.progress_tolerance
    phases = motion.trajectory.phases
    return [phase for phase in phases if abs(phase.s_end - leg.end) <= tolerance]


def _check_worst(
    name: str,
    misses: list[float],
    allowed: float,
    unit: str,
    places: Sequence[tuple[str, float | None]],
) -> Check:
    """Check the largest of several deviations, each with its subject and time."""
    worst = int(np.argmax(misses))
    return Check(name, misses[worst], allowed, unit, *places[worst])


def check_joints(
    motion: CheckedMotion,
    name: str,
    values: np.ndarray,
    times: np.ndarray,
    kind: str,
    allowed: float,
) -> Check:
    """Check the largest magnitude of values, (K, n), and name its joint and time.

    `kind` is a key of `UNITS`, or a unit that applies to all joints.
    """
    if not len(times):
        return Check(name, np.inf, allowed, "relative")
    size = np.abs(values)
    k, joint = np.unravel_index(np.argmax(size), size.shape)
    robot = motion.robot
    unit = UNITS[kind][robot.position_units[joint]] if kind in UNITS else kind
    subject = robot.joint_names[joint]
    value = size[k, joint]
    return Check(name, value, allowed, unit, subject, times[k])


def check_splines(motion: CheckedMotion) -> list[Check]:
    """Check that the splines of the redundant joints agree with the motion of these joints."""
    trajectory = motion.trajectory
    states = motion.states
    names = motion.robot.joint_names
    if not trajectory.redundant_joints:
        return []
    joints = [names.index(name) for name in trajectory.redundant_joints]
    misses = np.zeros_like(states.q)
    misses[:, joints] = trajectory.redundant_spline(states.t) - states.q[:, joints]
    allowed = motion.options.spline_tolerance
    name = "redundant joints' splines"
    return [check_joints(motion, name, misses, states.t, "position", allowed)]


def check_continuity(motion: CheckedMotion) -> list[Check]:
    """Check for jumps where polynomial pieces join, and at the seam between the end and the start of a periodic motion.

    Acceleration and torque may jump at stops, unless the task asks for zero acceleration there. At the seam, the
    position of a joint without a range may differ by whole turns.
    """
    pieces = motion.pieces
    last = len(pieces.lengths) - 1
    ends = np.arange(last)
    joins = {" jump": (ends, ends + 1)}
    if motion.task.boundary.periodic:
        joins[" over the seam"] = (np.array([last]), np.array([0]))
    at_stops = np.zeros(last, dtype=bool)
    if motion.task.spline.vanishing == 1:
        at_stops = np.isin(pieces.times[1:-1], times_of_stops(motion))
    ranges = motion.robot.limits.both_ways("position")
    turns_freely = motion.robot.revolute & np.isinf(ranges).all(axis=0)
    names = {"position": "q", "velocity": "qdot"}
    if (
        motion.trajectory.degree >= CONTINUOUS_TORQUE
    ):  # with a lower degree, acceleration and torque may jump
        names |= {"acceleration": "qddot"}
        names |= {"torque": "tau"} if motion.robot.has_masses else {}
    checks = []
    for what, (first, second) in joins.items():
        before = MotionStates.at(pieces, first, np.ones(len(first)))
        after = MotionStates.at(pieces, second, np.zeros(len(second)))
        for name, attribute in names.items():
            values = getattr(before, attribute)
            scale = 1.0 + np.abs(values).max(initial=0.0)
            gaps = getattr(after, attribute) - values
            if attribute == "q" and what == " over the seam":
                gaps -= TURN * np.round(gaps / TURN) * turns_freely
            jumps = np.abs(gaps).max(axis=1, initial=0.0)
            if attribute in ("qddot", "tau") and what == " jump":
                jumps[at_stops] = 0.0
            value = jumps.max(initial=0.0) / scale
            time = after.t[np.argmax(jumps)] if len(jumps) else None
            allowed = motion.options.jump_tolerance
            checks.append(Check(f"{name}{what}", value, allowed, "relative", time=time))
    return checks
