"""Programs of positions: the fewest joint or linear instructions that follow a motion within a tolerance.

Positions are given as values of the controller's axes, so no frame, tool or configuration is needed. The nominal
interpolation is the motion of the controller if nothing slows it down. Between two positions the joints, or for linear
instructions the tool pose, move on a straight line at constant speed, in the same time as the motion. Corners are
rounded by parabolas that extend to each side over `BLEND` times the shorter neighbouring time. Next to a rest, the arm
speeds up or slows down over `BLEND` times the time of the line.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any

import numpy as np

from brachis.apps.controller import ControllerAxes, Profile
from brachis.apps.export.deviation import Way
from brachis.apps.export.rows import require_library
from brachis.common.summary import Summary
from brachis.errors import InputError, check_names
from brachis.robot import Robot
from brachis.trajectory import Trajectory

BLEND = 0.25
"""Half of the duration of the parabola at a corner, as a fraction of the shorter neighbouring time."""
_POINTS = 1000
"""Number of times at which the motion is compared with the program."""
_STRICTER = 0.7
"""Factor by which the tolerances of single lines are reduced if rounded corners exceed the tolerances."""
_ROUNDS = 12
_FARTHER = 8
"""Maximum ratio of the duration of a line to that of the previous line."""
_MOST = 500
"""Maximum number of positions in a program."""
_LINE_STEPS = 20
"""Number of steps in which the arm is followed along a line of the tool."""
_NEWTON_STEPS = 4
"""Number of Newton iterations in each of these steps."""
_SAME_POSTURE = 1e-3
"""Maximum difference between the joints of two postures that count as the same, rad."""
_SAME_TIME = 1e-6
"""Difference between an event and the end of a phase below which they are at the same time, s."""
_REST = 1e-6
"""Joint velocity below which the arm counts as at rest, rad/s or m/s."""


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
    follower = _Follower(motion, list(events), is_linear=moves == "linear")
    if follower.is_linear:
        follower.check_arm(axes)
    nodes, place, time = follower.choose_within(tolerance, time_tolerance)
    if follower.is_linear:
        follower.check_postures(nodes, axes)
    report = ProgramReport(len(nodes), place, time)
    largest = _largest_velocities(motion.robot)
    if "percent" in language.template and not follower.is_linear:
        _check_velocities(largest, axes)
    columns = follower.describe(nodes, axes, largest)
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
        "velocities": np.abs(axes.encode_rates(largest[None])[0]).tolist(),
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


def _check_velocities(largest: np.ndarray, axes: ControllerAxes) -> None:
    """Refuse speeds in percent of velocities that are not known."""
    unknown = [
        joint
        for joint, number in zip(axes.joints, axes.index, strict=True)
        if np.isinf(largest[number])
    ]
    if unknown:
        raise InputError(
            "speeds in percent need the machine's largest velocities",
            where="robot.limits.velocity",
            found=f"none for {', '.join(unknown)}",
        )


def _largest_velocities(robot: Robot) -> np.ndarray:
    """Return the machine's largest velocities, (n,): those of the URDF, or else of the task; infinite where unknown."""
    largest = robot.limits.velocity.copy()
    for number, limit in enumerate(robot.urdf_limits):
        if limit.velocity:
            largest[number] = limit.velocity
    return largest


class _Follower:
    """Comparison of a motion with straight lines between its positions.

    Parameters
    ----------
    motion : Trajectory
    stations : sequence of float
        Times at which there must be a position, s.
    is_linear : bool

    Attributes
    ----------
    t : (K,) ndarray
        Times of the comparison, s.
    """

    def __init__(
        self, motion: Trajectory, stations: Sequence[float], *, is_linear: bool
    ) -> None:
        even = np.linspace(0.0, motion.t_end, _POINTS)
        self.stations = np.union1d(motion.phase_ends, stations)
        self.t = np.union1d(even, self.stations)
        self.ways = [
            Way.of(component, t) for component, _, t in motion.split_times(self.t)
        ]
        self.task_map = self.ways[0].task_map
        self.motion = motion
        self.is_linear = is_linear
        self.q = motion.position(self.t)
        self.followed = self.task_map.values(self.q) if is_linear else self.q
        self.rests = np.abs(motion.velocity(self.t)).max(axis=1) < _REST

    def choose_within(
        self, tolerance: float, time_tolerance: float
    ) -> tuple[np.ndarray, float, float]:
        """Choose positions whose rounded corners are within the tolerances too; return the deviations with them.

        Raises
        ------
        InputError
            They would be too many.
        """
        share = 1.0
        for _ in range(_ROUNDS):
            nodes = self.choose(share * tolerance, share * time_tolerance)
            place, time = self.deviate(nodes, self.t)
            if place <= tolerance and time <= time_tolerance and len(nodes) <= _MOST:
                return nodes, place, time
            if len(nodes) > _MOST:
                break
            share *= _STRICTER
        raise InputError(
            "no program of positions is within the tolerance",
            where="tolerance",
            found=f"more than {tolerance:g} m, rad or {time_tolerance:g} s with {len(nodes) - 1} positions",
            allowed=f"up to {_MOST} positions",
        )

    def choose(self, tolerance: float, time_tolerance: float) -> np.ndarray:
        """Choose the positions, (N,) indices of times, with lines as long as the tolerances allow."""

        def fits(first: int, last: int) -> bool:
            """Return whether the line between two times is within the tolerances."""
            nodes = np.array([first, last])
            place, time = self.deviate(nodes, self.t[first : last + 1])
            return place <= tolerance and time <= time_tolerance

        nodes = [0]
        for end in np.searchsorted(self.t, self.stations).tolist():
            while nodes[-1] < end and len(nodes) <= _MOST:
                first = nodes[-1]
                # A longer line may fit where a shorter one does not, so the search begins far away.
                before = first - nodes[-2] if first else end
                high = min(end, first + _FARTHER * before)
                low = high
                while low > first + 1 and not fits(first, low):
                    high = low
                    low = first + max(1, 4 * (low - first) // 5)
                while low < high - 1:
                    middle = (low + high) // 2
                    low, high = (middle, high) if fits(first, middle) else (low, middle)
                nodes.append(low)
        return np.array(nodes)

    def deviate(self, nodes: np.ndarray, t: np.ndarray) -> tuple[float, float]:
        """Return the largest deviations from the path, m or rad, and from the motion's timing, s, at times (k,)."""
        rests = self.rests[nodes]
        values = nominal(self.t[nodes], self.followed[nodes], rests, t)
        place = 0.0
        time = 0.0
        pieces = self.motion.split_times(t)
        for way, (component, rows, times) in zip(self.ways, pieces, strict=True):
            if not len(rows):
                continue
            part = values[rows]
            if not self.is_linear:
                virtual = component.position(times)[:, part.shape[1] :]
                part = np.hstack([part, virtual])
            if not way.task_map.m:
                deviations = way.deviate_from_joints(part, times)
            elif self.is_linear:
                deviations = way.deviate(part, times)
            else:
                deviations = way.deviate(way.task_map.values(part), times)
            place = max(place, deviations[0])
            time = max(time, deviations[1])
        return place, time

    def check_arm(self, axes: ControllerAxes) -> None:
        """Refuse lines of the tool where the controller's inverse kinematics would not be that of six joints."""
        count = axes.external.count(False)
        if not self.motion.task.of_poses or count != 6:
            raise InputError(
                "linear moves need a path of poses, and an arm of six joints",
                where="moves",
                found=f"task_space: {self.motion.task.task_space}, {count} joints"
                if not self.motion.parts
                else "a program of several parts",
                allowed="joint",
            )

    def check_postures(self, nodes: np.ndarray, axes: ControllerAxes) -> None:
        """Refuse lines of the tool along which an arm would come to other postures than those of the plan.

        The external axes move on straight lines, and the arm's joints follow the tool by Newton's method.
        """
        arm = axes.index[~np.array(axes.external)]
        for first, last in pairwise(nodes.tolist()):
            before = self.q[first]
            after = self.q[last]
            q = before.copy()
            for u in np.linspace(0.0, 1.0, _LINE_STEPS + 1)[1:]:
                target = (1.0 - u) * self.followed[first] + u * self.followed[last]
                line = (1.0 - u) * before + u * after
                line[arm] = q[arm]
                q = line
                for _ in range(_NEWTON_STEPS):
                    values = self.task_map.values(q[None])
                    miss = self.task_map.difference(target[None], values)[0]
                    slopes = self.task_map.jacobian(self.task_map.twists(q[None]))[0]
                    q[arm] += np.linalg.lstsq(slopes[:, arm], miss, rcond=None)[0]
            off = np.abs(q - after)
            if off.max() > _SAME_POSTURE:
                joint = self.motion.joint_names[int(np.argmax(off))]
                raise InputError(
                    "on a line of the tool the arm would come to another posture than the plan's",
                    where="moves",
                    found=f"{joint} off by {off.max():.3g} rad after {self.t[last]:.4g} s",
                    allowed="joint, or a plan whose arm does not pass a singular posture",
                )

    def describe(
        self, nodes: np.ndarray, axes: ControllerAxes, largest: np.ndarray
    ) -> dict[str, Any]:
        """Return what a template may say of each position; see `Language`."""
        robot = self.motion.robot
        q = self.q[nodes]
        rests = self.rests[nodes]
        h = np.diff(self.t[nodes])
        constant = h * (1.0 - 0.5 * BLEND * (rests[:-1].astype(float) + rests[1:]))
        tool, _ = robot.tool_placements(robot.of_real_joints(q))
        distance = np.linalg.norm(np.diff(tool, axis=0), axis=1)
        rates = np.abs(np.diff(q, axis=0))[:, axes.index] / constant[:, None]
        percent = 100.0 * np.max(rates / largest[axes.index], axis=1)
        waits = np.append(False, np.abs(np.diff(q, axis=0)).max(axis=1) < _REST)
        zone = (
            BLEND
            * np.minimum(np.append(0.0, distance), np.append(distance, 0.0))
            * ~rests
        )
        return {
            "values": np.round(axes.encode(q), 9) + 0.0,
            "duration": np.append(0.0, h),
            "speed": np.append(0.0, distance / constant),
            "percent": np.append(1.0, percent.clip(1e-3, 100.0)),
            "zone": zone,
            "passes": ~rests,
            "wait": np.where(waits, np.append(0.0, h), 0.0),
        }


def nominal(
    times: np.ndarray, nodes: np.ndarray, rests: np.ndarray, t: np.ndarray
) -> np.ndarray:
    """Return the nominal motion through nodes, (N, c), at times t, (k,); see the docstring of the module.

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
    h = np.diff(times)
    before = np.append(0.0, h)
    after = np.append(h, 0.0)
    # A line from rest starts later by half of the time in which it speeds up.
    early = 0.5 * BLEND * before * rests
    late = 0.5 * BLEND * after * rests
    corners = np.stack([times - early, times + late], axis=1).ravel()
    points = np.repeat(nodes, 2, axis=0)
    passing = BLEND * np.minimum(before, after) * ~rests
    half = np.stack([early + passing, late], axis=1).ravel()
    values = np.column_stack([np.interp(t, corners, column) for column in points.T])
    slopes = np.diff(nodes, axis=0) / np.diff(corners)[1::2, None]
    still = np.zeros_like(nodes[:1])
    incoming = np.concatenate([still, slopes])
    outgoing = np.concatenate([slopes, still])
    stopped = rests[:, None]
    turns = [outgoing * ~stopped - incoming, outgoing * stopped]
    turn = np.stack(turns, axis=1).reshape(points.shape)
    near = half > 0.0
    away = np.abs(t[:, None] - corners[near])
    bow = np.clip(half[near] - away, 0.0, None) ** 2 / (4.0 * half[near])
    return np.asarray(values + bow @ turn[near])


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
    """Yield the times, s, and instructions at which a process begins or ends."""
    is_process = [phase.kind == "given speed" for phase in motion.phases]
    ends = [0.0, *motion.phase_ends.tolist()]
    changes = pairwise([False, *is_process, False])
    for time, (before, after) in zip(ends, changes, strict=True):
        name = "process_on" if after else "process_off"
        if before != after and name in profile.events:
            yield time, profile.events[name]
