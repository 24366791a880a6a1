"""Joint limits: those of the URDF, overridden or completed by the task."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, make_dataclass, replace
from typing import Any

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import freeze
from brachis.common.summary import Summary
from brachis.errors import InputError, LimitError
from brachis.robot.tool_joints import ToolJoint
from brachis.task import (
    FROM_URDF,
    LIMIT_KINDS,
    ROBOT_LIMITS,
    LimitSpec,
    check_robot_settings,
)
from brachis.task.fields import LARGEST, LEAST
from brachis.task.limit_models import map_by_joint, per_joint_values

TorqueSpeedCurve = tuple[tuple[float, float], ...]
"""Points (speed, torque), rad/s or m/s and Nm or N, beginning at speed 0; empty without a curve."""

FARTHEST = 1e6
"""Maximum magnitude of an end of a position range, rad or m. Numbers of this magnitude are rounded to 0.1 nm."""
MAGNITUDES = tuple(kind for kind, row in LIMIT_KINDS.items() if row.form != "range")
"""Kinds of joint limits that are magnitudes, not ranges."""
_ARRAYS = tuple(name for row in LIMIT_KINDS.values() for name in row.ends)

_Figures: Any = make_dataclass(
    "_Figures",
    [(name, np.ndarray) for name in _ARRAYS] + [(name, float) for name in ROBOT_LIMITS],
    frozen=True,
    repr=False,
    eq=False,
)


@dataclass(frozen=True, repr=False, eq=False)
class Limits(_Figures, Summary):  # type: ignore[misc]
    """Limits of every joint of the chain; infinite if a joint is not limited. The arrays are read-only.

    Attributes
    ----------
    position_lower, position_upper : (n,) ndarray
        Ends of the ranges, rad or m.
    velocity_lower, velocity_upper : (n,) ndarray
        Limits in the negative and in the positive direction, rad/s or m/s.
    acceleration : (n,) ndarray
        rad/s^2 or m/s^2.
    torque_lower, torque_upper : (n,) ndarray
        Limits in the negative and in the positive direction, Nm or N.
    power : (n,) ndarray
        W.
    rms_torque : (n,) ndarray
        Root mean square over the motion, Nm or N.
    jerk : (n,) ndarray
        rad/s^3 or m/s^3.
    torque_rate : (n,) ndarray
        Nm/s or N/s.
    total_power : float
        Limit of the sum over all joints, W.
    torque_speed : (n,) tuple of tuple of pairs
        Points (speed, torque), rad/s or m/s and Nm or N, of a torque limit that falls with speed; empty for a joint
        without a curve.
    """

    torque_speed: tuple[TorqueSpeedCurve, ...]

    def __post_init__(self) -> None:
        """Replace the arrays by read-only copies."""
        freeze(self, *_ARRAYS)

    @property
    def velocity(self) -> np.ndarray:
        """Speed limit of every joint, (n,), that applies in both directions, rad/s or m/s."""
        return np.minimum(self.velocity_upper, -self.velocity_lower)

    @property
    def torque(self) -> np.ndarray:
        """Torque limit of every joint, (n,), that applies in both directions, Nm or N."""
        return np.minimum(self.torque_upper, -self.torque_lower)

    def both_ways(self, kind: str) -> np.ndarray:
        """Return the lower and upper limits, (2, n), of one of `LIMIT_KINDS`."""
        ends = [getattr(self, name) for name in LIMIT_KINDS[kind].ends]
        return np.array(ends if len(ends) == 2 else [-ends[0], ends[0]])

    def with_magnitudes(self, **magnitudes: np.ndarray) -> Limits:
        """Replace the limits of some of `MAGNITUDES` by new ones, (n,), which are the same in both directions."""
        ends: dict[str, Any] = {}
        for kind, values in magnitudes.items():
            ends |= _arrays_of(kind, np.array([-values, values]))
        return replace(self, **ends)

    def with_tool_joints(self, joints: Sequence[ToolJoint]) -> Limits:
        """Append the limits of virtual joints, which only have ranges."""
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
    """Return the arrays of one kind of limit, by name, from lower and upper limits, (2, n)."""
    names = LIMIT_KINDS[kind].ends
    return dict(zip(names, pairs[-len(names) :], strict=True))


@dataclass(frozen=True)
class UrdfLimit:
    """Limits of one joint as stated in the URDF; None if a limit is not stated."""

    lower: float | None = None
    upper: float | None = None
    velocity: float | None = None
    effort: float | None = None
    needs_range: bool = False
    """True if a revolute or prismatic joint states no range, so that the task has to state it."""

    def of_kind(self, kind: str) -> float | None:
        """Return the limit of one of `MAGNITUDES`; None if there is no limit."""
        value: float | None = getattr(self, LIMIT_KINDS[kind].urdf, None)
        return value


def check_limits(spec: LimitSpec, names: Sequence[str]) -> LimitSpec:
    """Check a user's limits, and write them joint by joint, so that limits of other joints can be added.

    Raises
    ------
    TaskError, InputError, UnknownNameError
        A limit has a wrong form or length, or names a joint that is not in the chain.
    """
    by_joint: dict[str, Any] = {}
    for entry in fields(spec):
        kind = entry.name
        value = getattr(spec, kind)
        is_list = kind in LIMIT_KINDS and isinstance(value, tuple)
        if is_list or isinstance(value, Mapping):
            if kind in LIMIT_KINDS:
                value = _leave_open(value)
            stated = map_by_joint(f"robot.limits.{kind}", value, names, FROM_URDF)
            by_joint[kind] = stated or entry.default
    return check_robot_settings({"limits": replace(spec, **by_joint)}).limits


def _leave_open(value: Any) -> Any:
    """Replace infinite figures by None."""
    if isinstance(value, Mapping):
        return {key: _leave_open(entry) for key, entry in value.items()}
    if isinstance(value, tuple):
        return tuple(map(_leave_open, value))
    return None if value in {np.inf, -np.inf} else value


def resolve_limits(
    spec: LimitSpec,
    joint_names: Sequence[str],
    urdf: Sequence[UrdfLimit],
    speed_override: float = 1.0,
) -> Limits:
    """Combine the user's limits with those of the URDF.

    Parameters
    ----------
    spec : LimitSpec
        The user's limits, after `check_limits`.
    joint_names : sequence of str
        The joints of the chain.
    urdf : sequence of UrdfLimit
        Limits of the same joints in the URDF.
    speed_override : float, optional
        Factor on velocity limits, in addition to the factors in `spec`.

    Returns
    -------
    Limits

    Raises
    ------
    LimitError
        A scaled limit is outside [`LEAST`, `LARGEST`]; a joint has neither a torque nor an acceleration limit; a range
        is missing, empty or ends more than 1e6 rad or m away from zero.
    InputError
        A speed override has no velocity limit to scale; one of `ROBOT_LIMITS` is outside [`LEAST`, `LARGEST`]; a
        torque curve is not valid or rises.
    """
    names = list(joint_names)
    pairs = {
        kind: _spread_limits(kind, getattr(spec, kind), names, urdf)
        for kind in LIMIT_KINDS
    }
    _check_ranges(pairs["position"], names)
    for kind in MAGNITUDES:
        pairs[kind] = _scale_limits(kind, pairs[kind], getattr(spec.scale, kind), names)
    listed = per_joint_values("torque_speed", spec.torque_speed, names, None)
    curves = tuple(
        _resolve_curve(points, name, spec.scale.torque)
        for name, points in zip(names, listed, strict=True)
    )
    # A torque limit that falls with speed is highest at rest. The value at rest is a plain limit.
    stall_torques = np.array([curve[0][1] if curve else np.inf for curve in curves])
    pairs["torque"] = np.clip(pairs["torque"], -stall_torques, stall_torques)
    is_free = np.isinf(pairs["torque"][1]) & np.isinf(pairs["acceleration"][1])
    free = [names[i] for i in np.flatnonzero(is_free)]
    if free:
        joint = "" if len(free) == len(names) else f".{free[0]}"
        raise LimitError(
            "there is neither a torque nor an acceleration limit, so the end time would go to zero",
            joint=free[0],
            key=f"robot.limits.acceleration{joint} or robot.limits.torque{joint}",
            found=f"none for {', '.join(free)}",
            allowed="one of them; an effort of 0 in the URDF is no limit, and torque limits need masses in the URDF",
        )
    if speed_override != 1.0 and np.isinf(pairs["velocity"]).all():
        raise InputError(
            "the speed override has no velocity limit to scale",
            where="robot.speed_override",
            found=f"{speed_override:g}",
            hint="Set robot.limits.velocity, or remove the override",
        )
    pairs["velocity"] = pairs["velocity"] * speed_override
    figures: dict[str, Any] = {
        kind: _resolve_figure(kind, spec) for kind in ROBOT_LIMITS
    }
    for kind, limits in pairs.items():
        figures |= _arrays_of(kind, limits)
    return Limits(**figures, torque_speed=curves)


def without_joints(spec: LimitSpec, joints: Collection[str]) -> LimitSpec:
    """Return the limits without the limits of joints that are held."""
    changed: dict[str, Any] = {
        kind: {name: limit for name, limit in value.items() if name not in joints}
        for kind, value in vars(spec).items()
        if isinstance(value, Mapping)
    }
    return replace(spec, **changed)


def to_spec(limits: Limits, names: Sequence[str]) -> LimitSpec:
    """Write the limits joint by joint, for the joints with these names; other joints are left out."""
    spec: dict[str, Any] = {}
    for kind, row in LIMIT_KINDS.items():
        ends = limits.both_ways(kind).T[: len(names)].tolist()
        entries = [
            (lower, upper) if row.form == "range" or lower != -upper else upper
            for lower, upper in ends
        ]
        spec[kind] = dict(zip(names, entries, strict=True))
    curves = zip(names, limits.torque_speed, strict=False)
    spec["torque_speed"] = {name: curve for name, curve in curves if curve} or None
    spec |= {kind: getattr(limits, kind) for kind in ROBOT_LIMITS}
    return LimitSpec(**_leave_open(spec))


def _spread_limits(
    kind: str, value: object, names: Sequence[str], urdf: Sequence[UrdfLimit]
) -> np.ndarray:
    """Return the lower and upper limits of one kind for all joints, (2, n); infinite if not limited."""
    key = f"robot.limits.{kind}"
    limits = np.tile([[-np.inf], [np.inf]], len(names))
    listed = per_joint_values(key, value, names, FROM_URDF)
    for i, (stated, known) in enumerate(zip(listed, urdf, strict=True)):
        ends: Any = stated
        if stated == FROM_URDF and kind == "position":
            if known.needs_range:
                raise LimitError(
                    "the joint has no position range in the URDF",
                    joint=names[i],
                    key=f"{key}.{names[i]}",
                    allowed='<limit lower="..." upper="..." .../>, type="continuous", or a range in the task',
                )
            ends = (known.lower, known.upper)
        elif stated == FROM_URDF:
            ends = known.of_kind(kind)
        if isinstance(ends, float):
            ends = (-ends, ends)
        if ends is not None:
            pair = np.array(ends, dtype=float)  # None becomes NaN
            limits[:, i] = np.where(np.isnan(pair), limits[:, i], pair)
    return limits


def _check_ranges(ranges: np.ndarray, names: Sequence[str]) -> None:
    """Refuse position ranges, (2, n), that are empty or too far from zero."""
    for name, (lower, upper) in zip(names, ranges.T, strict=True):
        is_far = any(FARTHEST < abs(end) < np.inf for end in (lower, upper))
        if is_far or not upper - lower >= 1e-9:
            problem = "is too far from zero" if is_far else "is empty"
            raise LimitError(
                f"position range {problem}",
                joint=name,
                key=f"robot.limits.position.{name}",
                found=f"[{lower:g}, {upper:g}]",
                allowed=f"ends at least 1e-09 rad or m apart, within {FARTHEST:g} of zero; null for an open end",
            )


def _scale_limits(
    kind: str, limits: np.ndarray, factor: float, names: Sequence[str]
) -> np.ndarray:
    """Scale limits, (2, n), and refuse figures whose products and squares would be inaccurate."""
    with np.errstate(over="ignore"):
        scaled = np.asarray(limits * factor)
    for figures, word in (limits, ""), (scaled, "scaled "):
        sizes = figures * [[-1.0], [1.0]]
        is_wrong = np.isfinite(limits) & ~((sizes >= LEAST) & (sizes <= LARGEST))
        for end, i in np.argwhere(is_wrong):
            key = f"scale.{kind}" if word else f"{kind}.{names[i]}"
            problem = f"{word}{kind} limit is too small or too large"
            if sizes[end, i] <= 0.0:
                problem = f"{kind} limit in the URDF is not positive"
            raise LimitError(
                problem,
                joint=names[i],
                key=f"robot.limits.{key}",
                found=f"{sizes[end, i]:g}",
                allowed=f"{LEAST:g} to {LARGEST:g} in SI units, also after robot.limits.scale, or null for no limit",
            )
    return scaled


def _resolve_figure(kind: str, spec: LimitSpec) -> float:
    """Return the scaled figure of one of `ROBOT_LIMITS`; infinite if there is no limit."""
    row = ROBOT_LIMITS[kind]
    stated = getattr(spec, kind)
    if stated is None:
        return np.inf
    scaled = float(stated * getattr(spec.scale, row.scale, 1.0))
    if not LEAST <= scaled <= LARGEST:
        raise InputError(
            f"the {kind.replace('_', ' ')} is too small or too large",
            where=f"robot.limits.{kind}",
            found=stated,
            allowed=f"{LEAST:g} to {LARGEST:g} {row.unit} after scaling, or null for no limit",
        )
    return scaled


def _resolve_curve(points: Any, joint: str, factor: float) -> TorqueSpeedCurve:
    """Check the points (speed, torque) of a joint's curve, and scale the torques."""
    if points is None:
        return ()
    key = f"robot.limits.torque_speed.{joint}"
    speed, torque = np.transpose(points)
    points_text = ", ".join(f"[{v:g}, {tau:g}]" for v, tau in points)
    ascends = speed[0] == 0.0 and np.all(np.diff(speed) > 0.0)
    if not (ascends and speed[-1] <= LARGEST):
        raise InputError(
            "the speeds do not increase from 0",
            where=key,
            found=points_text,
            allowed=f"speeds that begin at 0 and ascend, at most {LARGEST:g}",
        )
    if not LEAST <= torque[0] * factor <= LARGEST:
        raise InputError(
            "the torque at speed 0 is too small or too large",
            where=key,
            found=points_text,
            allowed=f"{LEAST:g} to {LARGEST:g} N m (N), also after scaling",
        )
    # Equal torques may have been rounded to different figures.
    rising = np.flatnonzero(np.diff(torque) > tolerances.ROUNDING * torque[0])
    if len(rising):
        raise InputError(
            "the torque rises with the speed",
            where=f"{key}[{rising[0] + 1}]",
            found=points_text,
            allowed="torques that stay or fall from point to point",
            hint="Leave out the points to which it rises; the curve then lies below them",
        )
    torques = np.minimum.accumulate(torque) * factor
    return tuple(zip(speed.tolist(), torques.tolist(), strict=True))
