"""Checks of a user's limit before it is used: its members, the shapes of its arrays, its derivatives.

Partial derivatives are compared with central differences of the values, joint by joint, at a few random moments. Limits
may have kinks and steps, and their values may be noisy. The differences are therefore computed with two step sizes, and
the difference between the two results is taken as the allowed error. A partial derivative is refused if it is wrong at
most of the moments.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from brachis.common.arguments import check_array, check_finite
from brachis.common.labels import Label
from brachis.errors import InputError
from brachis.limits.protocol import Bound, Guarantee, Limit, Moments, Partials, Role
from brachis.robot import Robot
from brachis.robot.custom_limits import (
    LimitModel,
    bind_model,
    check_ratios,
    has_check,
)

_COUNT = 6
"""Number of moments at which derivatives are compared."""
_STEP = 1e-3
"""Step of the differences, as a fraction of the range of the motion; large enough for single precision."""
_FURTHEST = 1.0
"""Largest speed, acceleration and jerk at the random moments, in rad or m, and seconds."""
_PRECISION = 2e-3
"""Maximum difference between the stated slope and the computed one, as a fraction of the largest slope."""
_ROUNDING = 1e-3
"""Slopes smaller than this fraction of the values count as zero."""
_MARGIN = 5.0
"""Factor on the difference between the slopes found with the two step sizes; the product is allowed as an error too."""


def _is_label(label: object) -> bool:
    """Tell whether a value is a label whose entries are texts."""
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
    """Tell whether values lie between the bounds; a value without bounds may be NaN."""
    is_open = np.isneginf(limit.lower) & np.isposinf(limit.upper)
    is_between = (limit.lower <= value) & (value <= limit.upper)
    return np.shape(value) == limit.lower.shape and bool(np.all(is_between | is_open))


def _are_bounds(bounds: Any, limit: Limit) -> bool:
    """Tell whether a value is a list of `Bound`, each for one of the limit's c values."""
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
"""Members of a limit, each with the allowed values in words, and with a function of the value and the limit that tells
whether the value is allowed. For a value that is not, the function may also raise TypeError or ValueError. The labels
and the arrays of bounds are checked beforehand."""


def build_own_limits(
    models: Mapping[str, LimitModel],
    robot: Robot,
    existing: Sequence[Limit],
    kinds: Collection[str],
) -> list[Limit]:
    """Bind a user's limits to a robot, and check them.

    Parameters
    ----------
    models : mapping of str to LimitModel
        The user's limits. The keys are the places where the limits are given, for messages.
    robot : Robot
    existing : sequence of Limit
        The limits that exist already. Labels must be unique.
    kinds : collection of str
        The kinds of the built-in limits.

    Raises
    ------
    InputError
        A model cannot be bound, or `bind` does not return a limit; a member is not allowed, or members do not fit
        together; the kind or a label is taken; values or partials have the wrong shape, are not finite or contradict
        each other.
    """
    limits: list[Limit] = []
    labels = {str(label) for known in existing for label in known.labels}
    names = {kind.replace("_", " ") for kind in kinds}
    for where, model in models.items():
        limit = bind_model(where, model, robot)
        _check_members(limit)
        if limit.name in names:
            raise InputError(
                "a built-in limit has this kind already",
                where=f"{where}.kind",
                found=limit.kind,
                allowed="a kind of its own",
            )
        for label in limit.labels:
            if str(label) in labels:
                raise InputError(
                    "this label exists already; its subject and kind together must be unique",
                    where=f"{where}.labels",
                    found=str(label),
                )
        _check_functions(limit, robot)
        if has_check(model):
            moments = sample_moments(robot)
            tau = moments.torque_of(robot.dynamic_chain)
            motion = (moments.q, moments.qdot, moments.qddot, tau)
            few = 1 + len(limit.labels) % 2  # moments, not as many as values
            check_ratios(
                where,
                model,
                robot,
                [states[:few] for states in motion],
                len(limit.labels),
            )
        labels |= {str(label) for label in limit.labels}
        limits.append(limit)
    return limits


def _check_members(limit: Limit) -> None:
    """Refuse a limit that lacks a member, or has a member with a value that is not allowed."""
    required = ("kind", "labels", "lower", "upper")
    missing = [name for name in required if not hasattr(limit, name)]
    if missing:
        raise InputError(
            "the limit lacks required attributes",
            where=limit.origin,
            found=f"no {', '.join(missing)}",
        )
    labels = limit.labels
    here = f"{limit.origin}.labels"
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
        check_array(getattr(limit, name), (len(labels),), f"{limit.origin}.{name}")
    if not np.all(limit.lower < limit.upper):
        raise InputError(
            "the lower bounds are not below the upper bounds",
            where=limit.origin,
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
                where=f"{limit.origin}.{name}",
                found=f"{value!r:.200}",
                allowed=allowed,
            )


def _check_functions(limit: Limit, robot: Robot) -> None:
    """Refuse values and partial derivatives of the wrong type or shape, and those that are not finite or do not agree.

    A limit may be undefined in some postures. Such postures are left out, provided that they are a minority.
    """
    moments = sample_moments(robot)
    count = len(moments.q)
    c = len(limit.labels)
    values = limit.values(moments)
    check_array(
        values, (count, c), f"{limit.origin}.values", remark=f" for {count} moments"
    )
    is_known = np.isfinite(values).all(axis=1)
    if 2 * np.count_nonzero(is_known) <= count:
        moment, column = np.argwhere(~np.isfinite(values))[0]
        posture = write_posture(moments, moment)
        raise InputError(
            "the values are not finite",
            where=f"{limit.origin}.values",
            found=f"{values[moment, column]} for {limit.labels[column]!s} at {posture}",
            allowed="finite numbers in most postures within the joints' ranges, at moderate speeds",
        )
    known = Moments(
        *(getattr(moments, entry.name)[is_known] for entry in fields(moments))
    )
    partials = limit.partials(known)
    here = f"{limit.origin}.partials"
    if not isinstance(partials, Partials):
        raise InputError(
            "the return value is not a brachis.limits.Partials",
            where=here,
            found=partials,
        )
    arrays = {
        name: array for name, array in vars(partials).items() if array is not None
    }
    if not arrays.keys() - {"s"}:
        raise InputError(
            "all partial derivatives are None",
            where=here,
            allowed="at least one of q, qdot, qddot, qdddot",
        )
    count, n = known.q.shape
    for name, array in arrays.items():
        shape = (count, c) if name == "s" else (count, c, n)
        check_array(array, shape, f"{here}.{name}", remark=f" for {count} moments")
        check_finite(array, f"{here}.{name}")
    check_partials(limit, known, robot)


def _reaches(robot: Robot) -> np.ndarray:
    """Return how far q, qdot, qddot and qdddot may deviate from the middle, (4, n), at most `_FURTHEST`."""
    low, high = _ranges(robot)
    rate = np.full(robot.n, _FURTHEST)
    speed = 0.5 * np.minimum(robot.limits.velocity, rate)
    return np.array([np.minimum(0.5 * (high - low), rate), speed, rate, rate])


def _ranges(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest positions to check, (n,) each: inside the ranges, and not far from zero."""
    reach = np.where(robot.revolute, np.pi, 1.0)
    lower = robot.limits.position_lower
    upper = robot.limits.position_upper
    near = np.clip(0.0, lower, upper)
    low = np.maximum(lower, near - reach)
    high = np.minimum(upper, near + reach)
    inside = 0.1 * (high - low)
    return low + inside, high - inside


def sample_moments(robot: Robot) -> Moments:
    """Return random moments within the joints' ranges, at moderate speeds."""
    rng = np.random.default_rng(0)
    low, high = _ranges(robot)
    _, *reaches = _reaches(robot)
    q = rng.uniform(low, high, (_COUNT, robot.n))
    qdot, qddot, qdddot = (
        rng.uniform(-reach, reach, (_COUNT, robot.n)) for reach in reaches
    )
    return Moments(q, qdot, qddot, qdddot, rng.uniform(0.1, 0.9, _COUNT))


def write_posture(moments: Moments, number: int | np.intp) -> str:
    """Write the posture at the moment with this number."""
    q = ", ".join(f"{value:.4g}" for value in moments.q[number])
    return f"q = [{q}]"


def _differentiate(
    limit: Limit, moments: Moments, name: str, reach: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Differentiate values with respect to one of q, qdot, ..., s in units of its reach, (d,), with two step sizes.

    Both results are (K, c, d), with d = n for joint quantities and d = 1 for s.
    """
    count = len(moments.q)
    steps = _STEP * np.array([1.0, -1.0, 2.0, -2.0])
    shifts = np.multiply.outer(steps, np.diag(reach)).reshape(-1, len(reach))
    states = {
        entry.name: np.concatenate([getattr(moments, entry.name)] * len(shifts))
        for entry in fields(moments)
    }
    changed = states[name]
    states[name] = changed + np.repeat(shifts, count, axis=0).reshape(changed.shape)
    values = limit.values(Moments(**states))
    total = len(states["q"])
    check_array(
        values,
        (total, len(limit.labels)),
        f"{limit.origin}.values",
        remark=f" for {total} moments",
    )
    by_step = values.reshape(len(steps), len(reach), count, -1)
    ahead, behind, far_ahead, far_behind = np.moveaxis(by_step, 1, -1)
    return (ahead - behind) / (2.0 * _STEP), (far_ahead - far_behind) / (4.0 * _STEP)


def check_partials(limit: Limit, moments: Moments, robot: Robot) -> None:
    """Refuse partial derivatives that contradict the values.

    Parameters
    ----------
    limit : Limit
        A limit whose values and partials are finite and have the right shapes.
    moments : Moments
        The moments at which the derivatives are compared.
    robot : Robot

    Raises
    ------
    InputError
        A partial derivative is wrong at most of the moments; or the values depend on qdddot although the limit's order
        is 2.
    """
    partials = limit.partials(moments)
    rounding = _ROUNDING * np.abs(limit.values(moments)).max(axis=0)
    names = ("q", "qdot", "qddot", "qdddot", "s")
    for name, reach in zip(names, [*_reaches(robot), np.ones(1)], strict=True):
        fine, coarse = _differentiate(limit, moments, name, reach)
        partial = getattr(partials, name)
        stated = np.zeros_like(fine)
        if partial is not None:
            stated = partial.reshape(fine.shape) * reach
        size = np.abs(fine)
        small = rounding[:, None] + 0.5 * _PRECISION * size.max(axis=0)
        small = small + _PRECISION * np.abs(stated).max(axis=2, keepdims=True)
        is_steep = np.maximum(np.abs(stated), size) > small
        if name == "qdddot" and limit.order < 3:
            _check_order(limit, is_steep.any(axis=2))
        off = np.abs(stated - fine)
        allowed = small + _PRECISION * size + _MARGIN * np.abs(fine - coarse)
        is_wrong = off > allowed
        times = is_wrong.sum(axis=0)
        is_refused = (times > 1) & (2 * times > is_steep.sum(axis=0))
        if not is_refused.any():
            continue
        joint, column = np.argwhere(is_refused.T)[0]
        worst = np.argmax(np.where(is_wrong, off, -1.0)[:, column, joint])
        by = (
            ""
            if name == "s"
            else f" with respect to {name} of joint {robot.joint_names[joint]!r}"
        )
        numbers = np.array([stated, fine])[:, worst, column, joint] / reach[joint]
        posture = write_posture(moments, worst)
        raise InputError(
            f"this partial derivative of {limit.labels[column]!s}{by} contradicts the values",
            where=f"{limit.origin}.partials.{name}",
            found=f"{numbers[0]:.6g} at {posture}",
            allowed=f"{numbers[1]:.6g}, by differences of the values",
        )


def _check_order(limit: Limit, depends: np.ndarray) -> None:
    """Refuse values that depend on qdddot at most of the moments; `depends` is (K, c) bool."""
    columns = np.flatnonzero(2 * depends.sum(axis=0) > len(depends))
    if len(columns):
        raise InputError(
            f"the value of {limit.labels[columns[0]]!s} depends on qdddot",
            where=f"{limit.origin}.order",
            found=limit.order,
            allowed=3,
        )
