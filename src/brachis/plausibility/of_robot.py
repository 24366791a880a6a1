"""The robot: limits, friction, lengths, masses, payload."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from brachis.plausibility.remark import Remark
from brachis.plausibility.size import link_lengths, reach
from brachis.robot import Robot
from brachis.robot.units import UNITS

_FASTEST = {"rad": 60.0, "m": 50.0}
"""The quickest axes of small SCARA and delta robots turn at 50 rad/s; rails move at 10 m/s. In degrees and mm: more."""
_WIDEST = {"rad": 120.0, "m": 50.0}
"""Joints with cables make two turns either way, others may be given a dozen turns; in degrees, few ranges are narrower
than 120. Few rails are longer than 30 m."""
_OPEN_END = {"rad": 800.0, "m": 1e5}
"""A range end beyond this is written for "no limit": in degrees, ranges end at two turns, 720."""
_LARGEST_SCALE = 10.0
_LONGEST_LINK = 20.0
_HEAVIEST = 1e3
"""A moving body of the heaviest arms weighs 150 kg for each square metre of their reach."""
_WIDEST_BODY = 10.0
_HEAVIEST_PAYLOAD = 150.0
"""What an arm of 1 m carries, and more with the square of its reach: the strongest ones carry 130 kg there."""


def of_robot(robot: Robot) -> tuple[Remark, ...]:
    """Look at limits, friction, lengths, masses and payload of a robot."""
    payload = tuple(_payload(robot))
    bare = robot.with_payload(None) if payload else robot
    return (*_limits(robot), *_scales(robot), *_friction(robot), *_lengths(robot), *_masses(bare), *payload)


def _limits(robot: Robot) -> Iterator[Remark]:
    """Look at velocity limits and position ranges."""
    limits, stated = robot.limits, {"rad": "degrees", "m": "mm"}
    unscaled = limits.velocity / robot.settings.limits.scale.velocity / robot.settings.speed_override
    columns = zip(
        robot.joint_names,
        robot.position_units,
        unscaled,
        limits.position_lower,
        limits.position_upper,
        strict=True,
    )
    for name, unit, velocity, lower, upper in columns:
        # A power of ten is written for "no limit".
        if np.isfinite(velocity) and velocity > _FASTEST[unit] and not round(math.log10(velocity), 9).is_integer():
            message = f"the velocity limit looks like {stated[unit]} per second"
            usual = f"below {_FASTEST[unit]:g} {unit}/s"
            yield Remark(f"robot.limits.velocity.{name}", message, f"{velocity:.6g} {unit}/s", usual)
        if upper - lower > _WIDEST[unit] and max(abs(lower), abs(upper)) <= _OPEN_END[unit]:
            message = f"the position range looks like {stated[unit]}"
            found = f"[{lower:.6g}, {upper:.6g}] {unit}"
            usual = f"less than {_WIDEST[unit]:.3g} {unit} wide, or open (null)"
            yield Remark(f"robot.limits.position.{name}", message, found, usual)


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
        slow = np.isfinite([fastest, torque]).all() and fastest <= _FASTEST[robot.position_units[i]]
        if slow and damping == robot.friction.viscous[i] and damping * fastest > torque:
            unit = UNITS["viscous"][robot.position_units[i]]
            message = "the damping of the URDF takes more than the largest torque at the largest speed"
            usual = f"below {torque / fastest:.3g} {unit}; viscous: null leaves it out"
            yield Remark(f"robot.friction.viscous.{robot.joint_names[i]}", message, f"{damping:.6g} {unit}", usual)


def _lengths(robot: Robot) -> Iterator[Remark]:
    for name, length in zip((*robot.joint_names[1:], robot.tool_frame), link_lengths(robot), strict=True):
        if length > _LONGEST_LINK:
            message = "the distance from the joint before looks like mm"
            yield Remark(f"URDF origin of {name}", message, f"{length:.6g} m", f"less than {_LONGEST_LINK:g} m")


def _payload(robot: Robot) -> Iterator[Remark]:
    """Look at what the tool carries."""
    payload = robot.settings.payload
    if payload is None:
        return
    size = max(1.0, sum(link_lengths(robot)) if robot.revolute.any() else reach(robot))
    heaviest = _HEAVIEST_PAYLOAD * size**2
    if payload.mass > heaviest:
        usual = f"less than {heaviest:.3g} kg for an arm of this size"
        yield Remark("robot.payload.mass", "the mass looks like g", f"{payload.mass:.6g} kg", usual)
    away = math.hypot(*payload.com)
    if away > size:
        usual = f"less than {size:.3g} m for an arm of this size"
        yield Remark("robot.payload.com", "the distance from the tool frame looks like mm", f"{away:.6g} m", usual)
    inertia = payload.inertia
    moment = max(inertia.ixx, inertia.iyy, inertia.izz) if inertia else 0.0
    if moment > payload.mass * size**2:
        usual = f"less than {payload.mass * size**2:.3g} kg m^2 for this mass"
        yield Remark("robot.payload.inertia", "the inertia looks like kg mm^2", f"{moment:.6g} kg m^2", usual)


def _masses(robot: Robot) -> Iterator[Remark]:
    heaviest = _HEAVIEST * max(1.0, reach(robot)) ** 2
    for name, inertia in zip(robot.joint_names, list(robot.model.inertias)[1:], strict=True):
        where = f"URDF inertials that joint {name} moves"
        if inertia.mass > heaviest:
            usual = f"less than {heaviest:.3g} kg for an arm of this size"
            yield Remark(where, "the mass looks like g", f"{inertia.mass:.6g} kg", usual)
        moment = float(np.linalg.eigvalsh(inertia.inertia)[-1])
        if moment > inertia.mass * _WIDEST_BODY**2:
            usual = f"less than {inertia.mass * _WIDEST_BODY**2:.3g} kg m^2 for this mass"
            yield Remark(where, "the inertia looks like kg mm^2", f"{moment:.6g} kg m^2", usual)
