"""Partial derivatives of a user's limit are compared with central differences of its values.

At every one of some random moments, values are differenced along one random direction of q, of qdot, ... Only where
that does not agree with the partial derivatives, they are looked at joint by joint. Limits may have kinks and steps,
and their values may be noisy. So slopes are taken with two steps, and what these differ by is allowed. A partial
derivative is refused if it is wrong at most of the moments.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

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
    """How far q, qdot, qddot and qdddot go, (4, n), to both sides of the middle."""
    low, high = _ranges(robot)
    speed = np.minimum(robot.limits.velocity, _FURTHEST)
    rate = np.full(robot.n, _FURTHEST)
    return np.array([0.5 * (high - low), 0.5 * speed, rate, rate])


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


def sample_moments(robot: Robot, count: int = _COUNT) -> Moments:
    """Return random moments within the joints' ranges, at moderate speeds.

    Parameters
    ----------
    robot : Robot
    count : int, optional
    """
    rng = np.random.default_rng(0)
    low, high = _ranges(robot)
    _, *reaches = _reaches(robot)
    q = rng.uniform(low, high, (count, robot.n))
    qdot, qddot, qdddot = (
        rng.uniform(-reach, reach, (count, robot.n)) for reach in reaches
    )
    return Moments(q, qdot, qddot, qdddot, rng.uniform(0.1, 0.9, count))


def write_posture(moments: Moments, number: int) -> str:
    """Write down the posture of one of some moments."""
    q = ", ".join(f"{value:.4g}" for value in moments.q[number])
    return f"q = [{q}]"


@dataclass(frozen=True)
class _Comparison:
    """Slopes along a direction.

    Attributes
    ----------
    stated, found : (K, c) ndarray
        By the partial derivatives, and by differences of the values.
    allowed : (K, c) ndarray
        By how much they may differ.
    small : (K, c) ndarray
        Slopes that are not told from zero.
    """

    stated: np.ndarray
    found: np.ndarray
    allowed: np.ndarray
    small: np.ndarray

    @property
    def matters(self) -> np.ndarray:
        """Where there is a slope at all, (K, c)."""
        return np.maximum(np.abs(self.stated), np.abs(self.found)) > self.small

    @property
    def is_wrong(self) -> np.ndarray:
        """Where they differ, (K, c)."""
        return np.abs(self.stated - self.found) > self.allowed

    @property
    def columns(self) -> np.ndarray:
        """Values, by number, whose slopes differ at most of the moments where there are any."""
        times = self.is_wrong.sum(axis=0)
        return np.flatnonzero((times > 1) & (2 * times > self.matters.sum(axis=0)))


class _Differences:
    """Slopes of a limit's values at moments.

    Parameters
    ----------
    limit : Limit
    moments : Moments
    robot : Robot
    where : str
        Where the limit stands, for messages.
    """

    def __init__(
        self, limit: Limit, moments: Moments, robot: Robot, where: str
    ) -> None:
        self._limit = limit
        self._moments = moments
        self._where = where
        self._joints = robot.joint_names
        self._partials = limit.partials(moments)
        self._rounding = _ROUNDING * np.abs(limit.values(moments)).max(axis=0)
        names = ("q", "qdot", "qddot", "qdddot")
        reaches = np.minimum(_reaches(robot), _FURTHEST)
        self._reaches: dict[str, Any] = dict(zip(names, reaches, strict=True))
        self._reaches["s"] = 1.0

    def compare(self, name: str, direction: Any) -> _Comparison:
        """Compare slopes by one of q, qdot, ..., s along a direction, (n,), or 1 for s, in units of what they reach."""
        along = self._reaches[name] * direction
        moments = self._moments
        count = len(moments.q)
        steps = _STEP * np.array([1.0, -1.0, 2.0, -2.0])
        states = {
            key: np.concatenate([values] * len(steps))
            for key, values in vars(moments).items()
            if key in self._reaches
        }
        states[name] = states[name] + np.multiply.outer(np.repeat(steps, count), along)
        values = self._limit.values(Moments(**states))
        total = len(steps) * count
        shape = (total, len(self._limit.labels))
        here = f"{self._where}.values"
        check_array(values, shape, here, remark=f" for {total} moments")
        ahead, behind, far_ahead, far_behind = values.reshape(len(steps), count, -1)
        found = (ahead - behind) / (2.0 * _STEP)
        error = np.abs(found - (far_ahead - far_behind) / (4.0 * _STEP))
        size = np.abs(found)
        small = self._rounding + 0.5 * _PRECISION * size.max(axis=0)
        partial = getattr(self._partials, name)
        stated = np.zeros(found.shape)
        if partial is not None:
            stated = partial @ along if partial.ndim > 2 else partial * along
            parts = np.abs(partial * self._reaches[name]).reshape(*size.shape, -1)
            small = small + _PRECISION * parts.max(axis=2)
        allowed = small + _PRECISION * size + _MARGIN * error
        return _Comparison(stated, found, allowed, small)

    def check(self, name: str) -> None:
        """Refuse a partial derivative by one of q, qdot, ..., s that is wrong at most moments."""
        n = len(self._joints)
        rng = np.random.default_rng(1)
        mixed = rng.uniform(0.5, 1.0, n) * rng.choice([-1.0, 1.0], n)
        whole = self.compare(name, 1.0 if name == "s" else mixed)
        if name == "qdddot" and self._limit.order < 3:
            self._check_order(whole)
        if not len(whole.columns):
            return
        if name == "s":
            self._check_slope(name, whole, 1.0, "")
            return
        for joint, own in zip(self._joints, np.eye(n), strict=True):
            reach = float(self._reaches[name] @ own)
            compared = self.compare(name, own)
            self._check_slope(name, compared, reach, f" by {name} of joint {joint!r}")

    def _check_order(self, whole: _Comparison) -> None:
        """Refuse values that depend on qdddot."""
        depends = np.flatnonzero(2 * whole.matters.sum(axis=0) > len(whole.matters))
        if len(depends):
            raise InputError(
                f"the value of {self._limit.labels[depends[0]]!s} depends on qdddot",
                where=f"{self._where}.order",
                found=self._limit.order,
                allowed=3,
            )

    def _check_slope(
        self, name: str, compared: _Comparison, reach: float, by: str
    ) -> None:
        """Refuse slopes along a direction of this length that differ; the numbers are those of the worst moment."""
        if not len(compared.columns):
            return
        column = int(compared.columns[0])
        off = np.abs(compared.stated - compared.found)[:, column]
        k = int(np.argmax(np.where(compared.is_wrong[:, column], off, -1.0)))
        posture = write_posture(self._moments, k)
        raise InputError(
            f"this partial derivative of {self._limit.labels[column]!s}{by} contradicts the values",
            where=f"{self._where}.partials.{name}",
            found=f"{compared.stated[k, column] / reach:.6g} at {posture}",
            allowed=f"{compared.found[k, column] / reach:.6g}, by differences of the values",
        )


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
    differences = _Differences(limit, moments, robot, where)
    for name in ("q", "qdot", "qddot", "qdddot", "s"):
        differences.check(name)
