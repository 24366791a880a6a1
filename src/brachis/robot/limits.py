"""Joint limits: from the URDF, overridden or completed by the task."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, make_dataclass, replace
from typing import Any, TypeGuard

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import freeze
from brachis.common.summary import Summary
from brachis.errors import InputError, LimitError, check_names
from brachis.robot.tool_joints import ToolJoint
from brachis.task import FROM_URDF, LIMIT_KINDS, LimitScale, LimitSpec
from brachis.task.fields import LARGEST, LEAST
from brachis.task.limit_models import per_joint_values

Curve = tuple[tuple[float, float], ...]
"""Points (speed, torque), rad/s or m/s and Nm or N, from speed 0 on; empty without a curve."""

FARTHEST = 1e6
"""Largest end of a position range, rad or m: there the rounding of numbers is a tenth of a nanometre."""
MAGNITUDES = tuple(kind for kind, row in LIMIT_KINDS.items() if row.form != "range")
"""Kinds of limits that are figures around zero for each joint."""
_ARRAYS = tuple(name for row in LIMIT_KINDS.values() for name in row.ends)

_JointArrays: Any = make_dataclass(
    "_JointArrays",
    [(name, np.ndarray) for name in _ARRAYS],
    frozen=True,
    repr=False,
    eq=False,
)


@dataclass(frozen=True, repr=False, eq=False)
class Limits(_JointArrays, Summary):  # type: ignore[misc]
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
        Points (speed, torque), rad/s or m/s and Nm or N, of the torque that falls with speed; empty for a joint
        without a curve.
    """

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
        """Lower and upper limits, (2, n), of one of `LIMIT_KINDS`."""
        ends = [getattr(self, name) for name in LIMIT_KINDS[kind].ends]
        return np.array(ends if len(ends) == 2 else [-ends[0], ends[0]])

    def with_magnitudes(self, **magnitudes: np.ndarray) -> Limits:
        """Return the limits with other ones of some of `MAGNITUDES`, (n,), the same in both directions."""
        ends: dict[str, Any] = {}
        for kind, values in magnitudes.items():
            ends |= _arrays_of(kind, np.array([-values, values]))
        return replace(self, **ends)

    def with_tool_joints(self, joints: Sequence[ToolJoint]) -> Limits:
        """Return the limits with those of further joints, which have none but their ranges."""
        free = {
            name: np.full(len(joints), -np.inf if name.endswith("_lower") else np.inf)
            for name in _ARRAYS
        }
        free["position_lower"] = np.array([joint.lower for joint in joints])
        free["position_upper"] = np.array([joint.upper for joint in joints])
        longer: dict[str, Any] = {
            name: np.append(getattr(self, name), values)
            for name, values in free.items()
        }
        curves = (*self.torque_speed, *((),) * len(joints))
        return replace(self, **longer, torque_speed=curves)


def _arrays_of(kind: str, pairs: np.ndarray) -> dict[str, np.ndarray]:
    """Return the arrays of a kind by name, from lower and upper limits, (2, n)."""
    names = LIMIT_KINDS[kind].ends
    return dict(zip(names, pairs[-len(names) :], strict=True))


@dataclass(frozen=True)
class UrdfLimit:
    """One joint's limits as the URDF states them; None where it states nothing."""

    lower: float | None
    upper: float | None
    velocity: float | None
    effort: float | None
    needs_range: bool = False
    """True where a revolute or prismatic joint states no range, so that the task has to."""

    def of_kind(self, kind: str) -> float | None:
        """Return the limit of one of `MAGNITUDES`; None without one."""
        value: float | None = getattr(self, LIMIT_KINDS[kind].urdf, None)
        return value


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
        nor an acceleration limit; a range is empty or ends more than 1e6 rad or m away from zero.
    InputError
        A speed override has no velocity limit to scale; the total power is outside [`LEAST`, `LARGEST`]; a torque
        curve is not valid or rises.
    UnknownNameError
        A limit names a joint that is not of the chain.
    """
    names = list(joint_names)
    _check_scale(spec.scale)
    pairs = {
        kind: _spread_magnitudes(kind, getattr(spec, kind), names, urdf)
        for kind in MAGNITUDES
    }
    factor = spec.scale.torque
    curves = _resolve_curves(spec.torque_speed, names, factor)
    # A torque that falls with speed is at its largest at rest, which is a plain limit.
    at_rest = np.array([curve[0][1] / factor if curve else np.inf for curve in curves])
    pairs["torque"] = np.clip(pairs["torque"], -at_rest, at_rest)
    is_free = np.isinf(pairs["torque"][1]) & np.isinf(pairs["acceleration"][1])
    for i in np.flatnonzero(is_free):
        raise LimitError(
            "the joint has neither a torque nor an acceleration limit, so the end time would go to zero",
            joint=names[i],
            key=f"robot.limits.torque.{names[i]} or robot.limits.acceleration.{names[i]}",
        )
    pairs["position"] = _spread_ranges(spec.position, names, urdf)
    for kind in MAGNITUDES:
        pairs[kind] = _scale_limits(kind, pairs[kind], spec.scale, names)
    if speed_override != 1.0 and np.isinf(pairs["velocity"]).all():
        raise InputError(
            "the speed override has no velocity limit to scale",
            where="robot.speed_override",
            found=f"{speed_override:g}",
            hint="Set robot.limits.velocity, or remove the override",
        )
    pairs["velocity"] = pairs["velocity"] * speed_override
    arrays: dict[str, Any] = {}
    for kind, limits in pairs.items():
        arrays |= _arrays_of(kind, limits)
    return Limits(**arrays, total_power=_resolve_total_power(spec), torque_speed=curves)


def without_joints(spec: LimitSpec, joints: Collection[str]) -> LimitSpec:
    """Leave out limits of joints that do not move: they are kept."""
    changed: dict[str, Any] = {}
    for kind, value in vars(spec).items():
        if isinstance(value, Mapping):
            kept = {name: limit for name, limit in value.items() if name not in joints}
            changed[kind] = kept
    return replace(spec, **changed)


def to_spec(limits: Limits, names: Sequence[str]) -> LimitSpec:
    """State limits joint by joint; joints beyond `names` are left out."""
    spec: dict[str, Any] = {}
    for kind, row in LIMIT_KINDS.items():
        values = limits.both_ways(kind).T[: len(names)]
        pairs = [
            [end if np.isfinite(end) else None for end in pair]
            for pair in values.tolist()
        ]
        spec[kind] = {
            name: pair[1]
            if row.form != "range" and (pair[0] is None or -pair[0] == pair[1])
            else tuple(pair)
            for name, pair in zip(names, pairs, strict=True)
        }
    curves = zip(names, limits.torque_speed, strict=False)
    spec["torque_speed"] = {name: curve for name, curve in curves if curve} or None
    if np.isfinite(limits.total_power):
        spec["total_power"] = limits.total_power
    return LimitSpec(**spec)


def _check_scale(scale: LimitScale) -> None:
    factors = vars(scale)
    where = "robot.limits.scale"
    check_names("limit that can be scaled", factors, MAGNITUDES, where)
    for kind, factor in factors.items():
        if not (_is_number(factor) and 0.0 < factor < np.inf):
            raise InputError(
                "the factor is not valid",
                where=f"{where}.{kind}",
                found=factor,
                allowed="a finite number > 0",
            )


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float)


def _scale_limits(
    kind: str, limits: np.ndarray, scale: LimitScale, names: Sequence[str]
) -> np.ndarray:
    """Multiply limits, (2, n), by their factor."""
    with np.errstate(over="ignore"):
        scaled = np.asarray(limits * getattr(scale, kind))
    for i, name in enumerate(names):
        figures = scaled[np.isfinite(limits[:, i]), i]
        _check_sizes(f"scaled {kind}", figures, name, f"robot.limits.scale.{kind}")
    return scaled


def _resolve_total_power(spec: LimitSpec) -> float:
    """Return the limit of the sum of the joints' powers, W; infinite without one."""
    given = spec.total_power
    if given is None:
        return np.inf
    factor = spec.scale.power
    if not (_is_number(given) and LEAST <= given * factor <= LARGEST):
        raise InputError(
            "the total power is not valid",
            where="robot.limits.total_power",
            found=given,
            allowed=f"{LEAST:g} W to {LARGEST:g} W after scaling, or null for no limit",
        )
    return float(given) * factor


def _check_sizes(what: str, figures: np.ndarray, joint: str, key: str) -> None:
    """Refuse figures of limits whose products and squares would not be accurate."""
    for limit in np.abs(figures):
        if not LEAST <= limit <= LARGEST:
            raise LimitError(
                f"{what} limit is too small or too large",
                joint=joint,
                key=key,
                found=f"{limit:g}",
                allowed=f"{LEAST:g} to {LARGEST:g} in SI units, or null for no limit",
            )


def _spread_magnitudes(
    kind: str, value: object, names: list[str], urdf: Sequence[UrdfLimit]
) -> np.ndarray:
    """Spread one kind of limit over the joints: lower and upper ones, (2, n); infinite where not limited."""
    key = f"robot.limits.{kind}"
    is_pair = LIMIT_KINDS[kind].form == "pair"
    limits = np.tile([[-np.inf], [np.inf]], len(names))
    listed = per_joint_values(key, value, names, FROM_URDF)
    for i, (name, entry) in enumerate(zip(names, listed, strict=True)):
        from_urdf = entry == FROM_URDF
        given = urdf[i].of_kind(kind) if from_urdf else entry
        if given is None:
            continue
        ends: list[Any] = [-given if _is_number(given) else given, given]
        problem = "is not positive"
        if is_pair and isinstance(given, Sequence) and not isinstance(given, str):
            ends = list(given)
            problem = "is not a pair around zero"
        elif not _is_number(given):
            problem = "is not a number"
        numbers = len(ends) == 2 and all(_is_number(end) for end in ends)
        if not (numbers and ends[0] < 0.0 < ends[1]):
            pair = "[lower, upper] with lower < 0 < upper, " if is_pair else ""
            raise LimitError(
                f"{kind} limit in {'the URDF' if from_urdf else 'the task'} {problem}",
                joint=name,
                key=f"{key}.{name}",
                found=f"{given:g}" if _is_number(given) else repr(given),
                allowed=f"a number > 0, {pair}or null for no limit",
            )
        limits[:, i] = ends
        figures = limits[np.isfinite(limits[:, i]), i]
        _check_sizes(kind, figures, name, f"{key}.{name}")
    return limits


def _spread_ranges(
    value: object, names: list[str], urdf: Sequence[UrdfLimit]
) -> np.ndarray:
    """Spread the position ranges over the joints, (2, n); infinite where not limited."""
    ranges = np.tile([[-np.inf], [np.inf]], len(names))
    listed = per_joint_values("robot.limits.position", value, names, FROM_URDF)
    for i, (name, entry, known) in enumerate(zip(names, listed, urdf, strict=True)):
        key = f"robot.limits.position.{name}"
        given = (known.lower, known.upper) if entry == FROM_URDF else entry
        if entry == FROM_URDF and known.needs_range:
            raise LimitError(
                "the joint has no position range in the URDF",
                joint=name,
                key=key,
                allowed='<limit lower="..." upper="..." .../>, type="continuous", or a range in the task',
            )
        if given is None:
            continue
        ends = list(given) if isinstance(given, Sequence) else []
        if len(ends) != 2 or not all(end is None or _is_number(end) for end in ends):
            raise LimitError(
                "position range is not a pair",
                joint=name,
                key=key,
                found=ends or given,
                allowed="[lower, upper]",
            )
        lower = -np.inf if ends[0] is None else float(ends[0])
        upper = np.inf if ends[1] is None else float(ends[1])
        problem = allowed = ""
        if not upper - lower >= 1e-9:
            problem = "is empty"
            allowed = "[lower, upper] with lower < upper, 1e-09 rad or m apart at least"
        elif any(FARTHEST < abs(end) < np.inf for end in (lower, upper)):
            problem = "is too far from zero"
            allowed = f"ends within {FARTHEST:g} rad or m of zero, null for an open end"
        if problem:
            raise LimitError(
                f"position range {problem}",
                joint=name,
                key=key,
                found=f"[{lower:g}, {upper:g}]",
                allowed=allowed,
            )
        ranges[:, i] = lower, upper
    return ranges


def _resolve_curves(
    stated: object, names: Sequence[str], factor: float
) -> tuple[Curve, ...]:
    """Check the curves of a chain's joints, and multiply their torques by a factor."""
    where = "robot.limits.torque_speed"
    if not isinstance(stated, Mapping | None):
        raise InputError(
            "this is not a mapping of joint names",
            where=where,
            found=stated,
            allowed="{joint: [[speed, torque], ...]}",
        )
    listed = per_joint_values(where, stated, names, None)
    return tuple(
        _resolve_curve(points, name, factor)
        for name, points in zip(names, listed, strict=True)
    )


def _resolve_curve(points: object, joint: str, factor: float) -> Curve:
    """Check a joint's curve, and scale its torques."""
    if points is None:
        return ()
    key = f"robot.limits.torque_speed.{joint}"
    try:
        table = np.array(points, dtype=float)
    except (TypeError, ValueError):
        table = np.empty(0)
    is_table = table.ndim == 2 and len(table) >= 2 and table.shape[1] == 2
    if not (is_table and np.isfinite(table).all()):
        raise InputError(
            "this is not a torque curve",
            where=key,
            found=points,
            allowed="two or more points [speed, torque]",
        )
    speed, torque = table.T
    found = ", ".join(f"[{v:g}, {tau:g}]" for v, tau in table)
    ascends = speed[0] == 0.0 and np.all(np.diff(speed) > 0.0)
    if not (ascends and speed[-1] <= LARGEST):
        raise InputError(
            "the speeds do not increase from 0",
            where=key,
            found=found,
            allowed=f"speeds that begin at 0 and ascend, at most {LARGEST:g}",
        )
    if not (LEAST <= torque[0] * factor <= LARGEST and np.all(torque >= 0.0)):
        raise InputError(
            "torques are negative, too small or too large",
            where=key,
            found=found,
            allowed=f"torques >= 0; that at speed 0 from {LEAST:g} to {LARGEST:g} N m (N), also after scaling",
        )
    # The same torque may have been rounded to different figures.
    rising = np.flatnonzero(np.diff(torque) > tolerances.ROUNDING * torque[0])
    if len(rising):
        raise InputError(
            "the torque rises with the speed",
            where=f"{key}[{rising[0] + 1}]",
            found=found,
            allowed="torques that stay or fall from point to point",
            hint="Leave out the points to which it rises; the curve then lies below them",
        )
    torques = np.minimum.accumulate(torque) * factor
    return tuple(zip(speed.tolist(), torques.tolist(), strict=True))
