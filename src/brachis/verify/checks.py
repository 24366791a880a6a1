"""What is checked besides the path and the limits: progress, ends, splines and continuity.

Where a motion is looked at: in every piece, every knot interval, every piece of the path, and where joints reverse.

A time that nobody looks at can hide anything. Every quintic piece has places in its inside however short it is, and
more of them the further it moves a joint; Coulomb friction has places within its own width wherever a joint reverses
or comes near to it.
"""

from __future__ import annotations

import numpy as np

from brachis.errors import InputError
from brachis.path import Path
from brachis.robot import Robot, TaskMap
from brachis.robot.joints import UNITS
from brachis.trajectory import CONTINUOUS_TORQUE, Trajectory
from brachis.verify.motion import Pieces, States, roots, turns
from brachis.verify.report import Check, VerifyOptions

_ROUNDING = 1e-6
"""m or rad by which a task's postures may be off its path, since they are written with so many digits."""


def progress_checks(
    trajectory: Trajectory, t: np.ndarray, options: VerifyOptions
) -> list[Check]:
    """Check that the path is travelled once, forwards, from its beginning to its end.

    ds/dt is looked at where it is smallest: at the times t, (K,), at knots, and where its derivative vanishes.
    """
    from scipy.interpolate import PPoly

    spline, allowed = trajectory.path_spline, options.progress_tolerance
    turning = PPoly.from_spline(spline.derivative(2).tck).roots(
        discontinuity=True, extrapolate=False
    )
    times = np.concatenate([t, np.unique(spline.t), turning[np.isfinite(turning)]])
    velocity = spline(times, nu=1)
    backwards = float(np.maximum(0.0, -velocity).max())
    ends = float(np.abs([spline(0.0), spline(trajectory.t_end) - 1.0]).max())
    time = float(times[int(np.argmin(velocity))]) if backwards else None
    return [
        Check(
            "ds/dt below zero",
            backwards,
            allowed,
            "1/s",
            backwards <= allowed,
            time=time,
        ),
        Check("s at the ends", ends, allowed, "-", ends <= allowed),
    ]


def end_checks(
    trajectory: Trajectory,
    robot: Robot,
    task_map: TaskMap,
    path: Path,
    options: VerifyOptions,
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
            checks.append(
                _worst_joint(
                    f"{name} posture",
                    miss,
                    options.posture_tolerance,
                    "position",
                    robot,
                    time,
                )
            )
        if boundary.periodic:
            continue
        if given_speed:
            checks += _moving_end(
                name, trajectory, task_map, path, given_speed, time, options
            )
            continue
        speed, allowed = (
            np.abs(trajectory.velocity(time)),
            options.rest_velocity_tolerance,
        )
        checks.append(
            _worst_joint(f"{name} velocity", speed, allowed, "velocity", robot, time)
        )
        if task.spline.vanishing > 1:
            bend, allowed = (
                np.abs(trajectory.acceleration(time)),
                options.rest_acceleration_tolerance,
            )
            checks.append(
                _worst_joint(
                    f"{name} acceleration", bend, allowed, "acceleration", robot, time
                )
            )
        if task.spline.vanishing > 2:
            jerk = np.abs(trajectory.jerk(time)) / (
                1.0 + np.abs(trajectory.jerk(trajectory.times)).max()
            )
            checks.append(
                _worst_joint(
                    f"{name} jerk",
                    jerk,
                    options.rest_jerk_tolerance,
                    "relative",
                    robot,
                    time,
                )
            )
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
    moves = (
        float(task_map.norms(path.sample(trajectory.path_spline([time])).xi)[0][0])
        > _ROUNDING
    )
    off, allowed = (
        abs(float(position if moves else angle) - wanted),
        options.rest_velocity_tolerance * (1.0 + wanted),
    )
    unit = "m/s" if moves else "rad/s"
    checks = [Check(f"{name} speed", off, allowed, unit, off <= allowed, time=time)]
    if trajectory.task.spline.vanishing > 1:
        rate, bend = (
            abs(float(trajectory.path_spline(time, nu=order))) for order in (1, 2)
        )
        change, allowed = (
            wanted * bend / rate if rate else np.inf,
            options.rest_acceleration_tolerance,
        )
        checks.append(
            Check(
                f"{name} acceleration along the path",
                change,
                allowed,
                f"{unit}^2",
                change <= allowed,
                time=time,
            )
        )
    return checks


def seam_checks(
    trajectory: Trajectory, pieces: Pieces, robot: Robot, options: VerifyOptions
) -> list[Check]:
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


def spline_checks(
    trajectory: Trajectory, robot: Robot, states: States, options: VerifyOptions
) -> list[Check]:
    """Check that the splines of the redundant joints are their motion."""
    if not trajectory.redundant_joints:
        return []
    joints = [robot.joint_names.index(name) for name in trajectory.redundant_joints]
    misses = np.zeros_like(states.q)
    misses[:, joints] = np.abs(
        trajectory.redundant_spline(states.t) - states.q[:, joints]
    )
    worst = int(np.argmax(misses.max(axis=1)))
    time = float(states.t[worst])
    allowed = options.spline_tolerance
    return [
        _worst_joint(
            "redundant joints' splines", misses[worst], allowed, "position", robot, time
        )
    ]


def continuity_checks(
    trajectory: Trajectory, pieces: Pieces, robot: Robot, options: VerifyOptions
) -> list[Check]:
    """Jumps of position, velocity, acceleration and torque where polynomial pieces join, relative to their size."""
    behind = np.arange(1, len(pieces.lengths))
    before = States.at(pieces, robot, behind - 1, np.ones(len(behind)))
    after = States.at(pieces, robot, behind, np.zeros(len(behind)))
    return _jumps(before, after, " jump", trajectory.degree, options)


def _jumps(
    before: States, after: States, what: str, degree: int, options: VerifyOptions
) -> list[Check]:
    """Compare the states on both sides of places."""
    names = {
        "position": "q",
        "velocity": "qdot",
        "acceleration": "qddot",
        "torque": "tau",
    }
    if degree < CONTINUOUS_TORQUE:  # the asked degree has them jump
        del names["acceleration"], names["torque"]
    checks, allowed = [], options.jump_tolerance
    for name, part in names.items():
        left, right = getattr(before, part), getattr(after, part)
        scale = 1.0 + np.abs(left).max(initial=0.0)
        jumps = np.abs(right - left).max(axis=1, initial=0.0) / scale
        value = float(jumps.max(initial=0.0))
        time = float(after.t[int(np.argmax(jumps))]) if len(jumps) else None
        checks.append(
            Check(
                f"{name}{what}", value, allowed, "relative", value <= allowed, time=time
            )
        )
    return checks


def _worst_joint(
    name: str, misses: np.ndarray, allowed: float, kind: str, robot: Robot, time: float
) -> Check:
    """Make a check of the joint that misses most; `kind` is a key of `UNITS`, or the unit of all joints."""
    joint = int(np.argmax(misses))
    unit = UNITS[kind][robot.position_units[joint]] if kind in UNITS else kind
    value = float(misses[joint])
    return Check(
        name, value, allowed, unit, value <= allowed, robot.joint_names[joint], time
    )


_LEAST_STEPS = 3
"""Steps in every piece: their ends tell a cubic acceleration from any other."""
_SPIKE = 0.01
"""Coefficients that leave the range between both ends of a piece by this part of the largest acceleration."""
_MOST_STEPS = 10_000
MOST_INSTANTS = 200_000
"""Instants at which a motion is looked at before limits ask for more: some seconds' work, and 1 GB."""
_TRAVEL = 0.05
"""A step moves no joint further, rad or m."""
_ROUNDING_PLACES = 1e-6
_SAME_TIME = 1e-12
_BISECTIONS = 50
_LEVELS = np.array([0.3, 1.0, 2.0, 3.0, 4.5, 7.0])
"""Speeds, in widths of the Coulomb friction, between which it rises from 29 % to all but 2e-6 of its torque."""
_WIDTHS = 10.0
"""Within so many widths of zero a turning velocity counts as a near reversal."""

Places = tuple[np.ndarray, np.ndarray]
"""Pieces (K,) and places u in them (K,)."""


def spread_out(
    trajectory: Trajectory, pieces: Pieces, options: VerifyOptions
) -> Places:
    """Both ends of every piece and places between, no two of them further apart than a knot interval allows."""
    times, knots = trajectory.times, np.unique(trajectory.knots) * trajectory.t_end
    nearest = np.abs(
        times[np.searchsorted(times, knots).clip(max=len(times) - 1)] - knots
    )
    before = np.abs(times[(np.searchsorted(times, knots) - 1).clip(min=0)] - knots)
    own = knots[np.minimum(nearest, before) > _SAME_TIME * trajectory.t_end]
    edges = np.union1d(times, own)
    first, _ = pieces.place(edges[:-1])
    low = (edges[:-1] - times[first]) / pieces.lengths[first]
    high = (edges[1:] - times[first]) / pieces.lengths[first]
    interval = np.searchsorted(knots, 0.5 * (edges[1:] + edges[:-1])).clip(
        1, len(knots) - 1
    )
    per_interval = (
        np.diff(edges) / np.diff(knots)[interval - 1] * options.points_per_interval
    )
    travel = (
        np.abs(np.diff(pieces.position, axis=0)).sum(axis=0).max(axis=1)[first]
        * (high - low)
        / _TRAVEL
    )
    wanted = np.nan_to_num(np.maximum(per_interval - _ROUNDING_PLACES, travel))
    steps = np.ceil(np.clip(wanted, _LEAST_STEPS, _MOST_STEPS)).astype(int)
    count = steps + 1
    check_instants(int(count.sum()))
    span = np.repeat(np.arange(len(steps)), count)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return first[span], low[span] + (high - low)[span] * number / steps[span]


def check_instants(count: int) -> None:
    """Refuse to look at a motion at more than `MOST_INSTANTS` instants.

    Raises
    ------
    InputError
    """
    if count > MOST_INSTANTS:
        raise InputError(
            "the motion is too long, too fast or too finely divided to be verified",
            where="trajectory",
            found=f"{count} instants to look at",
            allowed=f"{MOST_INSTANTS}: {_LEAST_STEPS + 1} in every piece between nodes, one for every {_TRAVEL:g} rad "
            "or m that a joint travels, 32 in every knot interval and in every piece of the path",
            hint="Split the motion into parts",
        )


def within_path_pieces(
    trajectory: Trajectory, pieces: Pieces, breaks: np.ndarray, options: VerifyOptions
) -> Places:
    """Spread places over every piece of the path, however short: a small blend is not stepped over."""
    parts = np.linspace(0.0, 1.0, options.points_per_interval)
    check_instants(len(breaks) * len(parts))
    wanted = (breaks[:-1, None] + np.diff(breaks)[:, None] * parts).ravel()
    low, high = np.zeros_like(wanted), np.full_like(wanted, trajectory.t_end)
    for _ in range(_BISECTIONS):  # s(t) does not decrease
        middle = 0.5 * (low + high)
        before = trajectory.path_spline(middle) < wanted
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return pieces.place(0.5 * (low + high))


def sharpest(pieces: Pieces) -> Places:
    """Where the acceleration of a joint turns within a piece, if its coefficients leave the room between the ends."""
    ends = pieces.acceleration[[0, -1]]
    room = _SPIKE * np.abs(ends).max(axis=(0, 1))
    beyond = np.maximum(
        pieces.acceleration.max(axis=0) - ends.max(axis=0),
        ends.min(axis=0) - pieces.acceleration.min(axis=0),
    )
    piece, joint = np.nonzero(beyond > room)
    turning, u, _ = turns(pieces.acceleration[:, piece, joint])
    return piece[turning], u


def reversals(pieces: Pieces, robot: Robot) -> Places:
    """Where joints with Coulomb friction cross multiples of its width, or turn near zero velocity."""
    rubbing = np.flatnonzero(robot.friction.coulomb > 0.0)
    velocity = pieces.velocity[:, :, rubbing] / robot.friction.v_eps[rubbing]
    least, most = velocity.min(axis=0), velocity.max(axis=0)
    moving = (
        np.maximum(most, -least) > _LEVELS[0]
    )  # a joint that stands still crosses zero by rounding alone
    piece, joint = np.nonzero(moving & (least < _WIDTHS) & (most > -_WIDTHS))
    slow = velocity[:, piece, joint]
    levels = np.concatenate([-_LEVELS[::-1], [0.0], _LEVELS])
    crossed, u = roots((slow[:, :, None] - levels).reshape(len(slow), -1))
    turning, at, least_speed = turns(slow)
    near = np.abs(least_speed) < _WIDTHS
    return np.concatenate(
        [piece[crossed // len(levels)], piece[turning[near]]]
    ), np.concatenate([u, at[near]])
