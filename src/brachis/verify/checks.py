"""What is checked besides the path and the limits.

Progress, ends, stops and dwells, given speeds of the tool, splines and continuity.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brachis.common import tolerances
from brachis.kernel import Spline, blossom
from brachis.path.legs import Leg
from brachis.robot import TaskMap
from brachis.robot.joints import TURN, UNITS
from brachis.trajectory import CONTINUOUS_TORQUE, MotionPhase
from brachis.verify.limits.protocol import Worst, worst_between
from brachis.verify.limits.tool import tool_sizes
from brachis.verify.motion import Given, MotionStates, turns
from brachis.verify.report import Check

_DWELL = 1e-9
"""Largest deviation of a dwell from the time asked for, by rounding, s."""
_SPEED = 1e-6
"""Largest relative deviation from a given speed: by rounding, and by interpolation between nodes."""
_RESOLUTION = 1e-3
"""Deviations are searched in this unit: `worst_between` tells values apart that differ by 5e-6 units."""


def check_progress(given: Given) -> list[Check]:
    """Check that the path is travelled once, forwards, from its beginning to its end.

    ds/dt is a polynomial between knots: it is checked at both ends of each, and where it turns.
    """
    trajectory = given.trajectory
    allowed = given.options.progress_tolerance
    spline = trajectory.path_spline.derivative
    breaks = np.unique(spline.knots)
    speeds = _bernstein_coefficients(spline, breaks)
    piece, u, slowest = turns(speeds)
    velocity = np.concatenate([speeds[0], speeds[-1], slowest])
    turning = breaks[piece] + u * np.diff(breaks)[piece]
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
    """Bernstein coefficients, (d + 1, F), of the polynomials of a spline between its knots, (F + 1,)."""
    begins = breaks[:-1]
    ends = breaks[1:]
    piece = np.searchsorted(spline.knots, begins, side="right") - 1
    points = spline.control_points[:, None]
    degree = spline.degree
    sides = ([begins] * (degree - i) + [ends] * i for i in range(degree + 1))
    return np.hstack([blossom(spline.knots, points, piece, own) for own in sides]).T


def check_ends(given: Given) -> list[Check]:
    """Check that the motion begins and ends as the task says."""
    task = given.task
    boundary = task.boundary
    states = given.states
    checks = []
    for name, number, s in (("start", 0, 0.0), ("end", -1, 1.0)):
        state = states.only([number])
        joints = task.joints_at(name)
        speed = getattr(boundary, f"{name}_speed")
        if joints is not None:
            posture = given.robot.posture(*joints)
            target = given.path.sample(np.array([s])).target
            miss = state.q - _move_onto(posture, given.task_map, target)
            allowed = given.options.posture_tolerance
            title = f"{name} posture"
            checks.append(
                check_joints(given, title, miss, state.t, "position", allowed)
            )
        if boundary.periodic:
            continue
        if speed:
            checks += _check_speed(given, name, speed, state)
        else:
            checks += check_rest(given, f"{name} {{}}", state)
    return checks


def _check_speed(
    given: Given, name: str, wanted: float, state: MotionStates
) -> list[Check]:
    """Check that an end is passed at the speed that the task asks for; with full rest it is constant there."""
    task_map = given.task_map
    spline = given.trajectory.path_spline
    time = state.t[0]
    jacobian = task_map.jacobian(task_map.twists(state.q))[0]
    position, angle = task_map.norms(jacobian @ state.qdot[0])
    per_s, _ = task_map.norms(given.path.sample(state.s).xi)
    moves = per_s[0] > tolerances.WRITTEN
    unit = "m/s" if moves else "rad/s"
    off = abs(float(position if moves else angle) - wanted)
    allowed = given.options.rest_velocity_tolerance * (1.0 + wanted)
    checks = [Check(f"{name} speed", off, allowed, unit, time=time)]
    if given.task.spline.vanishing > 1:
        rate = abs(float(spline(time, nu=1)))
        bend = abs(float(spline(time, nu=2)))
        checks.append(
            Check(
                f"{name} acceleration along the path",
                wanted * bend / rate if rate else np.inf,
                given.options.rest_acceleration_tolerance,
                f"{unit}^2",
                time=time,
            )
        )
    return checks


def _move_onto(given: np.ndarray, task_map: TaskMap, target: np.ndarray) -> np.ndarray:
    """Return the posture nearest to a given one, (n,), whose tool is at the target, (1, c), within rounding of it."""
    miss = task_map.difference(target, task_map.values(given[None]))[0]
    if np.abs(miss).max(initial=0.0) > tolerances.WRITTEN:
        return given
    jacobian = task_map.jacobian(task_map.twists(given[None]))[0]
    return given + np.linalg.lstsq(jacobian, miss, rcond=None)[0]


def check_stops(given: Given) -> list[Check]:
    """Check that the arm is at rest at every stop, where a phase ends, and that it waits there as long as asked."""
    stops = [leg for leg in given.legs if leg.stops]
    if not stops:
        return []
    options = given.options
    trajectory = given.trajectory
    ends = np.array([phase.s_end for phase in trajectory.phases])
    misses = [np.abs(ends - leg.end).min() for leg in stops]
    dwells = [
        [phase for phase in _phases_up_to(given, leg) if phase.is_dwell]
        for leg in stops
    ]
    waits = [sum(phase.duration for phase in phases) for phases in dwells]
    off = [abs(wait - leg.dwell) for wait, leg in zip(waits, stops, strict=True)]
    places = [f"s = {leg.end:g}" for leg in stops]
    checks = [
        _check_worst("s at stops", misses, options.progress_tolerance, "-", places),
        _check_worst("duration of dwells", off, _DWELL, "s", places),
    ]
    piece, u = given.pieces.place(times_of_stops(given))
    before = piece[(u == 0.0) & (piece > 0)] - 1
    sides = (np.append(before, piece), np.append(np.ones(len(before)), u))
    states = MotionStates.at(given.pieces, *sides)
    checks += check_rest(given, "{} at stops", states)
    parts = [given.during(phase) for phases in dwells for phase in phases]
    if parts:
        still = MotionStates.join(parts)
        allowed = options.rest_velocity_tolerance
        title = "velocity in dwells"
        checks.append(
            check_joints(given, title, still.qdot, still.t, "velocity", allowed)
        )
    return checks


def check_rest(given: Given, title: str, states: MotionStates) -> list[Check]:
    """Check the derivatives that vanish where the arm rests; `title` has a gap for their names."""
    options = given.options
    jerks = states.qdddot / (1.0 + np.abs(given.pieces.jerk[[0, -1]]).max())
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
    count = max(given.task.spline.vanishing, 1)
    return [
        check_joints(given, title.format(name), values, states.t, kind, allowed)
        for name, kind, values, allowed in derivatives[:count]
    ]


def times_of_stops(given: Given) -> np.ndarray:
    """Return the times at which phases end or begin at stops of the task, s."""
    stops = [leg for leg in given.legs if leg.stops]
    ends = [phase.end for leg in stops for phase in _phases_up_to(given, leg)]
    return np.unique(ends)


def check_process_speed(given: Given) -> list[Check]:
    """Check that the tool has the given speed wherever it has one, and that a phase passes each such part.

    The phases of a recorded motion are only those between its stops.
    """
    legs = [leg for leg in given.legs if leg.speed is not None]
    if not legs:
        return []
    found = [_worst_deviation(given, leg) for leg in legs]
    worst = found[int(np.argmax([each.ratio for each in found]))]  # NaN too
    speed = (worst.ratio, _SPEED, "relative", worst.subject, worst.time, worst.remark)
    check = Check("process speed", *speed)
    if given.trajectory.recovered is not None:
        return [check]
    title = "s where process speeds begin and end"
    misses = [_distance(_nearest_phase(given, leg), leg) for leg in legs]
    subjects = [each.subject for each in found]
    tolerance = given.options.progress_tolerance
    return [check, _check_worst(title, misses, tolerance, "-", subjects)]


def _worst_deviation(given: Given, leg: Leg) -> Worst:
    """Find the largest relative deviation from the speed that a leg gives."""

    def deviations(states: MotionStates) -> np.ndarray:
        """Return relative deviations from the speed, (K, 1), in units of `_RESOLUTION`."""
        speeds = tool_sizes(given.robot, states, "speed")
        return np.abs(speeds / leg.speed - 1.0)[:, None] / _RESOLUTION

    phase = _nearest_phase(given, leg)
    if given.trajectory.recovered is not None:
        begin, end = _rows_within(given, leg)
        phase = replace(phase, begin=begin, end=end)
    subject = f"tool, s = {leg.begin:g} to {leg.end:g}"
    worst = worst_between(given, deviations, (subject,), given.during(phase))
    return worst._replace(ratio=worst.ratio * _RESOLUTION)


def _rows_within(given: Given, leg: Leg) -> tuple[float, float]:
    """Return the times of the first and the last row of a recorded motion that lie in a leg, s."""
    times = given.pieces.times
    piece, part = given.pieces.place_on_path(np.array([leg.begin, leg.end]))
    begin, end = times[piece] + part * given.pieces.lengths[piece]
    inside = times[(times >= begin) & (times <= end)]
    if len(inside) < 2:
        return float(begin), float(end)
    return float(inside[0]), float(inside[-1])


def _nearest_phase(given: Given, leg: Leg) -> MotionPhase:
    """Return the phase that passes a leg, or nearly so."""
    return min(given.trajectory.phases, key=lambda phase: _distance(phase, leg))


def _distance(phase: MotionPhase, leg: Leg) -> float:
    """Return how far the ends of a phase are from those of a leg, in s."""
    return max(abs(phase.s_begin - leg.begin), abs(phase.s_end - leg.end))


def _phases_up_to(given: Given, leg: Leg) -> list[MotionPhase]:
    """List the phases that end where a leg ends."""
    tolerance = given.options.progress_tolerance
    phases = given.trajectory.phases
    return [phase for phase in phases if abs(phase.s_end - leg.end) <= tolerance]


def _check_worst(
    name: str, misses: list[float], allowed: float, unit: str, subjects: list[str]
) -> Check:
    """Check what misses most."""
    worst = np.argmax(misses)
    return Check(name, misses[worst], allowed, unit, subjects[worst])


def check_joints(
    given: Given,
    name: str,
    values: np.ndarray,
    times: np.ndarray,
    kind: str,
    allowed: float,
) -> Check:
    """Check the joint and the time at which values, (K, n), are largest.

    `kind` is a key of `UNITS`, or the unit of all joints.
    """
    if not len(times):
        return Check(name, np.inf, allowed, "relative")
    size = np.abs(values)
    k, joint = np.unravel_index(np.argmax(size), size.shape)
    robot = given.robot
    unit = UNITS[kind][robot.position_units[joint]] if kind in UNITS else kind
    subject = robot.joint_names[joint]
    value = size[k, joint]
    return Check(name, value, allowed, unit, subject, times[k])


def check_splines(given: Given) -> list[Check]:
    """Check that the splines of the redundant joints are their motion."""
    trajectory = given.trajectory
    states = given.states
    names = given.robot.joint_names
    if not trajectory.redundant_joints:
        return []
    joints = [names.index(name) for name in trajectory.redundant_joints]
    misses = np.zeros_like(states.q)
    misses[:, joints] = trajectory.redundant_spline(states.t) - states.q[:, joints]
    allowed = given.options.spline_tolerance
    name = "redundant joints' splines"
    return [check_joints(given, name, misses, states.t, "position", allowed)]


def check_continuity(given: Given) -> list[Check]:
    """Check jumps where polynomial pieces join, and where a periodic motion goes on from its end to its beginning.

    Acceleration and torque may jump at stops, unless rest means that the acceleration vanishes. Over the seam a joint
    without a range may have made whole turns.
    """
    pieces = given.pieces
    last = len(pieces.lengths) - 1
    ends = np.arange(last)
    joins = {" jump": (ends, ends + 1)}
    if given.task.boundary.periodic:
        joins[" over the seam"] = (np.array([last]), np.array([0]))
    at_stops = np.zeros(last, dtype=bool)
    if given.task.spline.vanishing == 1:
        at_stops = np.isin(pieces.times[1:-1], times_of_stops(given))
    ranges = given.robot.limits.both_ways("position")
    turns_freely = given.robot.revolute & np.isinf(ranges).all(axis=0)
    names = {"position": "q", "velocity": "qdot"}
    if given.trajectory.degree >= CONTINUOUS_TORQUE:  # a lower degree lets them jump
        names |= {"acceleration": "qddot"}
        names |= {"torque": "tau"} if given.robot.has_masses else {}
    checks = []
    for what, (first, second) in joins.items():
        before = MotionStates.at(pieces, first, np.ones(len(first)))
        after = MotionStates.at(pieces, second, np.zeros(len(second)))
        for name, part in names.items():
            left = getattr(before, part)
            scale = 1.0 + np.abs(left).max(initial=0.0)
            gaps = getattr(after, part) - left
            if part == "q" and what == " over the seam":
                gaps -= TURN * np.round(gaps / TURN) * turns_freely
            jumps = np.abs(gaps).max(axis=1, initial=0.0)
            if part in ("qddot", "tau") and what == " jump":
                jumps[at_stops] = 0.0
            value = jumps.max(initial=0.0) / scale
            time = after.t[np.argmax(jumps)] if len(jumps) else None
            allowed = given.options.jump_tolerance
            checks.append(Check(f"{name}{what}", value, allowed, "relative", time=time))
    return checks
