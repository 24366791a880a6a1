"""Limits of the joints next to what the URDF says of the robot: its limits, its ranges, its masses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from brachis.robot import Robot
from brachis.robot.joints import UNITS
from brachis.robot.plausibility import Check, link_lengths
from brachis.task import LIMIT_KINDS
from brachis.task.limit_kinds import FASTEST, UsualLimit

_HOLDS = 50.0
"""Arms hold a tenth to five times their own weight at full reach."""


def limit_figures(robot: Robot) -> Iterator[Check]:
    """Yield all figures of the limits of a robot without payload."""
    for look in (_magnitudes, _ranges, _curves):
        yield from look(robot)


def _magnitudes(robot: Robot) -> Iterator[Check]:
    for kind, row in LIMIT_KINDS.items():
        usual = row.usual
        if usual is None:
            continue
        values = np.abs(robot.limits.both_ways(kind)).max(axis=0)
        values = values / getattr(robot.settings.limits.scale, kind)
        if usual.overridden:
            values = values / robot.settings.speed_override
        largest = _largest(robot, usual)
        for i, (name, unit, value) in enumerate(
            zip(robot.joint_names, robot.position_units, values, strict=True)
        ):
            has_curve = usual.by_curve and robot.limits.torque_speed[i]
            if not has_curve and not _placeholder(
                value, usual, largest(i), _stated(robot, usual, i)
            ):
                yield Check(
                    f"robot.limits.{kind}.{name}",
                    f"the {row.name.replace('_', ' ')} limit looks like {usual.mistaken_unit[unit]}",
                    float(value),
                    largest(i),
                    row.units[unit],
                )


def _placeholder(
    value: float, usual: UsualLimit, largest: float, stated: float | None
) -> bool:
    """Tell whether a limit is written for "no limit": a power of ten, of torques one that no figure in mNm can be."""
    if not 0.0 < value < math.inf:
        return True
    if not round(math.log10(value), 9).is_integer():
        return False
    return not usual.compares_weight or value == stated or value > 1e3 * largest


def _stated(robot: Robot, usual: UsualLimit, joint: int) -> float | None:
    """Return the URDF's limit that a joint's is compared with."""
    kind = usual.urdf_kind
    return robot.urdf_limits[joint].of_kind(kind) if kind else None


def _largest(robot: Robot, usual: UsualLimit) -> Callable[[int], float]:
    """Return what gives the largest usual limit of a joint."""
    mass = sum(inertia.mass for inertia in list(robot.model.inertias)[1:])
    weight = mass * 9.81 * sum(link_lengths(robot))

    def of_joint(joint: int) -> float:
        unit = robot.position_units[joint]
        stated = _stated(robot, usual, joint)
        most = [usual.largest[unit]]
        if usual.compares_weight and unit == "rad" and weight > 0.0:
            most.append(_HOLDS * weight)
        # URDFs state 1 for a limit that nobody knows.
        if stated and stated != 1.0:
            most.append(max(usual.urdf_factor * stated, usual.urdf_least))
        return float(min(most))

    return of_joint


def _ranges(robot: Robot) -> Iterator[Check]:
    """Look at position ranges: joints with cables make a dozen turns at most."""
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
        # In degrees, few ranges are narrower than 120; few rails are longer than 30 m.
        usual = 120.0 if unit == "rad" else 50.0
        if (
            known.lower is not None
            and known.upper is not None
            and known.upper > known.lower
        ):
            least = 4.0 * math.pi if unit == "rad" else 5.0
            usual = min(usual, max(5.0 * (known.upper - known.lower), least))
        # An end beyond this is written for "no limit": in degrees, ranges end at 720.
        if max(abs(lower), abs(upper)) <= (800.0 if unit == "rad" else 1e5):
            yield Check(
                f"robot.limits.position.{name}",
                f"the position range looks like {'degrees' if unit == 'rad' else 'mm'}",
                upper - lower,
                usual,
                unit,
                " wide, or open (null)",
                f"[{lower:.6g}, {upper:.6g}]",
            )


def _curves(robot: Robot) -> Iterator[Check]:
    """Look at the torques and the speeds of torque-speed curves."""
    scale = robot.settings.limits.scale.torque
    usual_torque = LIMIT_KINDS["torque"].usual
    assert usual_torque is not None
    torque = _largest(robot, usual_torque)
    # Without load motors turn at up to twice the rated speed; rpm are 9.5 times rad/s.
    velocity = _largest(robot, UsualLimit({}, FASTEST, "velocity", 5.0, 5.0))
    rows = zip(
        robot.joint_names, robot.position_units, robot.limits.torque_speed, strict=True
    )
    for i, (name, unit, curve) in enumerate(rows):
        if not curve:
            continue
        key = f"robot.limits.torque_speed.{name}"
        meant = {"rad": "rpm", "m": "mm per second"}[unit]
        said = "the last speed of the curve looks like"
        aside = "; at the joint, behind its gear"
        yield Check(
            key,
            f"{said} {meant}",
            curve[-1][0],
            velocity(i),
            UNITS["velocity"][unit],
            aside,
        )
        said = f"the torque of the curve looks like {usual_torque.mistaken_unit[unit]}"
        yield Check(key, said, curve[0][1] / scale, torque(i), UNITS["torque"][unit])
