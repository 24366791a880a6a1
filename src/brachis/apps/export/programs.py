"""Programs of positions: the fewest joint or linear instructions that follow a motion within a tolerance.

Positions are given as values of the controller's axes, so no frame, tool or configuration is needed. The nominal
interpolation is the motion of the controller if nothing slows it down. Between two positions the joints, or for linear
instructions the tool pose, move on a straight line at constant speed, in the same time as the motion. Corners are
rounded by parabolas that extend to each side over `BLEND` times the shorter neighbouring time. Next to a rest, the arm
speeds up or slows down over `BLEND` times the time of the line.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any

import numpy as np

from brachis.apps.controller import ControllerAxes, Language, Profile
from brachis.apps.export.deviation import Way
from brachis.apps.export.rows import require_library
from brachis.common.arrays import apply_each
from brachis.common.summary import Summary
from brachis.errors import InputError, check_names
from brachis.robot import Robot
from brachis.task import part_names
from brachis.trajectory import Trajectory

BLEND = 0.25
"""Half of the duration of the parabola at a corner, as a fraction of the shorter neighbouring time."""
_POINTS = 1000
"""Number of times at which the motion is compared with the program.

The deviations of programs of the tests' seams are found to within 1 %, and with a quarter of the times to within 5 %.
"""
_MOST = _POINTS // 2
"""Maximum number of positions in a program, so that lines are compared inside too."""
_STRICTER = 0.7
"""Factor by which the tolerances of single lines are reduced if the whole program exceeds the tolerances.

Deviations grow as the squares of lengths, so that no more than a fifth of the positions is unnecessary.
"""
_LINE_STEPS = 20
"""Number of steps in which the arm is followed along a line of the tool."""
_NEWTON_STEPS = 4
"""Number of Newton iterations in each of these steps."""
_SAME_POSTURE = 1e-3
"""Maximum difference between the joints of two postures that count as the same, rad."""
_REST = 1e-6
"""Joint velocity below which the arm counts as at rest, rad/s or m/s."""
_ARM_JOINTS = 6
"""Number of joints with which a controller's inverse kinematics of the arm has a finite number of solutions."""
_SAME_TIME = 1e-6
"""Difference between an event and the end of a phase below which they are at the same time, s."""


@dataclass(frozen=True, repr=False)
class ProgramReport(Summary):
    """Deviation of a program of positions, interpolated nominally, from the motion.

    Attributes
    ----------
    positions : int
        Number of positions.
    place : float
        Largest deviation of the tool from the path, m or rad.
    time : float
        Largest difference between the times at which program and motion pass a point of the path, s.
    failures : tuple of str
        Limits of the task or the profile that the plan exceeds, in words.
    """

    positions: int
    place: float
    time: float
    failures: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether the plan keeps the limits of the task and of the profile."""
        return not self.failures

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return dict(vars(self))

    def summary(self) -> Mapping[str, object]:
        """Return the entries shown to the user."""
        return {
            "positions": self.positions,
            "deviation in place": f"{self.place:.3g} m, rad",
            "deviation in time": f"{self.time:.3g} s",
            "limits of the plan": "; ".join(self.failures) or "met",
        }


def write_program(
    motion: Trajectory,
    profile: Profile,
    axes: ControllerAxes,
    name: str,
    *,
    moves: str = "joint",
    tolerance: float = 1e-3,
    time_tolerance: float = 0.01,
) -> tuple[str, ProgramReport]:
    """Write a program in the language of a profile.

    Parameters
    ----------
    motion : Trajectory
    profile : Profile
    axes : ControllerAxes
    name : str
        Name of the motion, for the head of the program.
    moves : {"joint", "linear"}, optional
        Whether the joints or the tool move on straight lines between positions.
    tolerance : float, optional
        Maximum deviation of the tool from the path, in m and in rad.
    time_tolerance : float, optional
        Maximum difference in time, s.

    Raises
    ------
    InputError
        No program is within the tolerances, or the language does not support external axes.
    """
    check_names("kind of moves", [moves], ("joint", "linear"), "moves")
    language = profile.program
    assert language is not None
    if any(axes.external) and not language.external_axes:
        raise InputError(
            "the language does not support external axes",
            where="profile.axes",
            found=", ".join(axes.names),
            allowed="only the joints of the arm",
        )
    events = _events(motion, profile)
    follower = _Follower(
        motion, axes, language, list(events), is_linear=moves == "linear"
    )
    nodes, place, time = follower.choose_within(tolerance, time_tolerance)
    report = ProgramReport(len(nodes), place, time)
    columns = follower.describe(nodes)
    steps = [
        {name: column[row].tolist() for name, column in columns.items()}
        | {"event": events.get(time, "")}
        for row, time in enumerate(follower.t[nodes].tolist())
    ]
    fields = {
        "date": datetime.now(tz=UTC).date().isoformat(),
        "name": name,
        "robot": motion.robot.name,
        "title": profile.title,
        "report": report,
        "t_end": motion.t_end,
        "is_linear": follower.is_linear,
        "axes": axes,
        "velocities": np.abs(axes.encode_rates(follower.velocities[None])[0]).tolist(),
        "steps": steps,
    }
    return _render(language.template, fields), report


def _render(template: str, fields: dict[str, Any]) -> str:
    """Fill a template of the user's, which cannot run code.

    Raises
    ------
    InputError
        It is not a template, or uses a variable that does not exist.
    """
    jinja = require_library("jinja2", "a program", library="Jinja2", extra="report")
    sandbox = require_library("jinja2.sandbox", "a program", extra="report")
    environment = sandbox.SandboxedEnvironment(
        undefined=jinja.StrictUndefined, keep_trailing_newline=True
    )
    try:
        text: str = environment.from_string(template).render(fields)
    except jinja.TemplateError as error:
        raise InputError(
            "the template is wrong", where="profile.program.template", found=str(error)
        ) from error
    return text


def _largest_velocities(robot: Robot) -> np.ndarray:
    """Return the machine's largest velocities, (n,): those of the URDF, or else of the task; infinite where unknown."""
    stated = zip(robot.urdf_limits, robot.limits.velocity, strict=False)
    return np.array([limit.velocity or velocity for limit, velocity in stated])


class _Follower:
    """Comparison of a motion with straight lines between its positions.

    Attributes
    ----------
    t : (K,) ndarray
        Times of the comparison, s.
    stations : ndarray
        Times at which there is a position, s: ends of phases, and events.
    q : (K, n) ndarray
    followed : (K, c) ndarray
        What moves on straight lines: `q` or, for linear moves, the task coordinates.
    velocities : (n,) ndarray
        The machine's largest velocities, infinite where unknown.
    """

    def __init__(
        self,
        motion: Trajectory,
        axes: ControllerAxes,
        language: Language,
        events: Sequence[float],
        *,
        is_linear: bool,
    ) -> None:
        task = motion.task
        self.motion = motion
        self.axes = axes
        self.duration_step = language.duration_step
        self.percent_step = None if is_linear else language.percent_step
        self.velocities = _largest_velocities(motion.robot)
        self.is_linear = is_linear
        even = np.linspace(0.0, motion.t_end, _POINTS)
        self.stations = np.union1d(motion.phase_ends, events)
        self.t = np.union1d(even, self.stations)
        self.ways = [Way.of(*piece) for piece in motion.split_times(self.t)]
        self.task_map = self.ways[0].task_map
        self.q = motion.position(self.t)
        self.followed = self.task_map.values(self.q) if is_linear else self.q
        self.rests = np.abs(motion.velocity(self.t)).max(axis=1) < _REST
        arm_joints = axes.external.count(False)
        if is_linear and not (task.of_poses and arm_joints == _ARM_JOINTS):
            raise InputError(
                "linear moves need a path of poses, and an arm of six joints",
                where="moves",
                found="a program of several parts"
                if motion.parts
                else f"task_space: {task.task_space}, {arm_joints} joints",
                allowed="joint",
            )
        unknown = np.array(axes.joints)[np.isinf(self.velocities[axes.index])]
        if self.percent_step and len(unknown):
            raise InputError(
                "speeds in percent need the machine's largest velocities",
                where="robot.limits.velocity",
                found=f"none for {', '.join(unknown)}",
            )

    def choose_within(
        self, tolerance: float, time_tolerance: float
    ) -> tuple[np.ndarray, float, float]:
        """Choose positions, (N,) indices of times, whose rounded corners and durations are within the tolerances too.

        Their deviations are returned too.

        Raises
        ------
        InputError
            They would be too many, or lines of the tool would end in other postures.
        """
        share = 1.0
        while True:
            nodes = self.choose(share * tolerance, share * time_tolerance)
            place, time = self.deviate(nodes, self.describe(nodes)["duration"])
            if len(nodes) > _MOST:
                key = "time_tolerance" if time > time_tolerance else "tolerance"
                raise InputError(
                    "no program of positions is within the tolerance",
                    where="tolerance",
                    found=f"{place:.3g} m, rad and {time:.3g} s with {_MOST} positions, rounded for the language",
                    allowed=f"{tolerance:g} m, rad and {time_tolerance:g} s",
                    hint=f"Raise {key}",
                )
            if place <= tolerance and time <= time_tolerance:
                if self.is_linear:
                    self.check_postures(nodes)
                return nodes, place, time
            share *= _STRICTER

    def choose(self, tolerance: float, time_tolerance: float) -> np.ndarray:
        """Choose the positions with lines as long as the tolerances allow, by bisection."""

        def exceeds(last: int) -> bool:
            """Return whether the line from the latest position exceeds the tolerances."""
            place, time = self.deviate(np.array([nodes[-1], last]))
            return place > tolerance or time > time_tolerance

        nodes = [0]
        for end in np.searchsorted(self.t, self.stations).tolist():
            while nodes[-1] < end and len(nodes) <= _MOST:
                following = range(nodes[-1] + 2, end + 1)
                count = bisect_left(following, 1, key=exceeds)
                nodes.append(nodes[-1] + 1 + count)
        return np.array(nodes)

    def deviate(
        self, nodes: np.ndarray, durations: np.ndarray | None = None
    ) -> tuple[float, float]:
        """Return the largest deviations from the path, m or rad, and from the motion's timing, s, between positions.

        `durations`, (N,), s, are those of the lines that end at the positions, by default as in the motion.
        """
        rows = slice(nodes[0], nodes[-1] + 1)
        planned = self.t[nodes]
        times = planned if durations is None else np.cumsum(durations)
        t = np.interp(self.t[rows], planned, times)
        values = nominal(times, self.followed[nodes], self.rests[nodes], t)
        place = 0.0
        time = 0.0
        for way in self.ways:
            inside = (way.rows >= nodes[0]) & (way.rows <= nodes[-1])
            if inside.any():
                chosen = way.rows[inside] - nodes[0]
                late = (t - self.t[rows])[chosen]
                deviations = way.deviate(
                    values[chosen], late, inside, is_linear=self.is_linear
                )
                place = max(place, deviations[0])
                time = max(time, deviations[1])
        return place, time

    def check_postures(self, nodes: np.ndarray) -> None:
        """Refuse lines of the tool along which an arm would come to other postures than those of the plan.

        The external axes move on straight lines, and the arm's joints follow the tool by Newton's method.
        """
        arm = self.axes.index[~np.array(self.axes.external)]
        before = self.q[nodes[:-1]]
        after = self.q[nodes[1:]]
        begin = self.followed[nodes[:-1]]
        end = self.followed[nodes[1:]]
        q = before
        for u in np.linspace(0.0, 1.0, _LINE_STEPS + 1)[1:]:
            line = (1.0 - u) * before + u * after
            line[:, arm] = q[:, arm]
            q = line
            target = (1.0 - u) * begin + u * end
            for _ in range(_NEWTON_STEPS):
                miss = self.task_map.difference(target, self.task_map.values(q))
                slopes = self.task_map.jacobian(self.task_map.twists(q))
                inverse = np.linalg.pinv(slopes[:, :, arm])
                q[:, arm] += apply_each(inverse, miss)
        off = np.abs(q - after)
        row, joint = map(int, np.unravel_index(np.argmax(off), off.shape))
        if off[row, joint] > _SAME_POSTURE:
            raise InputError(
                "on a line of the tool the arm would come to another posture than the plan's",
                where="moves",
                found=f"{self.motion.joint_names[joint]} off by {off[row, joint]:.3g} rad "
                f"after {self.t[nodes[row + 1]]:.4g} s",
                allowed="joint, or a plan whose arm does not pass a singular posture",
            )

    def describe(self, nodes: np.ndarray) -> dict[str, np.ndarray]:
        """Return what a template may say of each position; see `Language`.

        Durations, and speeds in percent, are rounded as the language requires.
        """
        index = self.axes.index
        robot = self.motion.robot
        q = self.q[nodes]
        rests = self.rests[nodes]
        h = np.diff(self.t[nodes])
        constant = _constant_times(h, rests)
        tool, _ = robot.tool_placements(robot.of_real_joints(q))
        distance = np.linalg.norm(np.diff(tool, axis=0), axis=1)
        travel = np.abs(np.diff(q, axis=0))
        waits = travel.max(axis=1) < _REST
        rates = travel[:, index] / constant[:, None]
        percent = 100.0 * np.max(rates / self.velocities[index], axis=1)
        step = self.percent_step
        if step:
            exact = percent
            percent = (np.round(exact / step) * step).clip(step, 100.0)
            h *= np.where(waits, 1.0, exact / percent)
        step = self.duration_step
        duration = np.append(0.0, (np.round(h / step) * step).clip(step))
        shorter = np.minimum(np.append(0.0, distance), np.append(distance, 0.0))
        return {
            "values": np.round(self.axes.encode(q), 9) + 0.0,
            "duration": duration,
            "speed": np.append(0.0, distance / constant),
            "percent": np.append(1.0, percent),
            "zone": BLEND * shorter * ~rests,
            "passes": ~rests,
            "wait": np.append(False, waits) * duration,
        }


def _constant_times(h: np.ndarray, rests: np.ndarray) -> np.ndarray:
    """Return the times in which lines of durations h, (N - 1,), s, would be passed at their constant speeds."""
    return h * (1.0 - 0.5 * BLEND * (rests[:-1].astype(float) + rests[1:]))


def nominal(
    times: np.ndarray, nodes: np.ndarray, rests: np.ndarray, t: np.ndarray
) -> np.ndarray:
    """Return the nominal motion through nodes, (N, c), at times t, (k,); see the docstring of the module.

    The velocity is linear between the ends of lines at constant speed.

    Parameters
    ----------
    times : (N,) ndarray
        Times of the nodes, s.
    nodes : (N, c) ndarray
    rests : (N,) bool ndarray
        Whether the motion is at rest at each node.
    t : (k,) ndarray
        s.
    """
    from scipy.interpolate import make_interp_spline

    h = np.diff(times)
    velocity = np.diff(nodes, axis=0) / _constant_times(h, rests)[:, None]
    before = np.append(0.0, h)
    after = np.append(h, 0.0)
    shorter = np.minimum(before, after)
    # At a rest, its own velocity comes first and counts.
    ends = np.concatenate(
        [
            times[rests],
            times - BLEND * np.where(rests, before, shorter),
            times + BLEND * np.where(rests, after, shorter),
        ]
    )
    still = np.zeros_like(nodes[rests])
    rates = np.concatenate([still, velocity[:1], velocity, velocity, velocity[-1:]])
    ends, first = np.unique(ends, return_index=True)
    distance = make_interp_spline(ends, rates[first], 1).antiderivative()
    return np.asarray(nodes[0] + distance(t))


def _events(motion: Trajectory, profile: Profile) -> dict[float, str]:
    """Return the instructions at which a process begins or ends, and those of a program's events, by their time, s.

    Raises
    ------
    InputError
        The profile has no instruction for an event, or two events occur at the same time.
    """
    events = dict(_process_events(motion, profile))
    ends = np.append(0.0, motion.phase_ends)
    for event in motion.events:
        if event.name not in profile.events:
            raise InputError(
                "the controller has no instruction for an event of the program",
                where="profile.events",
                found=event.name,
                allowed=", ".join(profile.events) or "none in this profile",
                hint=f"Write a profile with extends: and events: {{{event.name}: ...}}",
            )
        nearest = float(ends[np.argmin(np.abs(ends - event.time))])
        is_same = abs(nearest - event.time) < _SAME_TIME
        time = nearest if is_same else event.time
        if time in events:
            raise InputError(
                "a program of positions has one instruction at a time",
                where="program.events",
                found=f"{event.name} and another at {time:.4f} s",
                hint="Give one of them a lead",
            )
        events[time] = profile.events[event.name]
    return events


def _process_events(
    motion: Trajectory, profile: Profile
) -> Iterator[tuple[float, str]]:
    """Yield the times, s, and instructions at which a process begins or ends, unless its part has such an event."""
    program = motion.task.program
    events = {
        name: part.events
        for name, part in zip(part_names(program), program, strict=True)
    }
    is_process = [phase.kind == "given speed" for phase in motion.phases]
    ends = [0.0, *motion.phase_ends.tolist()]
    changes = pairwise([False, *is_process, False])
    for time, (before, after) in zip(ends, changes, strict=True):
        name = "process_on" if after else "process_off"
        inside = time + (_SAME_TIME if after else -_SAME_TIME)
        stated = [
            event.name
            for part in motion.parts
            if part.begin < inside < part.end
            for event in events.get(part.name, ())
        ]
        if before != after and name in profile.events and name not in stated:
            yield time, profile.events[name]
