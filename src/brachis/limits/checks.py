"""A limit of the user's own is checked before it is used: its parts, their shapes, finite numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.common.arguments import check_list
from brachis.errors import InputError
from brachis.limits.protocol import Label, Limit, Moments, Partials
from brachis.robot import Robot
from brachis.robot.custom_limits import LimitModel


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
                "is not a limit that can be bound to a robot",
                where=here,
                found=model,
                allowed="an object whose bind(robot) returns a brachis.limits.Limit (docs/own_limit.md)",
            )
        found = type(model).__name__
        try:
            limit = model.bind(robot)
        except (TypeError, ValueError) as error:
            problem = f"cannot be bound to the robot: {error}"
            raise InputError(problem, where=here, found=found) from error
        if not isinstance(limit, Limit):
            raise InputError(
                "bind does not return a brachis.limits.Limit",
                where=here,
                found=type(limit).__name__,
            )
        _check_data(limit, here)
        _check_functions(limit, robot.n, here)
        for label in limit.labels:
            if str(label) in taken:
                problem = "the label is taken; subject and kind together name a value"
                raise InputError(problem, where=f"{here}.labels", found=str(label))
        taken |= {str(label) for label in limit.labels}
        limits.append(limit)
    return limits


def _check_data(limit: Limit, where: str) -> None:
    """Refuse labels and bounds that do not fit together."""
    parts = ("kind", "labels", "lower", "upper")
    missing = [name for name in parts if not hasattr(limit, name)]
    if missing:
        problem = "lacks what every limit has"
        raise InputError(problem, where=where, found=f"no {', '.join(missing)}")
    labels = limit.labels
    if not all(isinstance(label, Label) for label in labels):
        problem = "are not all brachis.limits.Label"
        raise InputError(problem, where=f"{where}.labels", found=labels)
    if not labels and not len(limit.lower):
        raise InputError(
            "the limit has no values",
            where=f"{where}.labels",
            allowed="at least one label",
        )
    for name in ("lower", "upper"):
        _check_shape(f"{where}.{name}", getattr(limit, name), (len(labels),))
    if not np.all(np.asarray(limit.lower) < limit.upper):
        bounds = [limit.lower, limit.upper]
        raise InputError("lower is not below upper", where=where, found=bounds)


def _check_functions(limit: Limit, n: int, where: str) -> None:
    """Refuse values and partials at two moments that have the wrong shape, or are not finite."""
    shape = (2, len(limit.labels))
    q, qdot, qddot, qdddot = np.random.default_rng(0).uniform(-0.1, 0.1, (4, 2, n))
    moments = Moments(q, qdot, qddot, qdddot, np.array([0.0, 0.5]))
    _check_result(f"{where}.values", limit.values(moments), shape)
    where = f"{where}.partials"
    partials = limit.partials(moments)
    if not isinstance(partials, Partials):
        problem = "is not a brachis.limits.Partials"
        raise InputError(problem, where=where, found=partials)
    given = {name: part for name, part in vars(partials).items() if part is not None}
    if not given.keys() - {"s"}:
        allowed = "at least one of q, qdot, qddot, qdddot"
        raise InputError("are all None", where=where, allowed=allowed)
    for name, part in given.items():
        by_joint = shape if name == "s" else (*shape, n)
        _check_result(f"{where}.{name}", part, by_joint)


def _check_shape(
    where: str, array: object, shape: tuple[int, ...], aside: str = ""
) -> None:
    found = np.asarray(array).shape
    if found != shape:
        raise InputError(
            "has the wrong shape", where=where, found=f"{found}{aside}", allowed=shape
        )


def _check_result(where: str, array: object, shape: tuple[int, ...]) -> None:
    _check_shape(where, array, shape, " for 2 moments")
    found = np.asarray(array, dtype=float)
    if not np.all(np.isfinite(found)):
        raise InputError(
            "is not finite",
            where=where,
            found=found.ravel().tolist(),
            allowed="finite numbers",
        )
