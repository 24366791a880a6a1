"""A limit of the user's own is checked before it is used: its parts, their shapes, finite numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from brachis.common.arguments import check_list
from brachis.errors import InputError
from brachis.limits.protocol import Label, Limit, Moments, Partials
from brachis.robot import Robot
from brachis.robot.custom_limits import LimitModel

_MOMENTS = 2
"""Moments at which a limit is tried; two tell (K, c) from (c,)."""


def build_user_limits(
    models: Sequence[LimitModel], robot: Robot, others: Sequence[Limit], where: str
) -> list[Limit]:
    """Bind a user's limits to a robot, and check them.

    Parameters
    ----------
    models : sequence of LimitModel
    robot : Robot
    others : sequence of Limit
        Those that exist already: labels are unique.
    where : str
        What the models are called in messages.

    Raises
    ------
    InputError
        A model cannot be bound, or does not give a limit; its parts do not fit together; a label is taken; its values
        or partials have the wrong shape or are not finite.
    """
    check_list(models, where, "limits")
    limits: list[Limit] = []
    taken = {str(label) for other in others for label in other.labels}
    for number, model in enumerate(models):
        here = f"{where}[{number}]"
        if isinstance(model, type) or not callable(getattr(model, "bind", None)):
            raise InputError(
                "this object is not a limit",
                where=here,
                found=model,
                allowed="an object whose bind(robot) returns a brachis.limits.Limit (docs/own_limit.md)",
            )
        found = type(model).__name__
        try:
            limit = model.bind(robot)
        except (TypeError, ValueError) as error:
            problem = f"the limit cannot be built for this robot: {error}"
            raise InputError(problem, where=here, found=found) from error
        if not isinstance(limit, Limit):
            raise InputError(
                "bind did not return a brachis.limits.Limit",
                where=here,
                found=type(limit).__name__,
            )
        for part, shape, array in _parts_of(limit, robot.n, here):
            _check_array(part, shape, np.asarray(array))
        if not np.all(np.asarray(limit.lower) < limit.upper):
            bounds = [limit.lower, limit.upper]
            raise InputError(
                "the lower bounds are not below the upper bounds",
                where=here,
                found=bounds,
            )
        for label in limit.labels:
            if str(label) in taken:
                problem = "this label exists already; its subject and kind together must be unique"
                raise InputError(problem, where=f"{here}.labels", found=str(label))
        taken |= {str(label) for label in limit.labels}
        limits.append(limit)
    return limits


def _check_array(where: str, shape: tuple[int, ...], array: np.ndarray) -> None:
    """Refuse a wrong shape; also numbers that are not finite, except in bounds, (c,)."""
    is_bound = len(shape) == 1
    if array.shape != shape:
        moments = "" if is_bound else f" for {_MOMENTS} moments"
        raise InputError(
            "the array has the wrong shape",
            where=where,
            found=f"{array.shape}{moments}",
            allowed=shape,
        )
    if not is_bound and not np.all(np.isfinite(array.astype(float))):
        raise InputError(
            "the values are not finite",
            where=where,
            found=array.ravel().tolist(),
            allowed="finite numbers",
        )


def _parts_of(
    limit: Limit, n: int, where: str
) -> Iterator[tuple[str, tuple[int, ...], object]]:
    """Go through the arrays of a limit, those of its functions last; refuse what is missing or of the wrong type.

    Of each: where it stands, the shape that it must have, and the array.
    """
    parts = ("kind", "labels", "lower", "upper")
    missing = [name for name in parts if not hasattr(limit, name)]
    if missing:
        problem = "the limit lacks required attributes"
        raise InputError(problem, where=where, found=f"no {', '.join(missing)}")
    labels = limit.labels
    if not all(isinstance(label, Label) for label in labels):
        problem = "some labels are not a brachis.limits.Label"
        raise InputError(problem, where=f"{where}.labels", found=labels)
    if not labels and not len(limit.lower):
        raise InputError(
            "the limit has no values",
            where=f"{where}.labels",
            allowed="at least one label",
        )
    count = len(labels)
    yield f"{where}.lower", (count,), limit.lower
    yield f"{where}.upper", (count,), limit.upper
    rng = np.random.default_rng(0)
    q, qdot, qddot, qdddot = rng.uniform(-0.1, 0.1, (4, _MOMENTS, n))
    moments = Moments(q, qdot, qddot, qdddot, np.linspace(0.0, 0.5, _MOMENTS))
    shape = (_MOMENTS, count)
    yield f"{where}.values", shape, limit.values(moments)
    where = f"{where}.partials"
    partials = limit.partials(moments)
    if not isinstance(partials, Partials):
        problem = "the return value is not a brachis.limits.Partials"
        raise InputError(problem, where=where, found=partials)
    given = {name: part for name, part in vars(partials).items() if part is not None}
    if not given.keys() - {"s"}:
        allowed = "at least one of q, qdot, qddot, qdddot"
        raise InputError(
            "all partial derivatives are None", where=where, allowed=allowed
        )
    for name, part in given.items():
        yield f"{where}.{name}", shape if name == "s" else (*shape, n), part
