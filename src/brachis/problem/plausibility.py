"""Checks for implausible figures of a robot and along its path: an unusually large figure may be in the wrong unit.

The largest usual figures are in `task_plausibility`; those for joint limits are in `brachis.task.LIMIT_KINDS`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from brachis.common.words import write_apart
from brachis.errors import PathError
from brachis.problem.task_plausibility import USUAL, check_figure
from brachis.robot import Robot, TaskMap
from brachis.robot.joints import TURN, UNITS
from brachis.robot.plausibility import (
    Issue,
    angle_issue,
    distance_hint,
    distances_from_base,
    find_locked_in_degrees,
    issue_above,
    link_lengths,
    reach,
)
from brachis.robot.task_map import JointSpace
from brachis.robot.task_map.protocol import ANGLES
from brachis.robot.urdf_bodies import inertia_matrix, mass_of
from brachis.robot.urdf_elements import read_tree
from brachis.task import LIMIT_KINDS
from brachis.task.limit_kinds import FASTEST, UsualLimit
from brachis.task.points.points import steps_of

if TYPE_CHECKING:
    from brachis.path import Path
    from brachis.problem.problem import Problem


def of_places(problem: Problem) -> tuple[Issue, ...]:
    """Check the positions and angles that a task states, in postures and along its paths, and the robots of parts."""
    issues: dict[Issue, None] = {}
    for number, part in enumerate(problem.parts):
        of_parts = of_robot(part.robot) if problem.is_chain else ()
        for issue in (*_places_of_part(part), *of_parts):
            where = problem.key_of(number, issue.where)
            if issue not in of_parts or where.startswith("program["):
                issues[replace(issue, where=where)] = None
    return tuple(issues)


def _places_of_part(problem: Problem) -> list[Issue]:
    """Check the joint positions and tool angles of a part, or of a task without parts."""
    task_map = problem.task_map
    along = problem.path.sample(np.linspace(0.0, 1.0, 401)).target
    issues: list[Issue] = []
    for end, posture in problem.given_postures.items():
        key = problem.task.posture_key(end)
        issues += of_postures(problem.robot, key, posture)
    if isinstance(task_map, JointSpace):
        issues += of_postures(problem.robot, "path", along)
    if task_map.angles and task_map.angles[0] in ANGLES:
        path_start = problem.task.path_start
        begins = abs(path_start[-1]) if isinstance(path_start, tuple) else 0.0
        turn = float(np.ptp(along[:, -1]))
        issues += [*check_figure("path_start", begins), *check_figure("path", turn)]
    return issues


def of_postures(robot: Robot, key: str, postures: np.ndarray) -> Iterator[Issue]:
    """Check the largest angle of every joint in postures, (n,) or (K, n)."""
    limits = robot.limits
    is_ranged = np.isfinite(limits.position_lower) & np.isfinite(limits.position_upper)
    # A joint without a range may have made five turns. If a posture is in degrees, at least one joint exceeds this
    # figure.
    farthest = np.abs(postures[..., robot.revolute]).max(initial=0.0)
    turns = 1.0 if farthest > 5.0 * TURN + 1e-3 else 5.0
    for i in np.flatnonzero(robot.revolute):
        values = postures.reshape(-1, robot.n)[:, i]
        value = float(values[np.argmax(np.abs(values))])
        usual = (2.0 if is_ranged[i] else turns) * TURN + 1e-3
        # Only the key of a posture has a dot; a path and an option have none.
        advice = f"; in a task file: !degrees {value:.6g}" if "." in key else ""
        yield from angle_issue(f"{key}.{robot.joint_names[i]}", value, usual, advice)


def of_end_time(t_end: float, least: float) -> tuple[Issue, ...]:
    """Compare a motion's end time, s, with the `least` end time that the planner allows, s."""
    if t_end > 1.01 * least:
        return ()
    message = (
        "the end time is the smallest that the planner allows, so no limit is active"
    )
    usual = "more; check the units of limits, lengths and masses"
    return (Issue("t_end", message, f"{t_end:.6g} s", usual),)


def of_robot(robot: Robot) -> tuple[Issue, ...]:
    """Check the limits, friction, lengths, masses, payload and mounting of a robot."""
    bare = robot.with_payload(None) if robot.settings.payload else robot
    return (
        *_scales(robot),
        *_friction(robot),
        *_magnitudes(bare),
        *_ranges(bare),
        *_curves(bare),
        *_lengths(robot),
        *_masses(bare),
        *_payload(robot, bare),
        *find_locked_in_degrees(robot),
    )


def _scales(robot: Robot) -> Iterator[Issue]:
    message = "the factor raises limits far above the stated values"
    usual = "0.1 to 1; a percentage is divided by 100"
    for kind, factor in robot.settings.limits.scale.model_dump().items():
        if factor > 10.0:
            yield Issue(f"robot.limits.scale.{kind}", message, f"{factor:g}", usual)


def _friction(robot: Robot) -> Iterator[Issue]:
    """Check the damping in the URDF, which often serves only to stabilise a simulation."""
    message = "the damping in the URDF needs more than the maximum torque at the maximum speed"
    for i, damping in enumerate(robot.urdf_dynamics.friction["viscous"]):
        fastest = robot.limits.velocity[i]
        torque = robot.limits.torque[i]
        position_unit = robot.position_units[i]
        is_unchanged = damping == robot.friction.viscous[i]
        is_slow = np.isfinite(torque) and fastest <= FASTEST[position_unit]
        if is_unchanged and is_slow and damping * fastest > torque:
            unit = UNITS["viscous"][position_unit]
            usual = f"below {torque / fastest:.3g} {unit}; viscous: null leaves it out"
            where = f"robot.friction.viscous.{robot.joint_names[i]}"
            yield Issue(where, message, f"{damping:.6g} {unit}", usual)


def _lengths(robot: Robot) -> Iterator[Issue]:
    """Check the distances from joint to joint, the tool offset, the mounting and gravity."""
    *links, last = link_lengths(robot)
    settings = robot.settings
    offset = math.hypot(*settings.tool_offset.xyz)
    names = (*robot.joint_names[1:], robot.tool_frame)
    for name, length in zip(names, (*links, last - offset), strict=True):
        yield from check_figure("link", length, where=f"URDF origin of {name}")
    yield from check_figure("robot.tool_offset.xyz", offset, max(1.0, sum(links)))
    yield from check_figure("robot.mounting.xyz", math.hypot(*settings.mounting.xyz))
    yield from check_figure("robot.gravity", math.hypot(*settings.gravity))


def _payload(robot: Robot, bare: Robot) -> Iterator[Issue]:
    """Check the payload."""
    payload = robot.settings.payload
    if payload is None:
        return
    size = max(1.0, sum(link_lengths(robot)) if robot.revolute.any() else reach(robot))
    # The strongest arms carry as much as they weigh.
    moved = pin.computeTotalMass(bare.model)
    heaviest = (3.0 * moved or math.inf) / USUAL["robot.payload.mass"][1]
    inertia = payload.inertia
    moment = max(inertia.ixx, inertia.iyy, inertia.izz) if inertia else 0.0
    yield from check_figure("robot.payload.mass", payload.mass, min(size**2, heaviest))
    yield from check_figure("robot.payload.com", math.hypot(*payload.com), size)
    yield from check_figure("robot.payload.inertia", moment, payload.mass * size**2)


def _masses(robot: Robot) -> Iterator[Issue]:
    size = max(1.0, reach(robot))
    for body in robot.urdf_dynamics.bodies:
        where = f"URDF inertials that joint {body.joint} moves"
        moment = float(np.linalg.eigvalsh(body.inertia)[-1])
        yield from check_figure("body mass", body.mass, size**2, where)
        yield from check_figure("body inertia", moment, body.mass, where)
    links = read_tree(robot.urdf, robot.source).links
    for name, (joint, _) in robot.urdf_dynamics.links.items():
        if joint and robot.has_masses and not mass_of(links[name]):
            moment = float(inertia_matrix(links[name]).max())
            yield from check_figure(
                "massless inertia", moment, where=f"URDF link {name}"
            )


def say_how_far(task_map: TaskMap, path: Path, s: float) -> str:
    """Say how far the tool has moved at a path coordinate; say nothing at the start or for a prescribed joint path."""
    if not task_map.axes or s == 0.0:
        return ""
    places = path.sample(np.append(np.linspace(0.0, s, 201), np.linspace(s, 1.0, 201)))
    positions = places.target[:, : len(task_map.axes)]
    steps = steps_of(positions)
    return f", after {steps[:200].sum():.3g} m of {steps.sum():.3g} m"


def check_within_reach(problem: Problem) -> None:
    """Refuse tool paths that are farther away than the arm's links and slides together can reach.

    Raises
    ------
    PathError
    """
    for number, part in enumerate(problem.parts):
        try:
            _check_path_within_reach(part)
        except PathError as error:
            problem.name_keys(number, error)
            raise


def _check_path_within_reach(problem: Problem) -> None:
    """Refuse the path of a part."""
    task_map = problem.task_map
    path = problem.path
    if not task_map.axes:  # a prescribed joint path, or a move
        return
    s = np.linspace(0.0, 1.0, 401)
    robot = task_map.robot
    positions = path.sample(s).target[:, : len(task_map.axes)]
    away = distances_from_base(robot, task_map.axes, positions)
    far = reach(robot)
    furthest = float(away.max())
    if not furthest > far * (1.0 + 1e-3):
        return
    beyond = s[away > far]
    distance, largest = write_apart(furthest, far)
    raise PathError(
        f"the path is out of reach from s = {beyond[0]:.3g} on{say_how_far(task_map, path, beyond[0])}",
        s_interval=(float(beyond[0]), float(beyond[-1])),
        found=f"{distance} m away from the robot's first joint at s = {s[int(np.argmax(away))]:.3g}",
        allowed=f"at most {largest} m, the length of all links and slides in one line",
        hint=distance_hint(furthest, far)
        or "Shorten or move the path, or the robot's mounting",
    )


def _magnitudes(robot: Robot) -> Iterator[Issue]:
    """Check the limits that are magnitudes, not ranges, of a robot without payload."""
    for kind, row in LIMIT_KINDS.items():
        usual = row.usual
        if usual is None:
            continue
        values = np.abs(robot.limits.both_ways(kind)).max(axis=0)
        values = values / getattr(robot.settings.limits.scale, kind)
        if usual.overridden:
            values = values / robot.settings.speed_override
        for i, value in enumerate(values.tolist()):
            has_curve = usual.by_curve and robot.limits.torque_speed[i]
            if has_curve or not 0.0 < value < math.inf:
                continue
            largest = _largest_usual(robot, usual, i)
            # A power of ten stands for "no limit"; for torques, only a power that cannot be a torque in mNm.
            is_placeholder = round(math.log10(value), 9).is_integer()
            if usual.compares_weight:
                is_stated = value == _stated(robot, usual, i)
                is_placeholder &= is_stated or value > 1e3 * largest
            if is_placeholder:
                continue
            unit = robot.position_units[i]
            yield from issue_above(
                f"robot.limits.{kind}.{robot.joint_names[i]}",
                f"the {row.name.replace('_', ' ')} limit looks like {usual.mistaken_unit[unit]}",
                value,
                largest,
                row.units[unit],
            )


def _stated(robot: Robot, usual: UsualLimit, joint: int) -> float | None:
    """Return the limit in the URDF with which a joint's limit is compared."""
    kind = usual.urdf_kind
    return robot.urdf_limits[joint].of_kind(kind) if kind else None


def _largest_usual(robot: Robot, usual: UsualLimit, joint: int) -> float:
    """Return the largest usual limit of a joint."""
    unit = robot.position_units[joint]
    candidates = [usual.largest[unit]]
    # Torque that holds the arm's own weight at full reach, Nm.
    holding = pin.computeTotalMass(robot.model) * 9.81 * sum(link_lengths(robot))
    if usual.compares_weight and unit == "rad" and holding > 0.0:
        # Arms hold a tenth to five times their own weight at full reach.
        candidates.append(50.0 * holding)
    stated = _stated(robot, usual, joint)
    # URDFs often state 1 for an unknown limit.
    if stated and stated != 1.0:
        candidates.append(max(usual.urdf_factor * stated, usual.urdf_least))
    return float(min(candidates))


def _ranges(robot: Robot) -> Iterator[Issue]:
    """Check position ranges: joints with cables can make a dozen turns at most."""
    limits = robot.limits
    columns = zip(
        robot.joint_names,
        robot.position_units,
        limits.position_lower,
        limits.position_upper,
        robot.urdf_limits,
        strict=True,
    )
    for name, unit, lower, upper, known in columns:
        # Few ranges are narrower than 120 degrees, and few rails are longer than 30 m.
        usual = 120.0 if unit == "rad" else 50.0
        stated = (known.upper or 0.0) - (known.lower or 0.0)
        if stated > 0.0:
            least = 4.0 * math.pi if unit == "rad" else 5.0
            usual = min(usual, max(5.0 * stated, least))
        # A larger figure stands for "no limit": ranges in degrees end at 720 at most.
        if max(abs(lower), abs(upper)) <= (800.0 if unit == "rad" else 1e5):
            yield from issue_above(
                f"robot.limits.position.{name}",
                f"the position range looks like {'degrees' if unit == 'rad' else 'mm'}",
                upper - lower,
                usual,
                unit,
                " wide, or open (null)",
                f"[{lower:.6g}, {upper:.6g}]",
            )


def _curves(robot: Robot) -> Iterator[Issue]:
    """Check the torques and the speeds of torque-speed curves."""
    scale = robot.settings.limits.scale.torque
    usual_torque = LIMIT_KINDS["torque"].usual
    assert usual_torque is not None
    # Without load, motors turn at up to twice the rated speed; a speed in rpm is 9.5 times the same speed in rad/s.
    rpm = {"rad": "rpm", "m": "mm per second"}
    usual_speed = UsualLimit(rpm, FASTEST, "velocity", 5.0, 5.0)
    behind_gear = "; at the joint, after its gear"
    for i, curve in enumerate(robot.limits.torque_speed):
        if not curve:
            continue
        unit = robot.position_units[i]
        last_speed = curve[-1][0]
        stall_torque = curve[0][1] / scale
        for title, value, kind, usual, aside in (
            ("last speed", last_speed, "velocity", usual_speed, behind_gear),
            ("torque", stall_torque, "torque", usual_torque, ""),
        ):
            yield from issue_above(
                f"robot.limits.torque_speed.{robot.joint_names[i]}",
                f"the {title} of the curve looks like {usual.mistaken_unit[unit]}",
                value,
                _largest_usual(robot, usual, i),
                UNITS[kind][unit],
                aside,
            )
