"""Least time along a fixed course: the phase plane of s and ds/dt.

On a course q(s) the velocity, acceleration and torque limits read, with u = d2s/dt2 and x = (ds/dt)^2,

    qdot^2  = q_ds^2 x                           <= v_max^2
    qddot   = q_ds u + q_dds x                   in [-a_max, a_max]
    tau     = a(s) u + b(s) x + g(s)             in [-tau_max, tau_max]

with a = M q_ds, b = M q_dds + C(q, q_ds) q_ds and g the torque at rest: lines in (u, x). Backwards along the course,
the largest x from which the next station's interval can be reached is kept; forwards, the largest u that stays within
is taken (Pham, Pham, IEEE Trans. Robotics 34(3), 2018). Torque may jump here, and viscous and Coulomb friction are left
out, so the time is an estimate by which courses are ranked, no bound.
"""

from __future__ import annotations

import numpy as np

from brachis.robot import Robot, dynamics

_SLOWEST = 1e-9
_STANDING = 1e-3


def least_time(robot: Robot, s: np.ndarray, q: np.ndarray) -> float:
    """Estimate the least time along a course from rest to rest.

    Parameters
    ----------
    robot : Robot
    s : (S,) ndarray
        Path coordinates, ascending, evenly spaced.
    q : (S, n) ndarray
        Postures there, rad or m, continuous.

    Returns
    -------
    float
        s; infinite where the course cannot be followed at any speed.
    """
    step = s[1] - s[0]
    slope, offset, ceiling = _lines(robot, q, np.gradient(q, step, axis=0, edge_order=2), step)
    intervals = _controllable(slope, offset, ceiling, step)
    if intervals is None or intervals[0][0] > 0.0:
        return np.inf
    x = _fastest(slope, offset, *intervals, step)
    # Between stations nothing stops; a station where the grid says so is an artefact of its width.
    x[1:-1] = np.maximum(x[1:-1], _STANDING * np.median(x))
    speed = np.sqrt(x)
    return float(np.sum(2.0 * step / (speed[1:] + speed[:-1]))) if x.max() > 0.0 else np.inf


def _lines(
    robot: Robot, q: np.ndarray, q_ds: np.ndarray, step: float
) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Bounds on u as lines in x, slope and offset of the upper and the lower ones, each (S, c), and largest x, (S,)."""
    limits = robot.limits
    q_dds = np.gradient(q_ds, step, axis=0, edge_order=2)
    still = np.zeros_like(q)
    rest = dynamics.rigid_torque(robot, q, still, still)
    by_u = dynamics.rigid_torque(robot, q, still, q_ds) - rest + robot.friction.armature * q_ds
    by_x = dynamics.rigid_torque(robot, q, q_ds, q_dds) - rest + robot.friction.armature * q_dds
    with np.errstate(divide="ignore", invalid="ignore"):
        ceiling = np.nanmin((limits.velocity / np.abs(q_ds)) ** 2, axis=1)
    torque, acceleration = np.isfinite(limits.torque), np.isfinite(limits.acceleration)
    a = np.concatenate([by_u[:, torque], q_ds[:, acceleration]], axis=1)
    b = np.concatenate([by_x[:, torque], q_dds[:, acceleration]], axis=1)
    bound = np.concatenate([limits.torque[torque], limits.acceleration[acceleration]])
    at_rest = np.concatenate([rest[:, torque], np.zeros((len(q), int(acceleration.sum())))], axis=1)
    # A coefficient of zero would make a vertical line; a tiny one gives bounds far out that do no harm.
    a = np.where(np.abs(a) < _SLOWEST * bound, _SLOWEST * bound, a)
    first, second = (bound - at_rest) / a, (-bound - at_rest) / a
    return (-b / a, -b / a), (np.maximum(first, second), np.minimum(first, second)), ceiling


def _controllable(
    slope: tuple[np.ndarray, np.ndarray], offset: tuple[np.ndarray, np.ndarray], ceiling: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Go backwards: the intervals of x, (S,), from which the end can be reached at rest; None where one is empty."""
    count = len(ceiling)
    low, high = np.zeros(count), np.zeros(count)
    for i in range(count - 2, -1, -1):
        # u >= (low' - x) / 2 step and u <= (high' - x) / 2 step join the lines.
        up = np.append(slope[0][i], -0.5 / step), np.append(offset[0][i], 0.5 * high[i + 1] / step)
        down = np.append(slope[1][i], -0.5 / step), np.append(offset[1][i], 0.5 * low[i + 1] / step)
        tilt = (up[0][:, None] - down[0][None]).ravel()
        room = (up[1][:, None] - down[1][None]).ravel()
        if np.any((room < 0.0) & (np.abs(tilt) < _SLOWEST)):
            return None
        falling, rising = tilt < -_SLOWEST, tilt > _SLOWEST
        high[i] = min(ceiling[i], np.min(room[falling] / -tilt[falling], initial=np.inf))
        low[i] = max(0.0, np.max(-room[rising] / tilt[rising], initial=0.0))
        if low[i] > high[i]:
            return None
    return low, high


def _fastest(
    slope: tuple[np.ndarray, np.ndarray],
    offset: tuple[np.ndarray, np.ndarray],
    low: np.ndarray,
    high: np.ndarray,
    step: float,
) -> np.ndarray:
    """Go forwards from rest: x, (S,), under the largest u."""
    x = np.zeros(len(low))
    for i in range(len(low) - 1):
        largest = np.min(slope[0][i] * x[i] + offset[0][i], initial=np.inf)
        x[i + 1] = np.clip(x[i] + 2.0 * step * largest, low[i + 1], high[i + 1])
    return x
