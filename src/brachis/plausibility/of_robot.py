"""The robot: limits, friction, lengths, masses, payload."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from brachis.plausibility.figure import Figure, remarks
from brachis.plausibility.of_limits import FASTEST, limit_figures
from brachis.plausibility.remark import Remark
from brachis.plausibility.size import link_lengths, reach
from brachis.robot import Robot
from brachis.robot.units import UNITS

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
    figures = (look(one) for look, one in ((limit_figures, bare), (_lengths, robot), (_masses, bare)))
    of_payload = _payload(robot, bare)
    return (*_scales(robot), *_friction(robot), *remarks(itertools.chain(*figures, of_payload)))


def _scales(robot: Robot) -> Iterator[Remark]:
    for kind, factor in robot.settings.limits.scale.model_dump().items():
        if factor > _LARGEST_SCALE:
            message = "the factor raises limits far beyond what was stated"
            yield Remark(
                f"robot.limits.scale.{kind}", message, f"{factor:g}", "0.1 to 1; a percentage is divided by 100"
            )


def _friction(robot: Robot) -> Iterator[Remark]:
    """Look at damping of the URDF, which is often there to calm a simulation."""
    limits, stated = robot.limits, robot.stated.friction["viscous"]
    for i, damping in enumerate(stated):
        fastest, torque = limits.velocity[i], limits.torque[i]
        slow = np.isfinite([fastest, torque]).all() and fastest <= FASTEST[robot.position_units[i]]
        if slow and damping == robot.friction.viscous[i] and damping * fastest > torque:
            unit = UNITS["viscous"][robot.position_units[i]]
            message = "the damping of the URDF takes more than the largest torque at the largest speed"
            usual = f"below {torque / fastest:.3g} {unit}; viscous: null leaves it out"
            yield Remark(f"robot.friction.viscous.{robot.joint_names[i]}", message, f"{damping:.6g} {unit}", usual)


def _lengths(robot: Robot) -> Iterator[Figure]:
    """Look at the way from joint to joint, the tool offset, and where the robot is mounted."""
    *links, last = link_lengths(robot)
    offset, mounted = (math.hypot(*placed.xyz) for placed in (robot.settings.tool_offset, robot.settings.mounting))
    looks = "the distance from the joint before looks like mm"
    for name, length in zip(robot.joint_names[1:], links, strict=True):
        yield Figure(f"URDF origin of {name}", looks, length, _LONGEST_LINK, "m")
    yield Figure(f"URDF origin of {robot.tool_frame}", looks, last - offset, _LONGEST_LINK, "m")
    size = _LONGEST_OFFSET * max(1.0, sum(links))
    yield Figure("robot.tool_offset.xyz", "the distance looks like mm", offset, size, "m", _OF_SIZE)
    yield Figure("robot.mounting.xyz", "the distance looks like mm", mounted, _FARTHEST_BASE, "m")
    pull = math.hypot(*robot.settings.gravity)
    yield Figure("robot.gravity", "the acceleration looks like mm/s^2", pull, _MOST_GRAVITY, "m/s^2")


def _payload(robot: Robot, bare: Robot) -> Iterator[Figure]:
    """Look at what the tool carries."""
    payload = robot.settings.payload
    if payload is None:
        return
    size = max(1.0, sum(link_lengths(robot)) if robot.revolute.any() else reach(robot))
    moved = sum(inertia.mass for inertia in list(bare.model.inertias)[1:])
    heaviest = min(_HEAVIEST_PAYLOAD * size**2, _TIMES_ITSELF * moved or math.inf)
    yield Figure("robot.payload.mass", "the mass looks like g", payload.mass, heaviest, "kg", _OF_SIZE)
    away = math.hypot(*payload.com)
    message = "the distance from the tool frame looks like mm"
    yield Figure("robot.payload.com", message, away, size, "m", _OF_SIZE)
    inertia = payload.inertia
    moment = max(inertia.ixx, inertia.iyy, inertia.izz) if inertia else 0.0
    most = payload.mass * size**2
    yield Figure("robot.payload.inertia", "the inertia looks like kg mm^2", moment, most, "kg m^2", " for this mass")


def _masses(robot: Robot) -> Iterator[Figure]:
    heaviest = _HEAVIEST * max(1.0, reach(robot)) ** 2
    for name, inertia in zip(robot.joint_names, list(robot.model.inertias)[1:], strict=True):
        where = f"URDF inertials that joint {name} moves"
        yield Figure(where, "the mass looks like g", inertia.mass, heaviest, "kg", _OF_SIZE)
        moment, most = float(np.linalg.eigvalsh(inertia.inertia)[-1]), inertia.mass * _WIDEST_BODY**2
        yield Figure(where, "the inertia looks like kg mm^2", moment, most, "kg m^2", " for this mass")
