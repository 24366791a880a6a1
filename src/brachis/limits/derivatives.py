"""Partial derivatives of a user's limit are compared with central differences of its values.

At every one of some random moments, values are differenced joint by joint. Limits may have kinks and steps, and their
values may be noisy. So slopes are taken with two steps, and what these differ by is allowed. A partial derivative is
refused if it is wrong at most of the moments.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from brachis.common.arguments import check_array
from brachis.errors import InputError
from brachis.limits.protocol import Limit, Moments
from brachis.robot import Robot

_COUNT = 6
"""Moments at which derivatives are compared."""
_STEP = 1e-3
"""Step of the differences, as a fraction of how far motions go: single precision is enough for it."""
_FURTHEST = 1.0
"""Largest speed, acceleration and jerk of the moments, rad or m."""
_PRECISION = 2e-3
"""Difference between stated and found slope, as a fraction of the largest slope, above which the stated is wrong."""
_ROUNDING = 1e-3
"""Slopes smaller than this fraction of the values count as zero."""
_MARGIN = 5.0
"""Factor on the difference between slopes with two steps, which is allowed too."""


def _reaches(robot: Robot) -> np.ndarray:
    """How far q, qdot, qddot and qdddot go, (4, n), to both sides of the middle; q no further than the others."""
    low, high = _ranges(robot)
    rate = np.full(robot.n, _FURTHEST)
    speed = 0.5 * np.minimum(robot.limits.velocity, rate)
    return np.array([np.minimum(0.5 * (high - low), rate), speed, rate, rate])


def _ranges(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Postures to look at, (n,) each: the middle of the ranges; half a turn, or 1 m, beside an open end."""
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
    """Write down the posture of one of some moments."""
    q = ", ".join(f"{value:.4g}" for value in moments.q[number])
    return f"q = [{q}]"


def _differentiate(
    limit: Limit, moments: Moments, name: str, reach: np.ndarray, where: str
) -> tuple[np.ndarray, np.ndarray]:
    """Differentiate values by one of q, qdot, ..., s in units of its reach, (d,), once with each of two steps.

    Both are (K, c, d), with d = n joints, and d = 1 for s.
    """
    count = len(moments.q)
    steps = _STEP * np.array([1.0, -1.0, 2.0, -2.0])
    shifts = np.multiply.outer(steps, np.diag(reach)).reshape(-1, len(reach))
    states = {
        own.name: np.concatenate([getattr(moments, own.name)] * len(shifts))
        for own in fields(moments)
    }
    changed = states[name]
    states[name] = changed + np.repeat(shifts, count, axis=0).reshape(changed.shape)
    values = limit.values(Moments(**states))
    total = len(states["q"])
    check_array(
        values,
        (total, len(limit.labels)),
        f"{where}.values",
        remark=f" for {total} moments",
    )
    parts = values.reshape(len(steps), len(reach), count, -1)
    ahead, behind, far_ahead, far_behind = np.moveaxis(parts, 1, -1)
    return (ahead - behind) / (2.0 * _STEP), (far_ahead - far_behind) / (4.0 * _STEP)


def check_partials(limit: Limit, moments: Moments, robot: Robot, where: str) -> None:
    """Refuse partial derivatives that contradict the values.

    Parameters
    ----------
    limit : Limit
        Its values and partials have the right shapes, and are finite.
    moments : Moments
        At which they are compared.
    robot : Robot
    where : str
        Where the limit stands, for messages.

    Raises
    ------
    InputError
        A partial derivative is wrong at most of the moments, or the values depend on qdddot and the limit's order is
        2.
    """
    partials = limit.partials(moments)
    rounding = _ROUNDING * np.abs(limit.values(moments)).max(axis=0)
    names = ("q", "qdot", "qddot", "qdddot", "s")
    for name, reach in zip(names, [*_reaches(robot), np.ones(1)], strict=True):
        found, coarse = _differentiate(limit, moments, name, reach, where)
        partial = getattr(partials, name)
        stated = np.zeros_like(found)
        if partial is not None:
            stated = partial.reshape(found.shape) * reach
        size = np.abs(found)
        small = rounding[:, None] + 0.5 * _PRECISION * size.max(axis=0)
        small = small + _PRECISION * np.abs(stated).max(axis=2, keepdims=True)
        is_steep = np.maximum(np.abs(stated), size) > small
        if name == "qdddot" and limit.order < 3:
            _check_order(limit, is_steep.any(axis=2), where)
        off = np.abs(stated - found)
        allowed = small + _PRECISION * size + _MARGIN * np.abs(found - coarse)
        is_wrong = off > allowed
        times = is_wrong.sum(axis=0)
        is_refused = (times > 1) & (2 * times > is_steep.sum(axis=0))
        if not is_refused.any():
            continue
        joint, column = np.argwhere(is_refused.T)[0]
        worst = np.argmax(np.where(is_wrong, off, -1.0)[:, column, joint])
        by = "" if name == "s" else f" by {name} of joint {robot.joint_names[joint]!r}"
        numbers = np.array([stated, found])[:, worst, column, joint] / reach[joint]
        posture = write_posture(moments, worst)
        raise InputError(
            f"this partial derivative of {limit.labels[column]!s}{by} contradicts the values",
            where=f"{where}.partials.{name}",
            found=f"{numbers[0]:.6g} at {posture}",
            allowed=f"{numbers[1]:.6g}, by differences of the values",
        )


def _check_order(limit: Limit, depends: np.ndarray, where: str) -> None:
    """Refuse values that depend on qdddot, (K, c) bool, at most of the moments."""
    columns = np.flatnonzero(2 * depends.sum(axis=0) > len(depends))
    if len(columns):
        raise InputError(
            f"the value of {limit.labels[columns[0]]!s} depends on qdddot",
            where=f"{where}.order",
            found=limit.order,
            allowed=3,
        )
