"""Joint limits: from the URDF, overridden or completed by the task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TypeGuard

import numpy as np

from brachis.arrays import freeze
from brachis.errors import InputError, LimitError, UnknownNameError
from brachis.task import FROM_URDF, LimitScale, LimitSpec

LEAST, LARGEST = 1e-6, 1e12
"""No drive has a smaller or larger limit of torque, velocity, acceleration or their rates, in SI units; products and
squares of such figures are still numbers."""
FARTHEST = 1e6
"""No position is farther from zero, rad or m: there the rounding of numbers is a tenth of a nanometre."""
_NARROWEST = 1e-9


@dataclass(frozen=True)
class Limits:
    """Limits of every joint of the chain; infinite where a joint is not limited. The arrays are read-only.

    Attributes
    ----------
    position_lower, position_upper : (n,) ndarray
        rad or m.
    velocity : (n,) ndarray
        rad/s or m/s.
    acceleration : (n,) ndarray
        rad/s^2 or m/s^2.
    torque : (n,) ndarray
        Nm or N.
    jerk : (n,) ndarray
        rad/s^3 or m/s^3.
    torque_rate : (n,) ndarray
        Nm/s or N/s.
    """

    position_lower: np.ndarray
    position_upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    torque: np.ndarray
    jerk: np.ndarray
    torque_rate: np.ndarray

    def __post_init__(self) -> None:
        """Take copies that nobody can write to."""
        freeze(self, *(each.name for each in fields(self)))

    def with_free_joint(self) -> Limits:
        """Return the limits with those of a further joint, which has none."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return Limits(**{name: np.append(old, -np.inf if name == _LOWEST else np.inf) for name, old in values.items()})


_LOWEST = "position_lower"
MAGNITUDES = tuple(each.name for each in fields(Limits) if not each.name.startswith("position_"))
"""Kinds of limits that are one number > 0 for each joint."""
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


def resolve_limits(spec: LimitSpec, joint_names: Sequence[str], urdf: Sequence[UrdfLimit]) -> Limits:
    """Combine the user's limits with the URDF's.

    Parameters
    ----------
    spec : LimitSpec
        The user's limits.
    joint_names : sequence of str
        The chain's joints.
    urdf : sequence of UrdfLimit
        The URDF's limits of the same joints.

    Returns
    -------
    Limits

    Raises
    ------
    LimitError
        A limit is not positive or, before or after scaling, outside [`LEAST`, `LARGEST`]; a joint has neither a torque
        nor an acceleration limit; a range is empty or ends beyond `FARTHEST`.
    UnknownNameError
        A limit names a joint that is not of the chain.
    """
    names = list(joint_names)
    _check_scale(spec.scale)
    found = {
        kind: _per_joint(kind, getattr(spec, kind), names, [getattr(u, STATED.get(kind, ""), None) for u in urdf])
        for kind in MAGNITUDES
    }
    for name, tau, acc in zip(names, found["torque"], found["acceleration"], strict=True):
        if np.isinf(tau) and np.isinf(acc):
            raise LimitError(
                "has neither a torque nor an acceleration limit, so its time would go to zero",
                joint=name,
                key=f"robot.limits.torque.{name} or robot.limits.acceleration.{name}",
            )
    lower, upper = _ranges(spec.position, names, urdf)
    scaled = {kind: _scaled(kind, limits, spec.scale, names) for kind, limits in found.items()}
    return Limits(position_lower=lower, position_upper=upper, **scaled)


def _check_scale(scale: LimitScale) -> None:
    for kind, factor in vars(scale).items():
        if kind not in MAGNITUDES:
            raise UnknownNameError("limit to scale", kind, MAGNITUDES, where="robot.limits.scale")
        if not (_is_number(factor) and 0.0 < factor < np.inf):
            raise InputError(
                "is not a factor", where=f"robot.limits.scale.{kind}", found=factor, allowed="a finite number > 0"
            )


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float)


def _scaled(kind: str, limits: np.ndarray, scale: LimitScale, names: Sequence[str]) -> np.ndarray:
    """Multiply limits, (n,), by their factor."""
    factor = getattr(scale, kind)
    for name, limit in zip(names, limits, strict=True):
        if np.isfinite(limit):
            _check_size(kind, float(limit) * factor, name, f"robot.limits.scale.{kind}", "scaled ")
    return np.asarray(limits * factor)


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


def per_joint_values(key: str, value: object, names: Sequence[str], missing: object) -> list[object]:
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


def _per_joint(kind: str, value: object, names: list[str], urdf: Sequence[float | None]) -> np.ndarray:
    """Spread one kind of limit over the joints; inf where not limited."""
    key = f"robot.limits.{kind}"
    listed = per_joint_values(key, value, names, FROM_URDF)
    limit = np.full(len(names), np.inf)
    for i, (name, entry, stated) in enumerate(zip(names, listed, urdf, strict=True)):
        chosen = stated if entry == FROM_URDF else entry
        if chosen is None:
            continue
        if not (_is_number(chosen) and chosen > 0.0):
            where = "the URDF" if entry == FROM_URDF else "the task"
            raise LimitError(
                f"{kind} limit in {where} is not {'positive' if _is_number(chosen) else 'a number'}",
                joint=name,
                key=f"{key}.{name}",
                found=f"{chosen:g}" if _is_number(chosen) else repr(chosen),
                allowed="a number > 0, or null for no limit",
            )
        if np.isfinite(chosen):
            _check_size(kind, chosen, name, f"{key}.{name}", "")
        limit[i] = chosen
    return limit


def _ranges(value: object, names: list[str], urdf: Sequence[UrdfLimit]) -> tuple[np.ndarray, np.ndarray]:
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
        if len(ends) != 2 or not all(end is None or _is_number(end) for end in ends):  # noqa: PLR2004
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
        allowed = f"[lower, upper] with lower < upper, {_NARROWEST:g} rad or m apart at least"
        raise LimitError("position range is empty", joint=joint, key=key, found=found, allowed=allowed)
    if any(np.isfinite(end) and abs(end) > FARTHEST for end in (lower, upper)):
        allowed = f"ends within {FARTHEST:g} rad or m of zero, null for an open end"
        raise LimitError("position range ends too far away", joint=joint, key=key, found=found, allowed=allowed)
