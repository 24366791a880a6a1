"""A limit of the user's own is checked before it is used: its members, the shapes of its arrays, its derivatives."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from brachis.common.arguments import check_array, check_finite
from brachis.errors import InputError
from brachis.limits.derivatives import check_partials, sample_moments, write_posture
from brachis.limits.protocol import (
    Bound,
    Guarantee,
    Label,
    Limit,
    Moments,
    Partials,
    Role,
)
from brachis.robot import Robot
from brachis.robot.custom_limits import (
    LimitModel,
    bind_model,
    check_ratios,
    has_check,
)

_MOMENTS = 2
"""Moments at which the shapes are tried; two tell (K, c) from (c,)."""


@dataclass(frozen=True)
class _Member:
    """What a member of a limit may be.

    Attributes
    ----------
    is_allowed : callable
        Tells of the value and the limit whether the value may be used; it may raise TypeError or ValueError if not.
    allowed : str
        The same in words.
    """

    is_allowed: Callable[[Any, Limit], object]
    allowed: str


def _is_text(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip())


def _is_per_value(value: Any, limit: Limit) -> bool:
    """Tell whether a value is one finite number, or one for each of the limit's c values."""
    sizes = (), (len(limit.labels),)
    return np.shape(value) in sizes and bool(np.all(np.isfinite(value)))


def _is_centre(value: np.ndarray, limit: Limit) -> bool:
    """Tell whether values lie between the bounds; NaN is for values without a bound."""
    is_open = np.isneginf(limit.lower) & np.isposinf(limit.upper)
    is_between = (limit.lower <= value) & (value <= limit.upper)
    return value.shape == limit.lower.shape and bool(np.all(is_between | is_open))


def _is_bound(value: object, limit: Limit) -> bool:
    """Tell whether a value is a `Bound` of one of the limit's c values."""
    if not isinstance(value, Bound) or value.side not in {None, "lower", "upper"}:
        return False
    figures = [value.figure, value.full_scale, value.per_unit]
    return value.column in range(len(limit.labels)) and bool(
        np.all(np.isfinite(figures))
    )


def _is_in_path(breaks: np.ndarray) -> bool:
    """Tell whether an array holds path coordinates."""
    return np.ndim(breaks) == 1 and bool(np.all((breaks >= 0.0) & (breaks <= 1.0)))


_MEMBERS = {
    "kind": _Member(lambda kind, _: _is_text(kind), "a name"),
    "guarantee": _Member(
        lambda value, _: isinstance(value, Guarantee),
        "a brachis.limits.Guarantee, such as Guarantee.AS_MEAN",
    ),
    "role": _Member(
        lambda value, _: isinstance(value, Role),
        "a brachis.limits.Role, such as Role.PROCESS",
    ),
    "longer_time": _Member(
        lambda value, _: value in {"relieves", "neither"}, "'relieves' or 'neither'"
    ),
    "at_rest": _Member(
        lambda value, _: value in {"nothing", "posture", "turns"},
        "'nothing', 'posture' or 'turns'",
    ),
    "order": _Member(
        lambda value, _: value in {2, 3}, "2, or 3 if the values use qdddot"
    ),
    "breaks": _Member(
        lambda breaks, _: _is_in_path(np.asarray(breaks)),
        "path coordinates from 0 to 1, (b,)",
    ),
    "violation_scale": _Member(
        lambda scale, limit: (
            _is_per_value(scale, limit) and np.all(np.asarray(scale) > 0.0)
        ),
        "numbers > 0, (c,), or one number",
    ),
    "inset": _Member(
        lambda inset, limit: (
            _is_per_value(inset, limit) and np.all(np.asarray(inset) >= 0.0)
        ),
        "numbers >= 0, (c,), or one number",
    ),
    "centre": _Member(
        lambda centre, limit: _is_centre(np.asarray(centre), limit),
        "values between the bounds, (c,)",
    ),
    "bounds": _Member(
        lambda bounds, limit: all(_is_bound(each, limit) for each in bounds),
        "a brachis.limits.Bound for each figure, of a column from 0 to c - 1, all numbers finite",
    ),
    "refusal": _Member(lambda text, _: _is_text(text), "a text"),
}
"""What the members of a limit may be, apart from its labels and the arrays of its bounds, which are checked before."""


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
            _try_check(model, limit, robot, where)
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
    _check_labels(limit, where)
    for name in ("lower", "upper"):
        check_array(getattr(limit, name), (len(limit.labels),), f"{where}.{name}")
    if not np.all(limit.lower < limit.upper):
        raise InputError(
            "the lower bounds are not below the upper bounds",
            where=where,
            found=[limit.lower, limit.upper],
        )
    for name, member in _MEMBERS.items():
        value = getattr(limit, name)
        try:
            is_allowed = member.is_allowed(value, limit)
        except (TypeError, ValueError):
            is_allowed = False
        if not is_allowed:
            raise InputError(
                f"{name} is not valid",
                where=f"{where}.{name}",
                found=f"{value!r:.200}",
                allowed=member.allowed,
            )


def _check_labels(limit: Limit, where: str) -> None:
    """Refuse what is not a list of labels, and labels that are not of text."""
    labels = limit.labels
    here = f"{where}.labels"
    allowed = "a tuple with a brachis.limits.Label of texts for each value"
    if not isinstance(labels, tuple | list):
        raise InputError("wrong type", where=here, found=labels, allowed=allowed)
    for label in labels:
        if not isinstance(label, Label):
            problem = "some labels are not a brachis.limits.Label"
            raise InputError(problem, where=here, found=labels)
        if not all(isinstance(text, str) for text in vars(label).values()):
            raise InputError("wrong type", where=here, found=label, allowed=allowed)
    if not labels and not np.size(limit.lower):
        raise InputError(
            "the limit has no values", where=here, allowed="at least one label"
        )


def _check_functions(limit: Limit, robot: Robot, where: str) -> None:
    """Refuse values and partial derivatives of the wrong type or shape, not finite, or that contradict each other.

    A limit may be undefined in some postures: those are left out, if they are not most of them.
    """
    few = sample_moments(robot, _MOMENTS)
    _check_values(limit, few, where)
    _check_shapes(limit, few, where)
    moments = sample_moments(robot)
    values = _check_values(limit, moments, where)
    is_known = np.isfinite(values).all(axis=1)
    if 2 * np.count_nonzero(is_known) <= len(is_known):
        moment, column = np.argwhere(~np.isfinite(values))[0]
        posture = write_posture(moments, moment)
        raise InputError(
            "the values are not finite",
            where=f"{where}.values",
            found=f"{values[moment, column]} for {limit.labels[column]!s} at {posture}",
            allowed="finite numbers in most postures within the joints' ranges, at moderate speeds",
        )
    parts = (getattr(moments, own.name)[is_known] for own in fields(moments))
    known = Moments(*parts)
    for name, part in _check_shapes(limit, known, where).items():
        check_finite(part, f"{where}.partials.{name}")
    check_partials(limit, known, robot, where)


def _check_values(limit: Limit, moments: Moments, where: str) -> np.ndarray:
    """Return the values, (K, c), which may not be finite."""
    values = limit.values(moments)
    count = len(moments.q)
    shape = (count, len(limit.labels))
    check_array(values, shape, f"{where}.values", remark=f" for {count} moments")
    return values


def _check_shapes(limit: Limit, moments: Moments, where: str) -> dict[str, np.ndarray]:
    """Return the partial derivatives that are not None."""
    partials = limit.partials(moments)
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
    count, n = moments.q.shape
    shape = (count, len(limit.labels))
    for name, part in given.items():
        own = shape if name == "s" else (*shape, n)
        check_array(part, own, f"{here}.{name}", remark=f" for {count} moments")
    return given


def _try_check(model: LimitModel, limit: Limit, robot: Robot, where: str) -> None:
    """Refuse a formula for the verification that does not give a ratio for every moment and value."""
    moments = sample_moments(robot, _MOMENTS)
    motion = (moments.q, moments.qdot, moments.qddot, moments.torque(robot))
    check_ratios(where, model, robot, motion, len(limit.labels))
