"""Implausible figures of a task or a robot: unusually large ones look like another unit.

`USUAL` is the table of the largest usual figures; those of joint limits are in `plausible_limits`.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError, write_apart
from brachis.problem.plausible_limits import FASTEST, limit_figures
from brachis.robot import Robot, TaskMap
from brachis.robot.joints import UNITS
from brachis.robot.plausibility import Check, Issue, find_issues, link_lengths, reach
from brachis.robot.task_map import JointSpace
from brachis.robot.task_map.protocol import YAW
from brachis.task import Task, ToolPose
from brachis.task.limit_models import SpeedTable

if TYPE_CHECKING:
    from brachis.path import Path

_TURN = 2.0 * math.pi
_STATIONS = 401
_THOUSAND = 1000.0
_OR_NULL = ", or null for no limit"
_OF_SIZE = " for an arm of this size"
_OF_MASS = " for this mass"


@dataclass(frozen=True)
class UsualFigure:
    """What is usual of one figure.

    Attributes
    ----------
    message : str
        What a larger figure looks like.
    largest : float
        Largest usual figure in `unit`, or its ratio to the robot's own measure.
    unit : str
    aside : str
        What is said behind what is usual.
    """

    message: str
    largest: float
    unit: str
    aside: str = ""

    def at(self, where: str, value: float, scale: float = 1.0) -> Check:
        """Compare a value with `scale` times the largest one."""
        usual = self.largest * scale
        return Check(where, self.message, value, usual, self.unit, self.aside)


USUAL = {
    # Delta robots move at 10 m/s, and accelerate with 15 g.
    "tool_limits.speed": UsualFigure(
        "the limit looks like mm/s", 50.0, "m/s", _OR_NULL
    ),
    "tool_limits.process_speed": UsualFigure(
        "the limit looks like mm/s", 50.0, "m/s", _OR_NULL
    ),
    "tool_limits.acceleration": UsualFigure(
        "the limit looks like mm/s^2", 300.0, "m/s^2", _OR_NULL
    ),
    "tool_limits.angular_speed": UsualFigure(
        "the limit looks like degrees per second", 60.0, "rad/s", _OR_NULL
    ),
    "path_start": UsualFigure("yaw looks like degrees", 1.0, "rad"),  # turns
    "path": UsualFigure("the turn of yaw looks like degrees", 2.0, "rad"),  # turns
    "link": UsualFigure("the distance from the joint before looks like mm", 20.0, "m"),
    "robot.tool_offset.xyz": UsualFigure(  # times the arm's length
        "the distance looks like mm", 2.0, "m", _OF_SIZE
    ),
    "robot.mounting.xyz": UsualFigure("the distance looks like mm", 200.0, "m"),
    "robot.gravity": UsualFigure("the acceleration looks like mm/s^2", 100.0, "m/s^2"),
    # The strongest arms of 1 m reach carry 130 kg, and more with the square of the reach.
    "robot.payload.mass": UsualFigure("the mass looks like g", 150.0, "kg", _OF_SIZE),
    "robot.payload.com": UsualFigure(  # times the arm's length
        "the distance from the tool frame looks like mm", 1.0, "m", _OF_SIZE
    ),
    "robot.payload.inertia": UsualFigure(  # times mass and length squared
        "the inertia looks like kg mm^2", 1.0, "kg m^2", _OF_MASS
    ),
    # A body of the heaviest arms weighs 150 kg for each square metre of their reach.
    "body mass": UsualFigure("the mass looks like g", 1e3, "kg", _OF_SIZE),
    "body inertia": UsualFigure(  # times the mass: bodies 10 m wide
        "the inertia looks like kg mm^2", 100.0, "kg m^2", _OF_MASS
    ),
}
"""The largest usual figures, by the key of the task or the part of the robot."""


def of_task(task: Task) -> tuple[Issue, ...]:
    """Look at speeds and accelerations of the tool, and at the points that the path was fitted to."""
    return (*find_issues(_tool(task)), *_angles(task), *_points(task))


def of_places(
    task_map: TaskMap,
    path: Path,
    start: np.ndarray | None,
    end: np.ndarray | None,
    path_start: Sequence[float] | ToolPose | None,
) -> tuple[Issue, ...]:
    """Look at what a task says about where the robot is, in postures or along a path of joints.

    Parameters
    ----------
    task_map : TaskMap
    path : Path
    start, end : (n,) ndarray or None
        Postures, None where free.
    path_start : sequence of float, ToolPose or None
        As in the task.
    """
    return tuple(find_issues(_places(task_map, path, start, end, path_start)))


def _places(
    task_map: TaskMap,
    path: Path,
    start: np.ndarray | None,
    end: np.ndarray | None,
    path_start: Sequence[float] | ToolPose | None,
) -> Iterator[Check]:
    robot = task_map.robot
    along = (
        path.sample(np.linspace(0.0, 1.0, _STATIONS)).target
        if isinstance(task_map, JointSpace)
        else None
    )
    ranged = np.isfinite(robot.limits.position_lower) & np.isfinite(
        robot.limits.position_upper
    )
    for key, postures in (
        ("start.joints", start),
        ("path", along),
        ("end.joints", end),
    ):
        if postures is None:
            continue
        columns = zip(
            robot.joint_names,
            robot.revolute,
            postures.reshape(-1, robot.n).T,
            ranged,
            strict=True,
        )
        for name, turns, values, within in columns:
            if turns:
                # Along a path a joint without a range may wind up five times.
                turns_allowed = 2.0 if within else (1.0 if along is None else 5.0)
                value = float(values[np.argmax(np.abs(values))])
                shown = f"{value:.6g}"
                yield Check(
                    f"{key}.{name}",
                    "the position looks like degrees",
                    abs(value),
                    turns_allowed * _TURN + 1e-3,
                    "rad",
                    f"; {shown} degrees are {math.radians(value):.6g} rad",
                    shown,
                )
    if YAW in task_map.rows:
        yaw = path.sample(np.linspace(0.0, 1.0, _STATIONS)).target[:, -1]
        begins = abs(path_start[-1]) if isinstance(path_start, tuple) else 0.0
        yield USUAL["path_start"].at("path_start", begins, _TURN)
        yield USUAL["path"].at("path", float(np.ptp(yaw)), _TURN)


def of_end_time(t_end: float, least: float) -> tuple[Issue, ...]:
    """Look at a motion's end time, s, beside the `least` that the planner allows, s."""
    if t_end > 1.01 * least:
        return ()
    message = "the end time is the least that the planner knows, so that no limit holds the motion back"
    return (
        Issue(
            "t_end",
            message,
            f"{t_end:.6g} s",
            "more; see the units of limits, lengths and masses",
        ),
    )


def _tool(task: Task) -> Iterator[Check]:
    """Look at the largest of every kind of limit; feed rates have units of their own."""
    limits = task.tool_limits
    speed = limits.speed
    values = {
        "tool_limits.speed": speed.speed if isinstance(speed, SpeedTable) else [speed],
        "tool_limits.process_speed": [part.speed for part in limits.process_speed],
        "tool_limits.acceleration": [limits.acceleration],
        "tool_limits.angular_speed": [limits.angular_speed],
    }
    for key, given in values.items():
        yield USUAL[key].at(key, _largest(given))
    meant = "degrees per second" if task.task_space == "joints" else "mm/s"
    usual = UsualFigure(f"the speed looks like {meant}", 50.0, task.speed_unit)
    yield usual.at("boundary.start_speed", _largest([task.boundary.start_speed]))
    yield usual.at("boundary.end_speed", _largest([task.boundary.end_speed]))


def _largest(values: Iterable[float | None]) -> float:
    """Return the largest value; those from 1e5 on are written for "no limit"."""
    return max((one for one in values if one is not None and one < 1e5), default=0.0)


def _angles(task: Task) -> Iterator[Issue]:
    """Look for eighths of up to two turns in rad where degrees belong.

    They are written with two decimals: 3.14 is half a turn, 5.5 is not seven eighths.
    """
    robot = {
        key: getattr(task.robot, key).model_dump()
        for key in ("mounting", "tool_offset")
    }
    path = [segment.model_dump(exclude={"bspline", "spline"}) for segment in task.path]
    for key, degrees in _in_degrees("", {"robot": robot, "path": path}):
        eighths = round(degrees / (0.125 * _TURN))
        if 1 <= abs(eighths) <= 16 and abs(degrees - 0.125 * _TURN * eighths) < 2e-3:
            usual = f"{math.degrees(degrees):.4g} deg for that angle"
            yield Issue(key, "the angle looks like rad", f"{degrees:.6g} deg", usual)


def _in_degrees(key: str, content: object) -> Iterator[tuple[str, float]]:
    """Yield all numbers below keys that end in ``_deg``, with their dotted keys."""
    if isinstance(content, Mapping):
        for name, value in content.items():
            yield from _in_degrees(f"{key}.{name}" if key else name, value)
    elif isinstance(content, list | tuple):
        for number, value in enumerate(content):
            yield from _in_degrees(f"{key}[{number}]", value)
    elif isinstance(content, float) and re.search(r"_deg(\[\d\])?$", key):
        yield key, content


def _points(task: Task) -> Iterator[Issue]:
    for fit in task.fits:
        if fit.doubt:
            yield Issue(
                f"path: {fit.source}",
                fit.doubt,
                f"{fit.length:.4g} m",
                "a path within the robot's reach",
            )


def of_robot(robot: Robot) -> tuple[Issue, ...]:
    """Look at limits, friction, lengths, masses, payload and mounting of a robot."""
    bare = robot.with_payload(None) if robot.settings.payload else robot
    figures = (
        look(one)
        for look, one in ((limit_figures, bare), (_lengths, robot), (_masses, bare))
    )
    of_payload = _payload(robot, bare)
    return (
        *_scales(robot),
        *_friction(robot),
        *find_issues(itertools.chain(*figures, of_payload)),
    )


def _scales(robot: Robot) -> Iterator[Issue]:
    for kind, factor in robot.settings.limits.scale.model_dump().items():
        if factor > 10.0:
            message = "the factor raises limits far beyond what was stated"
            yield Issue(
                f"robot.limits.scale.{kind}",
                message,
                f"{factor:g}",
                "0.1 to 1; a percentage is divided by 100",
            )


def _friction(robot: Robot) -> Iterator[Issue]:
    """Look at damping of the URDF, which is often there to calm a simulation."""
    for i, damping in enumerate(robot.urdf_dynamics.friction["viscous"]):
        fastest = robot.limits.velocity[i]
        torque = robot.limits.torque[i]
        slow = (
            np.isfinite([fastest, torque]).all()
            and fastest <= FASTEST[robot.position_units[i]]
        )
        if slow and damping == robot.friction.viscous[i] and damping * fastest > torque:
            unit = UNITS["viscous"][robot.position_units[i]]
            message = "the damping of the URDF takes more than the largest torque at the largest speed"
            usual = f"below {torque / fastest:.3g} {unit}; viscous: null leaves it out"
            yield Issue(
                f"robot.friction.viscous.{robot.joint_names[i]}",
                message,
                f"{damping:.6g} {unit}",
                usual,
            )


def _lengths(robot: Robot) -> Iterator[Check]:
    """Look at the way from joint to joint, tool offset, mounting and gravity."""
    *links, last = link_lengths(robot)
    settings = robot.settings
    offset = math.hypot(*settings.tool_offset.xyz)
    for name, length in zip(robot.joint_names[1:], links, strict=True):
        yield USUAL["link"].at(f"URDF origin of {name}", length)
    yield USUAL["link"].at(f"URDF origin of {robot.tool_frame}", last - offset)
    for key, value, scale in (
        ("robot.tool_offset.xyz", offset, max(1.0, sum(links))),
        ("robot.mounting.xyz", math.hypot(*settings.mounting.xyz), 1.0),
        ("robot.gravity", math.hypot(*settings.gravity), 1.0),
    ):
        yield USUAL[key].at(key, value, scale)


def _payload(robot: Robot, bare: Robot) -> Iterator[Check]:
    """Look at what the tool carries."""
    payload = robot.settings.payload
    if payload is None:
        return
    size = max(1.0, sum(link_lengths(robot)) if robot.revolute.any() else reach(robot))
    usual = USUAL["robot.payload.mass"]
    # The strongest arms carry as much as they weigh.
    moved = sum(inertia.mass for inertia in list(bare.model.inertias)[1:])
    heaviest = min(usual.largest * size**2, 3.0 * moved or math.inf)
    inertia = payload.inertia
    moment = max(inertia.ixx, inertia.iyy, inertia.izz) if inertia else 0.0
    for key, value, scale in (
        ("robot.payload.mass", payload.mass, heaviest / usual.largest),
        ("robot.payload.com", math.hypot(*payload.com), size),
        ("robot.payload.inertia", moment, payload.mass * size**2),
    ):
        yield USUAL[key].at(key, value, scale)


def _masses(robot: Robot) -> Iterator[Check]:
    bodies = list(robot.model.inertias)[1:]
    size = max(1.0, reach(robot))
    for name, body in zip(robot.joint_names, bodies, strict=True):
        where = f"URDF inertials that joint {name} moves"
        moment = float(np.linalg.eigvalsh(body.inertia)[-1])
        yield USUAL["body mass"].at(where, body.mass, size**2)
        yield USUAL["body inertia"].at(where, moment, body.mass)


def check_within_reach(task_map: TaskMap, path: Path) -> None:
    """Refuse a path of the tool that is farther away than the arm's links and slides together can reach.

    Raises
    ------
    PathError
    """
    if not task_map.axes:  # of joints
        return
    s = np.linspace(0.0, 1.0, _STATIONS)
    robot = task_map.robot
    axes = list(task_map.axes)
    base = np.array(robot.model.jointPlacements[1].translation)[axes]
    away = np.linalg.norm(path.sample(s).target[:, : len(axes)] - base, axis=1)
    far = reach(robot)
    if not away.max() > far * (1.0 + 1e-3):
        return
    beyond = s[away > far]
    furthest = float(away.max())
    found, most = write_apart(furthest, far)
    # A path that is only a little too long is no more than three times as far.
    looks = furthest / _THOUSAND < 3.0 * far < furthest
    raise PathError(
        f"the path is out of reach from s = {beyond[0]:.3g} on",
        s_interval=(float(beyond[0]), float(beyond[-1])),
        found=f"{found} m away from the robot's first joint at s = {s[int(np.argmax(away))]:.3g}",
        allowed=f"at most {most} m, which is all links and slides in one line",
        hint=f"The path looks like mm: divided by 1000 it is {furthest / _THOUSAND:.3g} m away"
        if looks
        else "Shorten or move the path, or the robot's mounting",
    )
