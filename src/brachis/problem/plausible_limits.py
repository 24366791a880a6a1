"""Limits of the joints next to what the URDF says of the robot: its limits, its ranges, its masses."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from brachis.robot import Robot
from brachis.robot.joints import UNITS
from brachis.robot.limits import STATED
from brachis.robot.plausibility import Check, link_lengths

_HOLDS = 50.0
"""Arms hold a tenth to five times their own weight at full reach."""


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


def limit_figures(robot: Robot) -> Iterator[Check]:
    """Yield all figures of the limits of a robot without payload."""
    for look in (_magnitudes, _ranges, _curves):
        yield from look(robot)


def _magnitudes(robot: Robot) -> Iterator[Check]:
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
                yield Check(
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
    return not rule.weighed or value == stated or value > 1e3 * usual


def _stated(robot: Robot, rule: Rule, joint: int) -> float | None:
    """Return the URDF's limit that a joint's is compared with."""
    found: float | None = getattr(
        robot.urdf_limits[joint], STATED.get(rule.stated, ""), None
    )
    return found


def _usual(robot: Robot, rule: Rule) -> Callable[[int], float]:
    """Return what gives the largest usual limit of a joint."""
    weight = (
        sum(inertia.mass for inertia in list(robot.model.inertias)[1:])
        * 9.81
        * sum(link_lengths(robot))
    )

    def of_joint(joint: int) -> float:
        unit = robot.position_units[joint]
        stated = _stated(robot, rule, joint)
        most = [rule.most[unit]]
        if rule.weighed and unit == "rad" and weight > 0.0:
            most.append(_HOLDS * weight)
        # URDFs state 1 for a limit that nobody knows.
        if stated and stated != 1.0:
            most.append(max(rule.times * stated, rule.least))
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
    torque = _usual(robot, _TORQUE)
    # Without load motors turn at up to twice the rated speed; rpm are 9.5 times rad/s.
    velocity = _usual(robot, Rule({}, FASTEST, "velocity", 5.0, 5.0))
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
        said = f"the torque of the curve looks like {_TORQUE.looks[unit]}"
        yield Check(key, said, curve[0][1] / scale, torque(i), UNITS["torque"][unit])
