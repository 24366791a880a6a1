"""What the task asks of the phases of a motion: stops, dwells, and given speeds of the tool."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from brachis.path.legs import Leg
from brachis.robot.joints import UNITS
from brachis.trajectory import MotionPhase
from brachis.verify.limits.protocol import Worst, worst_between
from brachis.verify.limits.tool import tool_sizes
from brachis.verify.motion import Given, MotionStates
from brachis.verify.report import Check

_DWELL = 1e-9
"""Largest deviation of a dwell from the time asked for, by rounding, s."""
_SPEED = 1e-6
"""Largest relative deviation from a given speed: by rounding, and by interpolation between nodes."""
_RESOLUTION = 1e-3
"""Deviations are searched in this unit: `worst_between` tells values apart that differ by 5e-6 units."""


def check_stops(given: Given) -> list[Check]:
    """Check that the arm is at rest at every stop, where a phase ends, and that it waits there as long as asked."""
    stops = [leg for leg in given.legs if leg.stops]
    if not stops:
        return []
    options = given.options
    trajectory = given.trajectory
    ends = np.array([phase.s_end for phase in trajectory.phases])
    misses = [np.abs(ends - leg.end).min() for leg in stops]
    dwells = [_dwells(given, leg) for leg in stops]
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
    moved = [given.during(phase) for phases in dwells for phase in phases]
    if moved:
        speeds = np.concatenate([each.qdot for each in moved])
        times = np.concatenate([each.t for each in moved])
        allowed = options.rest_velocity_tolerance
        title = "velocity in dwells"
        checks.append(check_joints(given, title, speeds, times, "velocity", allowed))
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
    tolerance = given.options.progress_tolerance
    stops = np.array([leg.end for leg in given.legs if leg.stops])
    return np.array(
        [
            phase.end
            for phase in given.trajectory.phases
            if np.any(np.abs(stops - phase.s_end) <= tolerance)
        ]
    )


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


def _dwells(given: Given, leg: Leg) -> list[MotionPhase]:
    """List the dwells at the end of a leg."""
    tolerance = given.options.progress_tolerance
    return [
        phase
        for phase in given.trajectory.phases
        if phase.is_dwell and abs(phase.s_end - leg.end) <= tolerance
    ]


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
