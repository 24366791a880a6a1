"""A limit of the user's own is looked at before it is used: what it is made of, shapes, finite numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.custom_limits import LimitModel
from brachis.errors import InputError
from brachis.limits.protocol import Limit, Moments, Partials
from brachis.robot import Robot

_MOMENTS = 2
"""Moments at which a limit is tried; two tell (K, c) from (c,)."""


def bound_limits(models: Sequence[LimitModel], robot: Robot, taken: Sequence[str]) -> list[Limit]:
    """Bind a user's limits to a robot, and check them.

    Parameters
    ----------
    models : sequence of LimitModel
    robot : Robot
    taken : sequence of str
        Kinds that there are already.

    Raises
    ------
    InputError
        A model cannot be bound, or its limit is none; its kind is taken; its parts do not fit together; its values or
        partials have the wrong shape or are not finite.
    """
    if not isinstance(models, Sequence):
        raise InputError("is no list", where="limits", found=models, allowed="a list of limits: limits=[...]")
    found: list[Limit] = []
    for number, model in enumerate(models):
        where = f"limits[{number}]"
        if isinstance(model, type) or not callable(getattr(model, "bind", None)):
            raise InputError(
                "is no limit that can be bound to a robot",
                where=where,
                found=model,
                allowed="an object whose bind(robot) returns a brachis.limits.Limit (docs/own_limit.md)",
            )
        limit = model.bind(robot)
        if not isinstance(limit, Limit):
            raise InputError("bind returned no brachis.limits.Limit", where=where, found=limit)
        if limit.kind in (*taken, *(other.kind for other in found)):
            raise InputError("its kind is taken", where=f"{where}.kind", found=limit.kind, allowed="a name of its own")
        _check(limit, robot.n, where)
        found.append(limit)
    return found


def _check(limit: Limit, n: int, where: str) -> None:
    """Refuse a limit whose parts do not fit together."""
    missing = [name for name in ("kind", "labels", "lower", "upper") if not hasattr(limit, name)]
    if missing:
        raise InputError("lacks what every limit has", where=where, found=f"no {', '.join(missing)}")
    count = len(limit.labels)
    for name in ("lower", "upper"):
        _check_shape(f"{where}.{name}", np.asarray(getattr(limit, name)), (count,), finite=False)
    if not np.all(np.asarray(limit.lower) < limit.upper):
        raise InputError("lower is not below upper", where=where, found=[limit.lower, limit.upper])
    rng = np.random.default_rng(0)
    moments = Moments(*(rng.uniform(-0.1, 0.1, (_MOMENTS, n)) for _ in range(3)))
    _check_shape(f"{where}.values", limit.values(moments), (_MOMENTS, count))
    partials = limit.partials(moments)
    if not isinstance(partials, Partials):
        raise InputError("is no brachis.limits.Partials", where=f"{where}.partials", found=partials)
    given = {name: getattr(partials, name) for name in ("q", "qdot", "qddot")}
    if all(part is None for part in given.values()):
        raise InputError("are all None", where=f"{where}.partials", allowed="at least one of q, qdot, qddot")
    for name, part in given.items():
        if part is not None:
            _check_shape(f"{where}.partials.{name}", part, (_MOMENTS, count, n))


def _check_shape(where: str, array: object, shape: tuple[int, ...], *, finite: bool = True) -> None:
    """Refuse what is no array of a shape, or not finite."""
    found = np.asarray(array).shape
    if found != shape:
        moments = f" for {_MOMENTS} moments" if finite else ""
        raise InputError("has the wrong shape", where=where, found=f"{found}{moments}", allowed=f"{shape}")
    if finite and not np.all(np.isfinite(np.asarray(array, dtype=float))):
        raise InputError("is not finite", where=where, found=array, allowed="finite numbers")
