"""Joint limits: from the URDF, overridden or completed by the task."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeGuard

import numpy as np

from brachis.common.arrays import freeze
from brachis.common.summary import Summary
from brachis.errors import InputError, LimitError, UnknownNameError
from brachis.robot.torque_curves import Curve, resolve_curves
from brachis.task import FROM_URDF, LimitScale, LimitSpec

LEAST, LARGEST = 1e-6, 1e12
"""No drive has a smaller or larger limit of torque, velocity, acceleration or their rates, in SI units; products and
squares of such figures are still numbers."""
FARTHEST = 1e6
"""No position is farther from zero, rad or m: there the rounding of numbers is a tenth of a nanometre."""
_NARROWEST = 1e-9


@dataclass(frozen=True, repr=False)
class Limits(Summary):
    """Limits of every joint of the chain; infinite where a joint is not limited. The arrays are read-only.

    Attributes
    ----------
    position_lower, position_upper : (n,) ndarray
        rad or m.
    velocity_lower, velocity_upper : (n,) ndarray
        Below and above zero, rad/s or m/s.
    acceleration : (n,) ndarray
        rad/s^2 or m/s^2.
    torque_lower, torque_upper : (n,) ndarray
        Below and above zero, Nm or N.
    power : (n,) ndarray
        W.
    rms_torque : (n,) ndarray
        Root mean square over the motion, Nm or N.
    jerk : (n,) ndarray
        rad/s^3 or m/s^3.
    torque_rate : (n,) ndarray
        Nm/s or N/s.
    total_power : float
        Of the sum over all joints, W.
    torque_speed : (n,) tuple of tuple of pairs
        Points (speed, torque), rad/s or m/s and Nm or N, of the torque that falls with speed; none where it does not.
    """

    position_lower: np.ndarray
    position_upper: np.ndarray
    velocity_lower: np.ndarray
    velocity_upper: np.ndarray
    acceleration: np.ndarray
    torque_lower: np.ndarray
    torque_upper: np.ndarray
    power: np.ndarray
    rms_torque: np.ndarray
    jerk: np.ndarray
    torque_rate: np.ndarray
    total_power: float
    torque_speed: tuple[Curve, ...]

    def __post_init__(self) -> None:
        """Take copies that nobody can write to."""
        freeze(self, *_ARRAYS)

    @property
    def velocity(self) -> np.ndarray:
        """Speeds, (n,), that every joint reaches in both directions, rad/s or m/s."""
        return np.minimum(self.velocity_upper, -self.velocity_lower)

    @property
    def torque(self) -> np.ndarray:
        """Torques, (n,), that every joint reaches in both directions, Nm or N."""
        return np.minimum(self.torque_upper, -self.torque_lower)

    def both_ways(self, kind: str) -> np.ndarray:
        """Lower and upper limits, (2, n), of one of `MAGNITUDES`."""
        if kind in PAIRS:
            return np.array(
                [getattr(self, f"{kind}_lower"), getattr(self, f"{kind}_upper")]
            )
        return np.array([-getattr(self, kind), getattr(self, kind)])

    def with_magnitudes(self, **magnitudes: np.ndarray) -> Limits:
        """Return the limits with other ones of some of `MAGNITUDES`, (n,), the same in both directions."""
        ends: dict[str, Any] = {
            name: sign * values
            for kind, values in magnitudes.items()
            for name, sign in (
                ((f"{kind}_lower", -1.0), (f"{kind}_upper", 1.0))
                if kind in PAIRS
                else ((kind, 1.0),)
            )
        }
        return replace(self, **ends)

    def with_free_joint(self) -> Limits:
        """Return the limits with those of a further joint, which has none."""
        free: dict[str, Any] = {
            name: np.append(
                getattr(self, name), -np.inf if name.endswith("_lower") else np.inf
            )
            for name in _ARRAYS
        }
        return replace(self, **free, torque_speed=(*self.torque_speed, ()))


PAIRS = ("velocity", "torque")
"""Kinds of limits that may differ in both directions: a number > 0 for each joint, or [lower, upper] around zero."""
MAGNITUDES = (
    "velocity",
    "acceleration",
    "torque",
    "power",
    "rms_torque",
    "jerk",
    "torque_rate",
)
"""These, and the kinds that are one number > 0 for each joint."""
_ARRAYS = tuple(
    name
    for kind in ("position", *MAGNITUDES)
    for name in (
        (f"{kind}_lower", f"{kind}_upper") if kind in ("position", *PAIRS) else (kind,)
    )
)
STATED = {"torque": "effort", "velocity": "velocity"}
"""Those of them that a URDF states, and its words for them."""


@dataclass(frozen=True)
class UrdfLimit:
    """One joint's limits as the URDF states them; None where it states nothing."""

    lower: float | None
    upper: float | None
    velocity: float | None
    effort: float | None
    needs_range: bool = False
    """True where a revolute or prismatic joint states no range, so that the task has to."""


def resolve_limits(
    spec: LimitSpec,
    joint_names: Sequence[str],
    urdf: Sequence[UrdfLimit],
    speed_override: float = 1.0,
) -> Limits:
    """Combine the user's limits with the URDF's.

    Parameters
    ----------
    spec : LimitSpec
        The user's limits.
    joint_names : sequence of str
        The chain's joints.
    urdf : sequence of UrdfLimit
        The URDF's limits of the same joints.
    speed_override : float, optional
        Factor on velocity limits, beside those of `spec`.

    Returns
    -------
    Limits

    Raises
    ------
    LimitError
        A limit is not positive or, before or after scaling, outside [`LEAST`, `LARGEST`]; a joint has neither a torque
        nor an acceleration limit; a range is empty or ends beyond `FARTHEST`.
    InputError
        There is a speed override and no velocity limit; the total power is none, or a torque curve is none or
        rises.
    UnknownNameError
        A limit names a joint that is not of the chain.
    """
    names = list(joint_names)
    _check_scale(spec.scale)
    found = {
        kind: _per_joint(
            kind,
            getattr(spec, kind),
            names,
            [getattr(u, STATED.get(kind, ""), None) for u in urdf],
        )
        for kind in MAGNITUDES
    }
    curves, factor = (
        resolve_curves(spec.torque_speed, names, spec.scale.torque),
        spec.scale.torque,
    )
    # A torque that falls with speed is at its largest at rest, which is a plain limit.
    at_rest = np.array([curve[0][1] / factor if curve else np.inf for curve in curves])
    found["torque"] = np.clip(found["torque"], -at_rest, at_rest)
    for name, tau, acc in zip(
        names, found["torque"][1], found["acceleration"][1], strict=True
    ):
        if np.isinf(tau) and np.isinf(acc):
            raise LimitError(
                "has neither a torque nor an acceleration limit, so its time would go to zero",
                joint=name,
                key=f"robot.limits.torque.{name} or robot.limits.acceleration.{name}",
            )
    lower, upper = _ranges(spec.position, names, urdf)
    scaled = {
        kind: _scaled(kind, limits, spec.scale, names) for kind, limits in found.items()
    }
    if speed_override != 1.0 and np.isinf(scaled["velocity"]).all():
        raise InputError(
            "has no velocity limit to act on",
            where="robot.speed_override",
            found=f"{speed_override:g}",
            hint="Give robot.limits.velocity, or leave the override away",
        )
    scaled["velocity"] = scaled["velocity"] * speed_override
    values: dict[str, Any] = {
        kind: limits[1] for kind, limits in scaled.items() if kind not in PAIRS
    }
    for kind in PAIRS:
        values |= dict(
            zip((f"{kind}_lower", f"{kind}_upper"), scaled[kind], strict=True)
        )
    values |= {"total_power": _total_power(spec), "torque_speed": curves}
    return Limits(position_lower=lower, position_upper=upper, **values)


def without_joints(spec: LimitSpec, joints: Collection[str]) -> LimitSpec:
    """Leave out limits of joints that do not move: they are kept."""
    changed: dict[str, Any] = {}
    for each in fields(spec):
        value = getattr(spec, each.name)
        if isinstance(value, Mapping):
            value = {name: limit for name, limit in value.items() if name not in joints}
        changed[each.name] = value
    return LimitSpec(**changed)


def to_spec(limits: Limits, names: Sequence[str]) -> LimitSpec:
    """State limits joint by joint; joints beyond `names` are left out."""

    def finite(values: np.ndarray) -> list[float | None]:
        return [
            float(value) if np.isfinite(value) else None
            for value in values[: len(names)]
        ]

    ranges = zip(
        finite(limits.position_lower), finite(limits.position_upper), strict=True
    )
    spelled: dict[str, Any] = {"position": ranges}
    for kind in MAGNITUDES:
        pairs = zip(*(finite(ends) for ends in limits.both_ways(kind)), strict=True)
        spelled[kind] = [
            upper if lower is None or -lower == upper else (lower, upper)
            for lower, upper in pairs
        ]
    by_name = {
        kind: dict(zip(names, values, strict=True)) for kind, values in spelled.items()
    }
    curves = {
        name: curve
        for name, curve in zip(names, limits.torque_speed, strict=False)
        if curve
    }
    total = limits.total_power if np.isfinite(limits.total_power) else None
    return LimitSpec(**by_name, total_power=total, torque_speed=curves or None)


def _check_scale(scale: LimitScale) -> None:
    for kind, factor in vars(scale).items():
        if kind not in MAGNITUDES:
            raise UnknownNameError(
                "limit to scale", kind, MAGNITUDES, where="robot.limits.scale"
            )
        if not (_is_number(factor) and 0.0 < factor < np.inf):
            raise InputError(
                "is not a factor",
                where=f"robot.limits.scale.{kind}",
                found=factor,
                allowed="a finite number > 0",
            )


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float)


def _scaled(
    kind: str, limits: np.ndarray, scale: LimitScale, names: Sequence[str]
) -> np.ndarray:
    """Multiply limits, (2, n), by their factor."""
    factor = getattr(scale, kind)
    for name, pair in zip(names, limits.T, strict=True):
        for limit in pair[np.isfinite(pair)]:
            _check_size(
                kind,
                abs(float(limit)) * factor,
                name,
                f"robot.limits.scale.{kind}",
                "scaled ",
            )
    return np.asarray(limits * factor)


def _total_power(spec: LimitSpec) -> float:
    """Return the limit of the sum of the joints' powers, W; infinite where there is none."""
    stated, key = spec.total_power, "robot.limits.total_power"
    if stated is None:
        return np.inf
    if not (_is_number(stated) and LEAST <= stated * spec.scale.power <= LARGEST):
        allowed = (
            f"a number from {LEAST:g} to {LARGEST:g}, scaled too, or null for no limit"
        )
        raise InputError("is no power in W", where=key, found=stated, allowed=allowed)
    return float(stated) * spec.scale.power


def _check_size(kind: str, limit: float, joint: str, key: str, what: str) -> None:
    """Refuse a limit that no drive has."""
    if not LEAST <= limit <= LARGEST:
        raise LimitError(
            f"{what}{kind} limit is none of a real drive",
            joint=joint,
            key=key,
            found=f"{limit:g}",
            allowed=f"{LEAST:g} to {LARGEST:g} in SI units, or null for no limit",
        )


def per_joint_values(
    key: str, value: object, names: Sequence[str], missing: object
) -> list[object]:
    """Spread a scalar, list or mapping over the joints; `missing` where a mapping leaves a joint out.

    Raises
    ------
    InputError
        A list has the wrong length.
    UnknownNameError
        A mapping names a joint that is not of the chain.
    """
    if isinstance(value, Mapping):
        for name in value:
            if name not in names:
                raise UnknownNameError("joint", name, names, where=key)
        return [value.get(name, missing) for name in names]
    if isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, str):
        if len(value) != len(names):
            raise InputError(
                "has the wrong number of values",
                where=key,
                found=len(value),
                allowed=f"{len(names)}, one for each of {', '.join(names)}",
            )
        return list(value)
    return [value] * len(names)


def _per_joint(
    kind: str, value: object, names: list[str], urdf: Sequence[float | None]
) -> np.ndarray:
    """Spread one kind of limit over the joints: lower and upper ones, (2, n); infinite where not limited."""
    key = f"robot.limits.{kind}"
    listed = per_joint_values(key, value, names, FROM_URDF)
    limits = np.tile([[-np.inf], [np.inf]], len(names))
    for i, (name, entry, stated) in enumerate(zip(names, listed, urdf, strict=True)):
        chosen = stated if isinstance(entry, str) and entry == FROM_URDF else entry
        if chosen is None:
            continue
        pair = (
            list(chosen)
            if kind in PAIRS
            and isinstance(chosen, Sequence)
            and not isinstance(chosen, str)
            else None
        )
        ends = pair or [-chosen if _is_number(chosen) else chosen, chosen]
        numbers = len(ends) == 2 and all(_is_number(end) for end in ends)
        if not (numbers and ends[0] < 0.0 < ends[1]):
            where = "the URDF" if chosen is not entry else "the task"
            problem = (
                "is no pair around zero"
                if pair
                else f"is not {'positive' if numbers else 'a number'}"
            )
            raise LimitError(
                f"{kind} limit in {where} {problem}",
                joint=name,
                key=f"{key}.{name}",
                found=f"{chosen:g}" if _is_number(chosen) else repr(chosen),
                allowed="a number > 0, "
                + ("[lower, upper] with lower < 0 < upper, " if kind in PAIRS else "")
                + "or null for no limit",
            )
        for end in ends:
            if np.isfinite(end):
                _check_size(kind, abs(end), name, f"{key}.{name}", "")
        limits[:, i] = ends
    return limits


def _ranges(
    value: object, names: list[str], urdf: Sequence[UrdfLimit]
) -> tuple[np.ndarray, np.ndarray]:
    """Spread the position ranges over the joints; infinite where not limited."""
    listed = per_joint_values("robot.limits.position", value, names, FROM_URDF)
    lower, upper = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    for i, (name, entry, stated) in enumerate(zip(names, listed, urdf, strict=True)):
        chosen = (stated.lower, stated.upper) if entry == FROM_URDF else entry
        if entry == FROM_URDF and stated.needs_range:
            raise LimitError(
                "has no position range in the URDF",
                joint=name,
                key=f"robot.limits.position.{name}",
                allowed='<limit lower="..." upper="..." .../>, type="continuous", or a range in the task',
            )
        if chosen is None:
            continue
        ends = list(chosen) if isinstance(chosen, Sequence) else []
        if len(ends) != 2 or not all(end is None or _is_number(end) for end in ends):
            raise LimitError(
                "position range is not a pair",
                joint=name,
                key=f"robot.limits.position.{name}",
                found=ends or chosen,
                allowed="[lower, upper]",
            )
        lower[i] = -np.inf if ends[0] is None else float(ends[0])
        upper[i] = np.inf if ends[1] is None else float(ends[1])
        _check_range(lower[i], upper[i], name)
    return lower, upper


def _check_range(lower: float, upper: float, joint: str) -> None:
    """Refuse a range that is empty, or ends where positions are no longer exact."""
    key, found = f"robot.limits.position.{joint}", f"[{lower:g}, {upper:g}]"
    if not upper - lower >= _NARROWEST:
        allowed = (
            f"[lower, upper] with lower < upper, {_NARROWEST:g} rad or m apart at least"
        )
        raise LimitError(
            "position range is empty",
            joint=joint,
            key=key,
            found=found,
            allowed=allowed,
        )
    if any(np.isfinite(end) and abs(end) > FARTHEST for end in (lower, upper)):
        allowed = f"ends within {FARTHEST:g} rad or m of zero, null for an open end"
        raise LimitError(
            "position range ends too far away",
            joint=joint,
            key=key,
            found=found,
            allowed=allowed,
        )
