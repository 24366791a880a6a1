"""Torque limits that fall with speed: a piecewise linear curve for each joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from brachis.errors import InputError, UnknownNameError

Curve = tuple[tuple[float, float], ...]
"""Points (speed, torque), rad/s or m/s and Nm or N, from speed 0 on; empty where there is no curve."""

_KEY = "robot.limits.torque_speed"
_FEWEST = 2
_LEAST, _LARGEST = 1e-6, 1e12
"""Of a torque at rest and of the last speed, in SI units."""
_LEVEL = 1e-12
"""Torques that rise by less, as a part of the torque at rest, are rounded figures of the same torque."""


def resolve_curves(
    stated: object, names: Sequence[str], factor: float
) -> tuple[Curve, ...]:
    """Check the curves of a chain's joints and scale their torques.

    Parameters
    ----------
    stated : mapping of str to sequence of pairs or None
        Points (speed, torque) by joint name.
    names : sequence of str
    factor : float
        On all torques.

    Returns
    -------
    (n,) tuple of Curve

    Raises
    ------
    InputError
        A curve does not begin at speed 0, its speeds do not ascend, a torque is negative, or it rises.
    UnknownNameError
        A joint is not of the chain.
    """
    if stated is None:
        return ((),) * len(names)
    if not isinstance(stated, Mapping):
        raise InputError(
            "is no mapping of joint names",
            where=_KEY,
            found=stated,
            allowed="{joint: [[speed, torque], ...]}",
        )
    for name in stated:
        if name not in names:
            raise UnknownNameError("joint", name, names, where=_KEY)
    return tuple(_checked(stated.get(name), name, factor) for name in names)


def _checked(points: object, joint: str, factor: float) -> Curve:
    """Return a joint's curve, its torques scaled."""
    if points is None:
        return ()
    key = f"{_KEY}.{joint}"
    try:
        table = np.array(points, dtype=float)
    except (TypeError, ValueError):
        table = np.empty(0)
    if (
        table.ndim != 2
        or table.shape[1] != 2
        or len(table) < _FEWEST
        or not np.isfinite(table).all()
    ):
        allowed = "two or more points [speed, torque]"
        raise InputError("is no torque curve", where=key, found=points, allowed=allowed)
    speed, torque = table.T
    found = ", ".join(f"[{v:g}, {tau:g}]" for v, tau in table)
    if speed[0] != 0.0 or not np.all(np.diff(speed) > 0.0) or not speed[-1] <= _LARGEST:
        allowed = "speeds that begin at 0 and ascend"
        raise InputError(
            "speeds are out of order", where=key, found=found, allowed=allowed
        )
    if not (_LEAST <= torque[0] * factor <= _LARGEST and np.all(torque >= 0.0)):
        allowed = f"torques >= 0, at rest from {_LEAST:g} to {_LARGEST:g}, scaled too"
        raise InputError(
            "torques are none of a drive", where=key, found=found, allowed=allowed
        )
    rising = np.flatnonzero(np.diff(torque) > _LEVEL * torque[0])
    if len(rising):
        raise InputError(
            "the torque rises with the speed",
            where=f"{key}[{rising[0] + 1}]",
            found=found,
            allowed="torques that stay or fall from point to point",
            hint="Leave out the points to which it rises; the curve then lies below them",
        )
    return tuple(
        zip(
            speed.tolist(),
            (np.minimum.accumulate(torque) * factor).tolist(),
            strict=True,
        )
    )
