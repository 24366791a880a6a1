"""A limit of the user's own is looked at before it is used: what it is made of, shapes, finite numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.common.arguments import check_list
from brachis.errors import InputError
from brachis.limits.protocol import Label, Limit, Moments, Partials
from brachis.robot import Robot
from brachis.robot.custom_limits import LimitModel

_MOMENTS = 2
"""Moments at which a limit is tried; two tell (K, c) from (c,)."""


def bound_limits(
    models: Sequence[LimitModel], robot: Robot, others: Sequence[Limit], where: str
) -> list[Limit]:
    """Bind a user's limits to a robot, and check them.

    Parameters
    ----------
    models : sequence of LimitModel
    robot : Robot
    others : sequence of Limit
        Those that there are already: labels are unique.
    where : str
        What the models are called in messages.

    Raises
    ------
    InputError
        A model cannot be bound, or its limit is none; its parts do not fit together; a label is taken; its values or
        partials have the wrong shape or are not finite.
    """
    check_list(models, where, "limits")
    found: list[Limit] = []
    for number, model in enumerate(models):
        here = f"{where}[{number}]"
        if isinstance(model, type) or not callable(getattr(model, "bind", None)):
            raise InputError(
                "is no limit that can be bound to a robot",
                where=here,
                found=model,
                allowed="an object whose bind(robot) returns a brachis.limits.Limit (docs/own_limit.md)",
            )
        try:
            limit = model.bind(robot)
        except (TypeError, ValueError) as error:
            raise InputError(
                f"cannot be bound to the robot: {error}",
                where=here,
                found=type(model).__name__,
            ) from error
        if not isinstance(limit, Limit):
            raise InputError(
                "bind returned no brachis.limits.Limit",
                where=here,
                found=type(limit).__name__,
            )
        _check(limit, robot.n, here)
        taken = {str(label) for other in (*others, *found) for label in other.labels}
        for label in limit.labels:
            if str(label) in taken:
                problem = "the label is taken; subject and kind together name a value"
                raise InputError(problem, where=f"{here}.labels", found=str(label))
        found.append(limit)
    return found


def _check(limit: Limit, n: int, where: str) -> None:
    """Refuse a limit whose parts do not fit together."""
    missing = [
        name
        for name in ("kind", "labels", "lower", "upper")
        if not hasattr(limit, name)
    ]
    if missing:
        raise InputError(
            "lacks what every limit has", where=where, found=f"no {', '.join(missing)}"
        )
    count = len(limit.labels)
    if not all(isinstance(label, Label) for label in limit.labels):
        raise InputError(
            "are not all brachis.limits.Label",
            where=f"{where}.labels",
            found=limit.labels,
        )
    if not count and not len(limit.lower):
        raise InputError(
            "the limit has no values",
            where=f"{where}.labels",
            allowed="at least one label",
        )
    for name in ("lower", "upper"):
        _check_shape(
            f"{where}.{name}", np.asarray(getattr(limit, name)), (count,), finite=False
        )
    if not np.all(np.asarray(limit.lower) < limit.upper):
        raise InputError(
            "lower is not below upper", where=where, found=[limit.lower, limit.upper]
        )
    _check_functions(limit, n, where)


def _check_functions(limit: Limit, n: int, where: str) -> None:
    """Refuse values and partials of the wrong shape, or that are not finite."""
    count, rng = len(limit.labels), np.random.default_rng(0)
    q, qdot, qddot, qdddot = rng.uniform(-0.1, 0.1, (4, _MOMENTS, n))
    moments = Moments(q, qdot, qddot, qdddot, np.linspace(0.0, 0.5, _MOMENTS))
    _check_shape(f"{where}.values", limit.values(moments), (_MOMENTS, count))
    partials = limit.partials(moments)
    if not isinstance(partials, Partials):
        raise InputError(
            "is no brachis.limits.Partials", where=f"{where}.partials", found=partials
        )
    given = {name: getattr(partials, name) for name in ("q", "qdot", "qddot", "qdddot")}
    if all(part is None for part in given.values()):
        raise InputError(
            "are all None",
            where=f"{where}.partials",
            allowed="at least one of q, qdot, qddot, qdddot",
        )
    for name, part in given.items():
        if part is not None:
            _check_shape(f"{where}.partials.{name}", part, (_MOMENTS, count, n))
    if partials.s is not None:
        _check_shape(f"{where}.partials.s", partials.s, (_MOMENTS, count))


def _check_shape(
    where: str, array: object, shape: tuple[int, ...], *, finite: bool = True
) -> None:
    """Refuse what is no array of a shape, or not finite."""
    found = np.asarray(array).shape
    if found != shape:
        moments = f" for {_MOMENTS} moments" if finite else ""
        raise InputError(
            "has the wrong shape",
            where=where,
            found=f"{found}{moments}",
            allowed=f"{shape}",
        )
    if finite and not np.all(np.isfinite(np.asarray(array, dtype=float))):
        raise InputError(
            "is not finite",
            where=where,
            found=np.asarray(array).ravel().tolist(),
            allowed="finite numbers",
        )
