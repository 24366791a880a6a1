"""A limit of the user's own is checked before it is used: its members, the shapes of its arrays, its derivatives."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from brachis.common.arguments import check_array, check_finite
from brachis.common.labels import Label
from brachis.errors import InputError
from brachis.limits.derivatives import check_partials, sample_moments, write_posture
from brachis.limits.protocol import Bound, Guarantee, Limit, Moments, Partials, Role
from brachis.robot import Robot
from brachis.robot.custom_limits import (
    LimitModel,
    bind_model,
    check_ratios,
    has_check,
)


def _is_label(label: object) -> bool:
    """Tell whether a value is a label of texts."""
    return isinstance(label, Label) and all(
        isinstance(text, str) for text in vars(label).values()
    )


def _is_text(value: object, _limit: Limit) -> bool:
    return isinstance(value, str) and bool(value.strip())


def _is_per_value(value: Any, limit: Limit) -> bool:
    """Tell whether a value is one finite number, or one for each of the limit's c values."""
    sizes = (), (len(limit.labels),)
    return np.shape(value) in sizes and bool(np.all(np.isfinite(value)))


def _is_centre(value: Any, limit: Limit) -> bool:
    """Tell whether values lie between the bounds; NaN is for values without a bound."""
    is_open = np.isneginf(limit.lower) & np.isposinf(limit.upper)
    is_between = (limit.lower <= value) & (value <= limit.upper)
    return np.shape(value) == limit.lower.shape and bool(np.all(is_between | is_open))


def _are_bounds(bounds: Any, limit: Limit) -> bool:
    """Tell whether a value is a list of `Bound`, each of one of the limit's c values."""
    return all(
        isinstance(bound, Bound)
        and bound.side in {None, "lower", "upper"}
        and bound.column in range(len(limit.labels))
        and np.all(np.isfinite([bound.figure, bound.full_scale, bound.per_unit]))
        for bound in bounds
    )


def _are_in_path(breaks: Any, _limit: Limit) -> bool:
    """Tell whether a value is a list of path coordinates."""
    values = np.asarray(breaks)
    return values.ndim == 1 and bool(np.all((values >= 0.0) & (values <= 1.0)))


_MEMBERS: dict[str, tuple[str, Callable[[Any, Limit], object]]] = {
    "kind": ("a name", _is_text),
    "guarantee": (
        "a brachis.limits.Guarantee, such as Guarantee.AS_MEAN",
        lambda value, _: isinstance(value, Guarantee),
    ),
    "role": (
        "a brachis.limits.Role, such as Role.PROCESS",
        lambda value, _: isinstance(value, Role),
    ),
    "longer_time": (
        "'relieves' or 'neither'",
        lambda value, _: value in {"relieves", "neither"},
    ),
    "at_rest": (
        "'nothing', 'posture' or 'turns'",
        lambda value, _: value in {"nothing", "posture", "turns"},
    ),
    "order": ("2, or 3 if the values use qdddot", lambda value, _: value in {2, 3}),
    "breaks": ("path coordinates from 0 to 1, (b,)", _are_in_path),
    "violation_scale": (
        "numbers > 0, (c,), or one number",
        lambda scale, limit: _is_per_value(scale, limit) and np.min(scale) > 0.0,
    ),
    "inset": (
        "numbers >= 0, (c,), or one number",
        lambda inset, limit: _is_per_value(inset, limit) and np.min(inset) >= 0.0,
    ),
    "centre": ("values between the bounds, (c,)", _is_centre),
    "bounds": (
        "a brachis.limits.Bound for each figure, of a column from 0 to c - 1, all numbers finite",
        _are_bounds,
    ),
    "refusal": ("a text", _is_text),
}
"""Members of a limit, each with what is allowed: in words, and as a function of value and limit that tells whether it
is. It may raise TypeError or ValueError if not. The labels and the arrays of the bounds are checked before."""


def build_user_limits(
    models: Mapping[str, LimitModel],
    robot: Robot,
    others: Sequence[Limit],
    kinds: Collection[str],
) -> list[Limit]:
    """Bind a user's limits to a robot, and check them.

    Parameters
    ----------
    models : mapping of str to LimitModel
        By where they stand, for messages.
    robot : Robot
    others : sequence of Limit
        Those that exist already: labels are unique.
    kinds : collection of str
        Those of the built-in limits.

    Raises
    ------
    InputError
        A model cannot be bound, or does not give a limit; its members are not allowed or do not fit together; its kind
        or a label is taken; its values or partials have the wrong shape, are not finite or contradict each other.
    """
    limits: list[Limit] = []
    labels = {str(label) for other in others for label in other.labels}
    names = {kind.replace("_", " ") for kind in kinds}
    for where, model in models.items():
        limit = bind_model(where, model, robot)
        _check_members(limit, where)
        if limit.name in names:
            raise InputError(
                "a built-in limit has this kind already",
                where=f"{where}.kind",
                found=limit.kind,
                allowed="a kind of its own",
            )
        for label in limit.labels:
            if str(label) in labels:
                problem = "this label exists already; its subject and kind together must be unique"
                raise InputError(problem, where=f"{where}.labels", found=str(label))
        _check_functions(limit, robot, where)
        if has_check(model):
            moments = sample_moments(robot)
            tau = moments.torque_of(robot.chain)
            motion = (moments.q, moments.qdot, moments.qddot, tau)
            few = 1 + len(limit.labels) % 2  # moments, not as many as values
            check_ratios(
                where, model, robot, [own[:few] for own in motion], len(limit.labels)
            )
        labels |= {str(label) for label in limit.labels}
        limits.append(limit)
    return limits


def _check_members(limit: Limit, where: str) -> None:
    """Refuse a limit that lacks a member, or has one that is not allowed."""
    parts = ("kind", "labels", "lower", "upper")
    missing = [name for name in parts if not hasattr(limit, name)]
    if missing:
        problem = "the limit lacks required attributes"
        raise InputError(problem, where=where, found=f"no {', '.join(missing)}")
    labels = limit.labels
    here = f"{where}.labels"
    if not (isinstance(labels, tuple | list) and all(map(_is_label, labels))):
        raise InputError(
            "wrong type",
            where=here,
            found=labels,
            allowed="a tuple with a brachis.limits.Label of texts for each value",
        )
    if not labels and not np.size(limit.lower):
        raise InputError(
            "the limit has no values", where=here, allowed="at least one label"
        )
    for name in ("lower", "upper"):
        check_array(getattr(limit, name), (len(labels),), f"{where}.{name}")
    if not np.all(limit.lower < limit.upper):
        raise InputError(
            "the lower bounds are not below the upper bounds",
            where=where,
            found=[limit.lower, limit.upper],
        )
    for name, (allowed, accepts) in _MEMBERS.items():
        value = getattr(limit, name)
        try:
            is_allowed = accepts(value, limit)
        except (TypeError, ValueError):
            is_allowed = False
        if not is_allowed:
            raise InputError(
                f"{name} is not valid",
                where=f"{where}.{name}",
                found=f"{value!r:.200}",
                allowed=allowed,
            )


def _check_functions(limit: Limit, robot: Robot, where: str) -> None:
    """Refuse values and partial derivatives of the wrong type or shape, not finite, or that contradict each other.

    A limit may be undefined in some postures: those are left out, if they are not most of them.
    """
    moments = sample_moments(robot)
    count = len(moments.q)
    c = len(limit.labels)
    values = limit.values(moments)
    check_array(values, (count, c), f"{where}.values", remark=f" for {count} moments")
    is_known = np.isfinite(values).all(axis=1)
    if 2 * np.count_nonzero(is_known) <= count:
        moment, column = np.argwhere(~np.isfinite(values))[0]
        posture = write_posture(moments, moment)
        raise InputError(
            "the values are not finite",
            where=f"{where}.values",
            found=f"{values[moment, column]} for {limit.labels[column]!s} at {posture}",
            allowed="finite numbers in most postures within the joints' ranges, at moderate speeds",
        )
    known = Moments(*(getattr(moments, own.name)[is_known] for own in fields(moments)))
    partials = limit.partials(known)
    here = f"{where}.partials"
    if not isinstance(partials, Partials):
        problem = "the return value is not a brachis.limits.Partials"
        raise InputError(problem, where=here, found=partials)
    given = {name: part for name, part in vars(partials).items() if part is not None}
    if not given.keys() - {"s"}:
        allowed = "at least one of q, qdot, qddot, qdddot"
        raise InputError(
            "all partial derivatives are None", where=here, allowed=allowed
        )
    count, n = known.q.shape
    for name, part in given.items():
        shape = (count, c) if name == "s" else (count, c, n)
        check_array(part, shape, f"{here}.{name}", remark=f" for {count} moments")
        check_finite(part, f"{here}.{name}")
    check_partials(limit, known, robot, where)
