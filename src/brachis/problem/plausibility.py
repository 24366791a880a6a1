"""What a task asks for: places, limits of the tool, points, end time.

The robot: limits, friction, lengths, masses, payload.

Limits of the joints beside what the URDF says of the robot: its limits, its ranges, its weight.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError, write_apart
from brachis.robot import Robot, TaskMap
from brachis.robot.joints import UNITS
from brachis.robot.limits import STATED
from brachis.robot.plausibility import Figure, Remark, link_lengths, reach, remarks
from brachis.robot.task_map import JointSpace
from brachis.robot.task_map.protocol import YAW
from brachis.task import Task, ToolPose
from brachis.task.limit_models import SpeedTable

if TYPE_CHECKING:
    from brachis.path import Path

_TURN = 2.0 * math.pi
_WINDING = 5.0
"""Turns of a joint without a range that a path of joints may ask for: in degrees, 30 are nearly as many."""
_ROUNDED = 1e-3
_STATIONS = 401
_THOUSAND = 1000.0
_HARDLY = 3.0
"""A path that is so much farther away than the robot reaches is not a path that is a little too long."""
_EIGHTHS, _ROUNDING = 16, 2e-3
"""Angles in rad up to two turns are looked for, within so many rad: 3.14 is half a turn, 5.5 is not seven eighths."""
_OPEN = 1e5
"""A limit beyond this is written for "no limit"."""


def of_task(task: Task) -> tuple[Remark, ...]:
    """Look at speeds and accelerations of the tool, and at the points that the path was fitted to."""
    return (*remarks(_tool(task)), *_angles(task), *_points(task))


def of_places(
    task_map: TaskMap,
    path: Path,
    start: np.ndarray | None,
    end: np.ndarray | None,
    path_start: Sequence[float] | ToolPose | None,
) -> tuple[Remark, ...]:
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
    return tuple(remarks(_places(task_map, path, start, end, path_start)))


def _places(
    task_map: TaskMap,
    path: Path,
    start: np.ndarray | None,
    end: np.ndarray | None,
    path_start: Sequence[float] | ToolPose | None,
) -> Iterator[Figure]:
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
                most = 2.0 if within else (1.0 if along is None else _WINDING)
                usual, value = most * _TURN, float(values[np.argmax(np.abs(values))])
                looks, shown = "the position looks like degrees", f"{value:.6g}"
                aside = f"; {shown} degrees are {math.radians(value):.6g} rad"
                yield Figure(
                    f"{key}.{name}",
                    looks,
                    abs(value),
                    usual + _ROUNDED,
                    "rad",
                    aside,
                    shown,
                )
    if YAW in task_map.rows:
        yaw = path.sample(np.linspace(0.0, 1.0, _STATIONS)).target[:, -1]
        begins = abs(path_start[-1]) if isinstance(path_start, tuple) else 0.0
        yield Figure("path_start", "yaw looks like degrees", begins, _TURN, "rad")
        yield Figure(
            "path",
            "the turn of yaw looks like degrees",
            float(np.ptp(yaw)),
            2.0 * _TURN,
            "rad",
        )


def of_end_time(t_end: float, least: float) -> tuple[Remark, ...]:
    """Look at a motion's end time, s, beside the `least` that the planner allows, s."""
    if t_end > 1.01 * least:
        return ()
    message = "the end time is the least that the planner knows, so that no limit holds the motion back"
    return (
        Remark(
            "t_end",
            message,
            f"{t_end:.6g} s",
            "more; see the units of limits, lengths and masses",
        ),
    )


def _tool(task: Task) -> Iterator[Figure]:
    """Look at the largest of every kind of limit; feed rates have units of their own."""
    limits, ends = task.tool_limits, task.boundary
    meant_at_ends = "degrees per second" if task.task_space == "joints" else "mm/s"
    speeds = (
        limits.speed.speed if isinstance(limits.speed, SpeedTable) else [limits.speed]
    )
    processes = [part.speed for part in limits.process_speed]
    # Delta robots move at 10 m/s, and accelerate with 15 g.
    for where, values, most, unit, meant in (
        ("tool_limits.speed", speeds, 50.0, "m/s", "mm/s"),
        ("tool_limits.process_speed", processes, 50.0, "m/s", "mm/s"),
        ("tool_limits.acceleration", [limits.acceleration], 300.0, "m/s^2", "mm/s^2"),
        (
            "tool_limits.angular_speed",
            [limits.angular_speed],
            60.0,
            "rad/s",
            "degrees per second",
        ),
        (
            "boundary.start_speed",
            [ends.start_speed],
            50.0,
            task.speed_unit,
            meant_at_ends,
        ),
        ("boundary.end_speed", [ends.end_speed], 50.0, task.speed_unit, meant_at_ends),
    ):
        largest = max(
            (value for value in values if value is not None and value < _OPEN),
            default=0.0,
        )
        limit = where.startswith("tool_limits")
        what, aside = ("limit", ", or null for no limit") if limit else ("speed", "")
        yield Figure(
            where, f"the {what} looks like {meant}", largest, most, unit, aside
        )


def _angles(task: Task) -> Iterator[Remark]:
    """Look for eighths of a turn in rad where degrees belong."""
    robot = {
        key: getattr(task.robot, key).model_dump()
        for key in ("mounting", "tool_offset")
    }
    path = [segment.model_dump(exclude={"bspline", "spline"}) for segment in task.path]
    for key, degrees in _in_degrees("", {"robot": robot, "path": path}):
        eighths = round(degrees / (0.125 * _TURN))
        if (
            1 <= abs(eighths) <= _EIGHTHS
            and abs(degrees - 0.125 * _TURN * eighths) < _ROUNDING
        ):
            usual = f"{math.degrees(degrees):.4g} deg for that angle"
            yield Remark(key, "the angle looks like rad", f"{degrees:.6g} deg", usual)


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


def _points(task: Task) -> Iterator[Remark]:
    for fit in task.fits:
        if fit.doubt:
            yield Remark(
                f"path: {fit.source}",
                fit.doubt,
                f"{fit.length:.4g} m",
                "a path within the robot's reach",
            )


_G = 9.81
_HOLDS = 50.0
"""Arms hold a tenth to five times their own weight at full reach."""
_WIDEST = {"rad": 120.0, "m": 50.0}
"""Joints with cables make two turns either way, others may be given a dozen turns; in degrees, few ranges are narrower
than 120. Few rails are longer than 30 m."""
_WIDER, _AT_LEAST_WIDE = 5.0, {"rad": 4.0 * math.pi, "m": 5.0}
"""So much wider than the URDF's, and than these, is no range of the same joint."""
_OPEN_END = {"rad": 800.0, "m": 1e5}
"""A range end beyond this is written for "no limit": in degrees, ranges end at two turns, 720."""
_UNKNOWN = 1.0
"""Written in URDFs for a limit that nobody knows."""
_MILLI = 1e3
_NO_LOAD = 5.0
"""Motors without load turn at up to twice the rated speed; rpm are 9.5 times rad/s, and a gear makes it more."""


@dataclass(frozen=True)
class Rule:
    """What is usual of the limits of one kind.

    Attributes
    ----------
    looks : dict of str to str
        What unit larger ones look like, by the unit of the joint's position.
    most : dict of str to float
        Largest usual limit, whatever the robot.
    stated : str
        Kind of limit that the URDF states and that it is compared with; empty where there is none.
    times : float
        So many times the URDF's are usual.
    least : float
        But whatever the URDF states, this is.
    weighed : bool
        Whether a torque is compared with the arm's weight.
    overridden : bool
        Whether the speed override takes its share.
    by_curve : bool
        Whether a torque-speed curve takes its place.
    """

    looks: dict[str, str]
    most: dict[str, float]
    stated: str = ""
    times: float = math.inf
    least: float = 0.0
    weighed: bool = False
    overridden: bool = False
    by_curve: bool = False


FASTEST = {"rad": 60.0, "m": 50.0}
"""The quickest axes of small SCARA and delta robots turn at 50 rad/s; rails move at 10 m/s. In degrees and mm: more."""
_ANY = {"rad": math.inf, "m": math.inf}
_TORQUE = Rule({"rad": "mNm", "m": "mN"}, _ANY, "torque", 100.0, weighed=True)
_VELOCITY = Rule(
    {"rad": "degrees per second", "m": "mm per second"},
    FASTEST,
    "velocity",
    10.0,
    10.0,
    overridden=True,
)
RULES = {
    "torque": replace(_TORQUE, by_curve=True),
    "rms_torque": _TORQUE,
    "velocity": _VELOCITY,
    "acceleration": Rule(
        {"rad": "degrees per second^2", "m": "mm/s^2"}, {"rad": 500.0, "m": 300.0}
    ),
}
"""By kind of limit; wrists of small robots accelerate with 200 rad/s^2, delta robots with 150 m/s^2."""


def limit_figures(robot: Robot) -> Iterator[Figure]:
    """Yield all figures of the limits of a robot without payload."""
    for look in (_magnitudes, _ranges, _curves):
        yield from look(robot)


def _magnitudes(robot: Robot) -> Iterator[Figure]:
    for kind, rule in RULES.items():
        values = np.abs(robot.limits.both_ways(kind)).max(axis=0) / getattr(
            robot.settings.limits.scale, kind
        )
        if rule.overridden:
            values = values / robot.settings.speed_override
        usual = _usual(robot, rule)
        for i, (name, unit, value) in enumerate(
            zip(robot.joint_names, robot.position_units, values, strict=True)
        ):
            curved = rule.by_curve and robot.limits.torque_speed[i]
            if not curved and not _placeholder(
                value, rule, usual(i), _stated(robot, rule, i)
            ):
                message = (
                    f"the {kind.replace('_', ' ')} limit looks like {rule.looks[unit]}"
                )
                yield Figure(
                    f"robot.limits.{kind}.{name}",
                    message,
                    float(value),
                    usual(i),
                    UNITS[kind][unit],
                )


def _placeholder(value: float, rule: Rule, usual: float, stated: float | None) -> bool:
    """Tell whether a limit is written for "no limit": a power of ten, of torques one that no figure in mNm can be."""
    if not 0.0 < value < math.inf:
        return True
    if not round(math.log10(value), 9).is_integer():
        return False
    return not rule.weighed or value == stated or value > _MILLI * usual


def _stated(robot: Robot, rule: Rule, joint: int) -> float | None:
    """Return the URDF's limit that a joint's is compared with."""
    found: float | None = getattr(
        robot.stated_limits[joint], STATED.get(rule.stated, ""), None
    )
    return found


def _usual(robot: Robot, rule: Rule) -> Callable[[int], float]:
    """Return what gives the largest usual limit of a joint."""
    weight = (
        sum(inertia.mass for inertia in list(robot.model.inertias)[1:])
        * _G
        * sum(link_lengths(robot))
    )

    def of_joint(joint: int) -> float:
        unit, stated = robot.position_units[joint], _stated(robot, rule, joint)
        most = [rule.most[unit]]
        if rule.weighed and unit == "rad" and weight > 0.0:
            most.append(_HOLDS * weight)
        if stated and stated != _UNKNOWN:
            most.append(max(rule.times * stated, rule.least))
        return float(min(most))

    return of_joint


def _ranges(robot: Robot) -> Iterator[Figure]:
    limits, stated = robot.limits, {"rad": "degrees", "m": "mm"}
    columns = zip(
        robot.joint_names,
        robot.position_units,
        limits.position_lower,
        limits.position_upper,
        robot.stated_limits,
        strict=True,
    )
    for name, unit, lower, upper, known in columns:
        usual = _WIDEST[unit]
        if (
            known.lower is not None
            and known.upper is not None
            and known.upper > known.lower
        ):
            usual = min(
                usual, max(_WIDER * (known.upper - known.lower), _AT_LEAST_WIDE[unit])
            )
        if max(abs(lower), abs(upper)) <= _OPEN_END[unit]:
            message, shown = (
                f"the position range looks like {stated[unit]}",
                f"[{lower:.6g}, {upper:.6g}]",
            )
            key = f"robot.limits.position.{name}"
            yield Figure(
                key, message, upper - lower, usual, unit, " wide, or open (null)", shown
            )


def _curves(robot: Robot) -> Iterator[Figure]:
    """Look at the torques and the speeds of torque-speed curves."""
    scale = robot.settings.limits.scale.torque
    torque = _usual(robot, _TORQUE)
    velocity = _usual(robot, Rule({}, FASTEST, "velocity", _NO_LOAD, _NO_LOAD))
    rows = zip(
        robot.joint_names, robot.position_units, robot.limits.torque_speed, strict=True
    )
    for i, (name, unit, curve) in enumerate(rows):
        if not curve:
            continue
        key, meant = (
            f"robot.limits.torque_speed.{name}",
            {"rad": "rpm", "m": "mm per second"}[unit],
        )
        said = "the last speed of the curve looks like"
        aside = "; at the joint, behind its gear"
        yield Figure(
            key,
            f"{said} {meant}",
            curve[-1][0],
            velocity(i),
            UNITS["velocity"][unit],
            aside,
        )
        said = f"the torque of the curve looks like {_TORQUE.looks[unit]}"
        yield Figure(key, said, curve[0][1] / scale, torque(i), UNITS["torque"][unit])


_LARGEST_SCALE = 10.0
_LONGEST_LINK = 20.0
_HEAVIEST = 1e3
"""A moving body of the heaviest arms weighs 150 kg for each square metre of their reach."""
_WIDEST_BODY = 10.0
_HEAVIEST_PAYLOAD = 150.0
"""What an arm of 1 m carries, and more with the square of its reach: the strongest ones carry 130 kg there."""
_TIMES_ITSELF = 3.0
"""The strongest arms carry as much as they weigh."""
_LONGEST_OFFSET = 2.0
"""Times the arm's own length."""
_FARTHEST_BASE = 200.0
"""m; halls are smaller."""
_MOST_GRAVITY = 100.0
_OF_SIZE = " for an arm of this size"


def of_robot(robot: Robot) -> tuple[Remark, ...]:
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
        *remarks(itertools.chain(*figures, of_payload)),
    )


def _scales(robot: Robot) -> Iterator[Remark]:
    for kind, factor in robot.settings.limits.scale.model_dump().items():
        if factor > _LARGEST_SCALE:
            message = "the factor raises limits far beyond what was stated"
            yield Remark(
                f"robot.limits.scale.{kind}",
                message,
                f"{factor:g}",
                "0.1 to 1; a percentage is divided by 100",
            )


def _friction(robot: Robot) -> Iterator[Remark]:
    """Look at damping of the URDF, which is often there to calm a simulation."""
    limits, stated = robot.limits, robot.stated.friction["viscous"]
    for i, damping in enumerate(stated):
        fastest, torque = limits.velocity[i], limits.torque[i]
        slow = (
            np.isfinite([fastest, torque]).all()
            and fastest <= FASTEST[robot.position_units[i]]
        )
        if slow and damping == robot.friction.viscous[i] and damping * fastest > torque:
            unit = UNITS["viscous"][robot.position_units[i]]
            message = "the damping of the URDF takes more than the largest torque at the largest speed"
            usual = f"below {torque / fastest:.3g} {unit}; viscous: null leaves it out"
            yield Remark(
                f"robot.friction.viscous.{robot.joint_names[i]}",
                message,
                f"{damping:.6g} {unit}",
                usual,
            )


def _lengths(robot: Robot) -> Iterator[Figure]:
    """Look at the way from joint to joint, the tool offset, and where the robot is mounted."""
    *links, last = link_lengths(robot)
    offset, mounted = (
        math.hypot(*placed.xyz)
        for placed in (robot.settings.tool_offset, robot.settings.mounting)
    )
    looks = "the distance from the joint before looks like mm"
    for name, length in zip(robot.joint_names[1:], links, strict=True):
        yield Figure(f"URDF origin of {name}", looks, length, _LONGEST_LINK, "m")
    yield Figure(
        f"URDF origin of {robot.tool_frame}", looks, last - offset, _LONGEST_LINK, "m"
    )
    size = _LONGEST_OFFSET * max(1.0, sum(links))
    yield Figure(
        "robot.tool_offset.xyz",
        "the distance looks like mm",
        offset,
        size,
        "m",
        _OF_SIZE,
    )
    yield Figure(
        "robot.mounting.xyz", "the distance looks like mm", mounted, _FARTHEST_BASE, "m"
    )
    pull = math.hypot(*robot.settings.gravity)
    yield Figure(
        "robot.gravity",
        "the acceleration looks like mm/s^2",
        pull,
        _MOST_GRAVITY,
        "m/s^2",
    )


def _payload(robot: Robot, bare: Robot) -> Iterator[Figure]:
    """Look at what the tool carries."""
    payload = robot.settings.payload
    if payload is None:
        return
    size = max(1.0, sum(link_lengths(robot)) if robot.revolute.any() else reach(robot))
    moved = sum(inertia.mass for inertia in list(bare.model.inertias)[1:])
    heaviest = min(_HEAVIEST_PAYLOAD * size**2, _TIMES_ITSELF * moved or math.inf)
    yield Figure(
        "robot.payload.mass",
        "the mass looks like g",
        payload.mass,
        heaviest,
        "kg",
        _OF_SIZE,
    )
    away = math.hypot(*payload.com)
    message = "the distance from the tool frame looks like mm"
    yield Figure("robot.payload.com", message, away, size, "m", _OF_SIZE)
    inertia = payload.inertia
    moment = max(inertia.ixx, inertia.iyy, inertia.izz) if inertia else 0.0
    most = payload.mass * size**2
    yield Figure(
        "robot.payload.inertia",
        "the inertia looks like kg mm^2",
        moment,
        most,
        "kg m^2",
        " for this mass",
    )


def _masses(robot: Robot) -> Iterator[Figure]:
    heaviest = _HEAVIEST * max(1.0, reach(robot)) ** 2
    for name, inertia in zip(
        robot.joint_names, list(robot.model.inertias)[1:], strict=True
    ):
        where = f"URDF inertials that joint {name} moves"
        yield Figure(
            where, "the mass looks like g", inertia.mass, heaviest, "kg", _OF_SIZE
        )
        moment, most = (
            float(np.linalg.eigvalsh(inertia.inertia)[-1]),
            inertia.mass * _WIDEST_BODY**2,
        )
        yield Figure(
            where,
            "the inertia looks like kg mm^2",
            moment,
            most,
            "kg m^2",
            " for this mass",
        )


def check_within_reach(task_map: TaskMap, path: Path) -> None:
    """Refuse a path of the tool that is farther away than the arm's links and slides together can reach.

    Raises
    ------
    PathError
    """
    if not task_map.axes:  # of joints
        return
    s = np.linspace(0.0, 1.0, _STATIONS)
    robot, axes = task_map.robot, list(task_map.axes)
    base = np.array(robot.model.jointPlacements[1].translation)[axes]
    away = np.linalg.norm(path.sample(s).target[:, : len(axes)] - base, axis=1)
    far = reach(robot)
    if not away.max() > far * (1.0 + _ROUNDED):
        return
    beyond = s[away > far]
    furthest = float(away.max())
    found, most = write_apart(furthest, far)
    looks = furthest > _HARDLY * far and furthest / _THOUSAND < _HARDLY * far
    raise PathError(
        f"the path is out of reach from s = {beyond[0]:.3g} on",
        s_interval=(float(beyond[0]), float(beyond[-1])),
        found=f"{found} m away from the robot's first joint at s = {s[int(np.argmax(away))]:.3g}",
        allowed=f"at most {most} m, which is all links and slides in one line",
        hint=f"The path looks like mm: divided by 1000 it is {furthest / _THOUSAND:.3g} m away"
        if looks
        else "Shorten or move the path, or the robot's mounting",
    )
