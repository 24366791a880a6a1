"""q_min <= q <= q_max, as (q - middle) / half range in [-1, 1]; wide and open ranges are measured in rad or m."""

from __future__ import annotations

import numpy as np

from brachis.limits.protocol import Bound, JointMotion, Label, Limit, Partials
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
    static = True
    whole_turns = True

    def __init__(self, robot: Robot, joints: np.ndarray) -> None:
        low, high = robot.limits.position_lower[joints], robot.limits.position_upper[joints]
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
        self.lower, self.upper = (low - self._middle) * self._scale, (high - self._middle) * self._scale
        self._violation_scale = per_row / position_measure(low, high)
        whole = np.where(np.isfinite(half), 2.0 * half, 1.0)
        self._bounds = tuple(
            Bound(column, float(ends[column]), float(whole[column]), float(self._scale[column]), end)
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
        return Partials(q=np.broadcast_to(self._selection, (len(motion.q), *self._selection.shape)))


def build_position(robot: Robot, _task: Task) -> PositionLimit | None:
    """Build the limit for the joints with a finite end of range."""
    limits = robot.limits
    joints = np.flatnonzero(np.isfinite(limits.position_lower) | np.isfinite(limits.position_upper))
    return PositionLimit(robot, joints) if len(joints) else None
