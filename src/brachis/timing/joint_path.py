"""A joint path q(p) at stations, with its first and second derivatives with respect to the path parameter p.

The parameter may be the path coordinate s, the time of a known motion, or the length of the joint path. The least time
does not depend on this choice. If the length is the parameter, the path is regular even where a motion starts from
rest. If time is the parameter, the path is not regular there: both s and q grow with powers of time, so their
derivatives vanish.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from brachis.common.arrays import interpolate_columns
from brachis.kernel import Spline
from brachis.robot.dynamics import SharedTorques

_STANDING = 1e-7
"""Fraction of the largest speed below which the joints count as standing still."""


_SHORTEST = 1e-13
"""Shortest step between stations, as a fraction of the path."""
_TURN = 0.02
"""Maximum change of the unit tangent between stations, rad. Where a path turns, the motion may abruptly accelerate or
brake."""
_MOST_PARTS = 64
"""Maximum number of parts into which a step is divided."""
_CORNER = 1.9
"""Change of the unit tangent between two stations above which the tangent counts as reversed, as at a cusp, and the arm
stops. With coarse stations, the tangent of a path through a branch boundary changes by up to 1.5; a reversal is 2."""


def halfway(values: np.ndarray) -> np.ndarray:
    """Return the mean of every two neighbouring values, (P - 1, ...), of values at stations, (P, ...)."""
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def to_stations(values: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Interpolate values midway between stations, (P - 1, c), to the stations, (P, c); `steps` are (P - 1, 1)."""
    share = steps[1:] / (steps[1:] + steps[:-1])
    with np.errstate(invalid="ignore"):
        between = share * values[:-1] + (1.0 - share) * values[1:]
    return np.concatenate([values[:1], between, values[-1:]])


def divide_turns(p: np.ndarray, q_dp: np.ndarray) -> np.ndarray:
    """Divide the steps between stations p, (P,), in which a joint path turns, given its derivatives dq/dp, (P, n).

    Steps in which the speed changes by a large factor, for example beside a cusp, are divided too.
    """
    speed = np.linalg.norm(q_dp, axis=1)[:, None]
    tangent = np.divide(q_dp, speed, out=np.zeros_like(q_dp), where=speed > 0.0)
    turn = np.linalg.norm(np.diff(tangent, axis=0), axis=1)
    slower, faster = np.sort([speed[1:, 0], speed[:-1, 0]], axis=0)
    is_known = slower > 0.0
    ratio = np.divide(faster, slower, out=np.ones_like(turn), where=is_known)
    counts = np.maximum(np.ceil(turn / _TURN), np.round(ratio))
    divisions = np.where(is_known, counts, 1.0).clip(1, _MOST_PARTS)
    numbers = np.append(0.0, np.cumsum(divisions))
    return np.interp(np.arange(numbers[-1] + 1.0), numbers, p)


@dataclass(frozen=True)
class JointPath:
    """A joint path at stations.

    Attributes
    ----------
    p : (P,) ndarray
        Path parameter, ascending.
    s : (P,) ndarray
        Path coordinate of the tool; NaN if the tool has no path.
    q, q_dp, q_ddp : (P, n) ndarray
        Postures, rad or m, and their derivatives with respect to p.
    stops : (k,) int ndarray
        Indices of the stations at which dp/dt is zero. These are the stations just before and after a corner.
    """

    p: np.ndarray
    s: np.ndarray
    q: np.ndarray
    q_dp: np.ndarray
    q_ddp: np.ndarray
    stops: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))

    @classmethod
    def through(cls, s: np.ndarray, q: np.ndarray) -> JointPath:
        """Build a joint path from cubic splines through postures, (P, n), at path coordinates, (P,)."""
        spline = Spline.through(s, q)
        return cls(s, s, q, spline(s, 1), spline(s, 2))

    def by_length(self) -> tuple[JointPath, np.ndarray]:
        """Return the path with its length as the parameter in place of p.

        Returns
        -------
        path : JointPath
            The path with two stations at each corner. Stations at which q does not change with p are left out, except
            at the ends.
        places : (P',) ndarray
            Values of p at the stations of the new path.
        """
        speed = np.linalg.norm(self.q_dp, axis=1)
        moves = speed > _STANDING * speed.max()
        inner = moves.copy()
        inner[[0, -1]] = True
        index = np.flatnonzero(inner)
        speed = speed[index]
        with np.errstate(divide="ignore", invalid="ignore"):
            tangent = self.q_dp[index] / speed[:, None]
            along = np.nan_to_num(np.sum(self.q_ddp[index] * tangent, axis=1))
            bend = (self.q_ddp[index] - tangent * along[:, None]) / speed[:, None] ** 2
        for end, beside in ((0, 1), (-1, -2)):
            if not moves[index[end]]:
                along[end] = np.linalg.norm(self.q_ddp[index[end]]) * (1 + 2 * end)
                tangent[end] = tangent[beside]
                bend[end] = bend[beside]
        turn = np.linalg.norm(np.diff(tangent, axis=0), axis=1)
        (corners,) = np.nonzero(turn > _CORNER)
        sides = np.column_stack([corners, corners + 1])
        numbers = np.insert(
            np.arange(len(index)), sides[:, [1, 1]].ravel(), sides.ravel()
        )
        stops = sides + 1 + 2 * np.arange(len(corners))[:, None]
        places = self.p[index][numbers]
        speed = speed[numbers]
        # At a corner the speed falls linearly to zero, and then rises linearly.
        ends = places[stops]
        shares = speed[stops] / speed[stops].sum(axis=1, keepdims=True)
        places[stops] = np.sum(ends * shares[:, ::-1], axis=1, keepdims=True)
        speed[stops] = 0.0
        along = along[numbers]
        # Integrate the speed from its values and slopes at the stations.
        step = np.diff(places)
        lengths = step * halfway(speed)
        lengths += step**2 / 12.0 * (along[:-1] - along[1:])
        # Keep stations apart, even where the posture hardly changes.
        lengths = np.maximum(lengths, _SHORTEST * lengths.sum())
        length = np.append(0.0, np.cumsum(lengths))
        path = JointPath(
            length,
            np.interp(places, self.p, self.s),
            interpolate_columns(places, self.p, self.q),
            tangent[numbers],
            bend[numbers],
            stops.ravel(),
        )
        return path, places

    def middles(self) -> JointPath:
        """Evaluate the path midway between its stations, by cubic interpolation."""
        steps = np.diff(self.p)[:, None]
        arrays = (self.p, self.s, self.q, self.q_dp, self.q_ddp)
        p, s, q, q_dp, q_ddp = map(halfway, arrays)
        q -= 0.125 * steps * np.diff(self.q_dp, axis=0)
        q_dp -= 0.125 * steps * np.diff(self.q_ddp, axis=0)
        return JointPath(p, s, q, q_dp, q_ddp)


class Passage(SharedTorques):
    """The motion at the stations of a joint path, in the form in which limits evaluate it.

    Parameters
    ----------
    path : JointPath
    rate, acceleration : (P,) ndarray
        dp/dt, 1/s, and d2p/dt2, 1/s^2.
    """

    def __init__(
        self, path: JointPath, rate: np.ndarray, acceleration: np.ndarray
    ) -> None:
        self.rate = rate
        self.acceleration = acceleration
        self.s = path.s
        self.q = path.q
        self.qdot = path.q_dp * rate[:, None]
        self.qddot = path.q_dp * acceleration[:, None] + path.q_ddp * rate[:, None] ** 2
        self.qdddot = np.zeros_like(self.q)


@dataclass(frozen=True)
class Timing:
    """The times at which a motion passes the stations of a joint path.

    Attributes
    ----------
    path : JointPath
    rate : (P,) ndarray
        dp/dt, 1/s.
    acceleration : (P - 1,) ndarray
        Mean d2p/dt2 between the stations, 1/s^2.
    jerk : (P - 1,) ndarray
        d3p/dt3 between the stations, 1/s^3, where the acceleration changes smoothly. The acceleration jumps only at
        stations.
    times : (P,) ndarray
        Times at the stations, beginning at 0, s.
    """

    path: JointPath
    rate: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray
    times: np.ndarray

    @classmethod
    def of(cls, path: JointPath, rate: np.ndarray) -> Timing:
        """Integrate a rate, (P,), given at the stations."""
        steps = np.diff(path.p)
        mean = halfway(rate)
        durations = steps / mean
        acceleration = np.diff(rate) / durations
        # Use the smaller slope of the two sides, to have no slope beside a jump.
        slopes = np.pad(np.diff(acceleration) / halfway(durations), 1)
        smaller = np.minimum(np.abs(slopes[1:]), np.abs(slopes[:-1]))
        max_jerk = np.abs(acceleration) / durations
        is_smooth = slopes[1:] * slopes[:-1] > 0.0
        size = np.where(is_smooth, np.minimum(smaller, max_jerk), 0.0)
        jerk = np.sign(slopes[1:]) * size
        durations = durations * (1.0 + jerk * durations**2 / (12.0 * mean))
        durations = (steps + jerk * durations**3 / 12.0) / mean
        acceleration = np.diff(rate) / durations
        times = np.append(0.0, np.cumsum(durations))
        return cls(path, rate, acceleration, jerk, times)

    @property
    def t_end(self) -> float:
        """Time taken for the whole path, s."""
        return float(self.times[-1])

    @property
    def middle_rate(self) -> np.ndarray:
        """dp/dt midway between the stations, (P - 1,), 1/s."""
        return np.sqrt(halfway(self.rate**2))
