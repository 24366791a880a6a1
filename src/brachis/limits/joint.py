"""Joint velocities between v_min and v_max, |qddot| <= a_max and |qdddot| <= j_max.

q_min <= q <= q_max, as (q - middle) / half range in [-1, 1]; wide and open ranges are measured in rad or m.

Limits below and above zero for each joint, as (value - middle) / half the way between them, in [-1, 1].

With the same limit in both directions that is the ratio to it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.limits.protocol import (
    Bound,
    JointMotion,
    Label,
    Limit,
    Partials,
    PhaseLines,
)
from brachis.robot import Robot
from brachis.task import Task

_WIDE = 10.0
"""Ranges whose half is larger count as open ones do, in rad or m: half of a far range is no measure at its near end."""
_LEAST_HALF, _LARGEST_HALF = 1e-5, 1.0
"""A violation of 1 is half the range, but between these, rad or m, so that each end is judged by itself."""


def position_measure(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return what counts as a violation of 1 beyond ranges, rad or m: half of each, but no more than 1."""
    return np.clip(0.5 * upper - 0.5 * lower, _LEAST_HALF, _LARGEST_HALF)


class PositionLimit(Limit):
    """Joint positions within their ranges.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The joints with a range, or an end of one.
    """

    kind = "position"
    at_rest = "turns"

    def __init__(self, robot: Robot, joints: np.ndarray) -> None:
        low, high = (
            robot.limits.position_lower[joints],
            robot.limits.position_upper[joints],
        )
        half = 0.5 * high - 0.5 * low
        ranged = half <= _WIDE
        per_row = np.where(ranged, half, 1.0)
        with np.errstate(invalid="ignore"):  # -inf + inf
            self._middle = np.where(ranged, 0.5 * low + 0.5 * high, 0.0)
        self._joints = joints
        self._scale = 1.0 / per_row
        self._selection = np.eye(robot.n)[joints] * self._scale[:, None]
        self.labels = tuple(
            Label(
                name,
                "position",
                robot.position_units[i],
                f"robot.limits.position.{name}",
                share="position in its range",
            )
            for i, name in ((i, robot.joint_names[i]) for i in joints)
        )
        self.lower, self.upper = (
            (low - self._middle) * self._scale,
            (high - self._middle) * self._scale,
        )
        self._violation_scale = per_row / position_measure(low, high)
        whole = np.where(np.isfinite(half), 2.0 * half, 1.0)
        self._bounds = tuple(
            Bound(
                column,
                float(ends[column]),
                float(whole[column]),
                float(self._scale[column]),
                end,
            )
            for column in range(len(joints))
            for end, ends in (("lower", low), ("upper", high))
            if np.isfinite(ends[column])
        )

    @property
    def violation_scale(self) -> np.ndarray:
        """See `Limit`."""
        return self._violation_scale

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return self._bounds

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return (motion.q[:, self._joints] - self._middle) * self._scale

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        return Partials(
            q=np.broadcast_to(self._selection, (len(motion.q), *self._selection.shape))
        )


def build_position(robot: Robot, _task: Task) -> PositionLimit | None:
    """Build the limit for the joints with a finite end of range."""
    limits = robot.limits
    joints = np.flatnonzero(
        np.isfinite(limits.position_lower) | np.isfinite(limits.position_upper)
    )
    return PositionLimit(robot, joints) if len(joints) else None


def in_words(quantity: str, position_unit: str) -> str:
    """Name a joint's quantity: what is a torque of a revolute joint (rad) is a force of a prismatic one (m)."""
    return quantity if position_unit == "rad" else quantity.replace("torque", "force")


class JointRatioLimit(Limit):
    """A quantity of every limited joint over its limit; `kind` is also the key below ``robot.limits``.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    figures : (c,) or (2, c) ndarray
        Their limits, the same in both directions; or lower and upper ones.
    units : sequence of str
        Of the limits of all joints of the robot.
    """

    longer_time = "relieves"

    def __init__(
        self,
        robot: Robot,
        joints: np.ndarray,
        figures: np.ndarray,
        units: Sequence[str],
    ) -> None:
        low, high = self._figures = (
            figures if figures.ndim > 1 else np.array([-figures, figures])
        )
        self._joints, self._middle, self._scale = (
            joints,
            0.5 * (high + low),
            2.0 / (high - low),
        )
        self.labels = tuple(
            Label(
                name,
                in_words(self.name, position_unit),
                units[i],
                f"robot.limits.{self.kind}.{name}",
            )
            for i, name, position_unit in (
                (i, robot.joint_names[i], robot.position_units[i]) for i in joints
            )
        )
        self.lower, self.upper = -np.ones(len(joints)), np.ones(len(joints))
        self._violation_scale = 0.5 * (high - low) / np.minimum(high, -low)
        self._bounds = tuple(
            Bound(column, figure, abs(figure), float(self._scale[column]), end)
            for column, (below, above) in enumerate(
                zip(low.tolist(), high.tolist(), strict=True)
            )
            for end, figure in (
                ((None, above),)
                if -below == above
                else (("lower", below), ("upper", above))
            )
        )

    def _normalised(self, quantity: np.ndarray) -> np.ndarray:
        """Values, (K, c), from a quantity of all joints, (K, n)."""
        return np.asarray((quantity[:, self._joints] - self._middle) * self._scale)

    @property
    def violation_scale(self) -> np.ndarray:
        """See `Limit`: a violation is a part of the smaller one of both limits."""
        return self._violation_scale

    @property
    def centre(self) -> np.ndarray:
        """See `Limit`: where the quantity is zero."""
        return np.asarray(-self._middle * self._scale)

    @property
    def bounds(self) -> tuple[Bound, ...]:
        """See `Limit`."""
        return self._bounds


class _JointRateLimit(JointRatioLimit):
    """Joint velocities, accelerations or jerks within their limits.

    Parameters
    ----------
    robot : Robot
    joints : (c,) int ndarray
        The limited joints.
    figures : (c,) or (2, c) ndarray
        Their limits; see `JointRatioLimit`.
    """

    _per_time: str

    def __init__(self, robot: Robot, joints: np.ndarray, figures: np.ndarray) -> None:
        super().__init__(
            robot,
            joints,
            figures,
            [unit + self._per_time for unit in robot.position_units],
        )
        self._selection = np.eye(robot.n)[joints] * self._scale[:, None]

    def _rows(self, count: int) -> np.ndarray:
        """Constant partials at `count` moments, (K, c, n)."""
        return np.broadcast_to(self._selection, (count, *self._selection.shape))


class VelocityLimit(_JointRateLimit):
    """Joint velocities within their limits; see `_JointRateLimit`."""

    kind = "velocity"
    _per_time = "/s"

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._normalised(motion.qdot)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        return Partials(qdot=self._rows(len(motion.q)))

    def lines(
        self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray
    ) -> PhaseLines:
        """See `Limit.lines`: the square of the ratio, q_ds^2 x / v^2, to the limit of the direction."""
        low, high = self._figures
        tangent = q_ds[:, self._joints]
        squares = (tangent / np.where(tangent > 0.0, high, low)) ** 2
        return PhaseLines(None, squares, np.zeros((len(q), len(self.lower))))

    def step_rows(self, q: np.ndarray) -> tuple[None, np.ndarray]:
        """See `Limit.step_rows`."""
        return None, self._rows(len(q))


class AccelerationLimit(_JointRateLimit):
    """Joint accelerations over their limits; see `_JointRateLimit`."""

    kind = "acceleration"
    _per_time = "/s^2"

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._normalised(motion.qddot)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        return Partials(qddot=self._rows(len(motion.q)))

    def lines(
        self, s: np.ndarray, q: np.ndarray, q_ds: np.ndarray, q_dds: np.ndarray
    ) -> PhaseLines:
        """See `Limit.lines`."""
        by_u, by_x = (part[:, self._joints] * self._scale for part in (q_ds, q_dds))
        return PhaseLines(by_u, by_x, np.zeros((len(q), len(self.lower))))

    def step_rows(self, q: np.ndarray) -> tuple[np.ndarray, None]:
        """See `Limit.step_rows`."""
        return self._rows(len(q)), None


class JerkLimit(_JointRateLimit):
    """Joint jerks over their limits; see `_JointRateLimit`."""

    kind = "jerk"
    order = 3
    _per_time = "/s^3"

    def values(self, motion: JointMotion) -> np.ndarray:
        """See `Limit.values`."""
        return self._normalised(motion.qdddot)

    def partials(self, motion: JointMotion) -> Partials:
        """See `Limit.partials`."""
        return Partials(qdddot=self._rows(len(motion.q)))


def build_velocity(robot: Robot, _task: Task) -> VelocityLimit | None:
    """Build the limit for the joints with a finite velocity limit."""
    figures = robot.limits.both_ways("velocity")
    joints = np.flatnonzero(np.isfinite(figures[1]))
    return VelocityLimit(robot, joints, figures[:, joints]) if len(joints) else None


def build_acceleration(robot: Robot, _task: Task) -> AccelerationLimit | None:
    """Build the limit for the joints with a finite acceleration limit."""
    joints = np.flatnonzero(np.isfinite(robot.limits.acceleration))
    return (
        AccelerationLimit(robot, joints, robot.limits.acceleration[joints])
        if len(joints)
        else None
    )


def build_jerk(robot: Robot, _task: Task) -> JerkLimit | None:
    """Build the limit for the joints with a finite jerk limit."""
    joints = np.flatnonzero(np.isfinite(robot.limits.jerk))
    return JerkLimit(robot, joints, robot.limits.jerk[joints]) if len(joints) else None


def reciprocals_near(
    robot: Robot, limits: Sequence[Limit], q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Reciprocals of the largest acceleration and of the largest velocity, (n,) each, of each joint alone near `q`.

    They are what the joints' own limits allow, 0 where these allow any.
    """
    by_acceleration, by_velocity = np.zeros(robot.n), np.zeros(robot.n)
    for limit in limits:
        own = np.array(
            [
                [label.subject == name for name in robot.joint_names]
                for label in limit.labels
            ]
        )
        for weights, rows in zip(
            (by_acceleration, by_velocity), limit.step_rows(q[None]), strict=True
        ):
            if rows is not None:
                np.maximum(
                    weights,
                    np.abs(np.where(own, rows[0], 0.0)).max(axis=0),
                    out=weights,
                )
    return by_acceleration, by_velocity
