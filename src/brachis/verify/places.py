"""Where a motion is looked at: in every piece, every knot interval, every piece of the path, and where joints reverse.

A time that nobody looks at can hide anything. Every quintic piece has places in its inside however short it is, and
more of them the further it moves a joint; Coulomb friction has places within its own width wherever a joint reverses
or comes near to it.
"""

from __future__ import annotations

import numpy as np

from brachis.errors import InputError
from brachis.robot import Robot
from brachis.trajectory import Trajectory
from brachis.verify.motion import Pieces
from brachis.verify.options import VerifyOptions
from brachis.verify.polynomials import roots, turns

_LEAST_STEPS = 3
"""Steps in every piece: their ends tell a cubic acceleration from any other."""
_SPIKE = 0.01
"""Coefficients that leave the range between both ends of a piece by this part of the largest acceleration."""
_MOST_STEPS = 10_000
MOST_INSTANTS = 200_000
"""Instants at which a motion is looked at before limits ask for more: some seconds' work, and 1 GB."""
_TRAVEL = 0.05
"""A step moves no joint further, rad or m."""
_ROUNDING = 1e-6
_SAME_TIME = 1e-12
_BISECTIONS = 50
_LEVELS = np.array([0.3, 1.0, 2.0, 3.0, 4.5, 7.0])
"""Speeds, in widths of the Coulomb friction, between which it rises from 29 % to all but 2e-6 of its torque."""
_WIDTHS = 10.0
"""Within so many widths of zero a turning velocity counts as a near reversal."""

Places = tuple[np.ndarray, np.ndarray]
"""Pieces (K,) and places u in them (K,)."""


def spread_out(trajectory: Trajectory, pieces: Pieces, options: VerifyOptions) -> Places:
    """Both ends of every piece and places between, no two of them further apart than a knot interval allows."""
    times, knots = trajectory.times, np.unique(trajectory.knots) * trajectory.t_end
    nearest = np.abs(times[np.searchsorted(times, knots).clip(max=len(times) - 1)] - knots)
    before = np.abs(times[(np.searchsorted(times, knots) - 1).clip(min=0)] - knots)
    own = knots[np.minimum(nearest, before) > _SAME_TIME * trajectory.t_end]
    edges = np.union1d(times, own)
    first, _ = pieces.place(edges[:-1])
    low = (edges[:-1] - times[first]) / pieces.lengths[first]
    high = (edges[1:] - times[first]) / pieces.lengths[first]
    interval = np.searchsorted(knots, 0.5 * (edges[1:] + edges[:-1])).clip(1, len(knots) - 1)
    per_interval = np.diff(edges) / np.diff(knots)[interval - 1] * options.points_per_interval
    travel = np.abs(np.diff(pieces.position, axis=0)).sum(axis=0).max(axis=1)[first] * (high - low) / _TRAVEL
    wanted = np.nan_to_num(np.maximum(per_interval - _ROUNDING, travel))
    steps = np.ceil(np.clip(wanted, _LEAST_STEPS, _MOST_STEPS)).astype(int)
    count = steps + 1
    check_instants(int(count.sum()))
    span = np.repeat(np.arange(len(steps)), count)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return first[span], low[span] + (high - low)[span] * number / steps[span]


def check_instants(count: int) -> None:
    """Refuse to look at a motion at more than `MOST_INSTANTS` instants.

    Raises
    ------
    InputError
    """
    if count > MOST_INSTANTS:
        raise InputError(
            "the motion is too long, too fast or too finely divided to be verified",
            where="trajectory",
            found=f"{count} instants to look at",
            allowed=f"{MOST_INSTANTS}: {_LEAST_STEPS + 1} in every piece between nodes, one for every {_TRAVEL:g} rad "
            "or m that a joint travels, 32 in every knot interval and in every piece of the path",
            hint="Split the motion into parts",
        )


def within_path_pieces(trajectory: Trajectory, pieces: Pieces, breaks: np.ndarray, options: VerifyOptions) -> Places:
    """Spread places over every piece of the path, however short: a small blend is not stepped over."""
    parts = np.linspace(0.0, 1.0, options.points_per_interval)
    check_instants(len(breaks) * len(parts))
    wanted = (breaks[:-1, None] + np.diff(breaks)[:, None] * parts).ravel()
    low, high = np.zeros_like(wanted), np.full_like(wanted, trajectory.t_end)
    for _ in range(_BISECTIONS):  # s(t) does not decrease
        middle = 0.5 * (low + high)
        before = trajectory.path_spline(middle) < wanted
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return pieces.place(0.5 * (low + high))


def sharpest(pieces: Pieces) -> Places:
    """Where the acceleration of a joint turns within a piece, if its coefficients leave the room between the ends."""
    ends = pieces.acceleration[[0, -1]]
    room = _SPIKE * np.abs(ends).max(axis=(0, 1))
    beyond = np.maximum(
        pieces.acceleration.max(axis=0) - ends.max(axis=0), ends.min(axis=0) - pieces.acceleration.min(axis=0)
    )
    piece, joint = np.nonzero(beyond > room)
    turning, u, _ = turns(pieces.acceleration[:, piece, joint])
    return piece[turning], u


def reversals(pieces: Pieces, robot: Robot) -> Places:
    """Where joints with Coulomb friction cross multiples of its width, or turn near zero velocity."""
    rubbing = np.flatnonzero(robot.friction.coulomb > 0.0)
    velocity = pieces.velocity[:, :, rubbing] / robot.friction.v_eps[rubbing]
    least, most = velocity.min(axis=0), velocity.max(axis=0)
    moving = np.maximum(most, -least) > _LEVELS[0]  # a joint that stands still crosses zero by rounding alone
    piece, joint = np.nonzero(moving & (least < _WIDTHS) & (most > -_WIDTHS))
    slow = velocity[:, piece, joint]
    levels = np.concatenate([-_LEVELS[::-1], [0.0], _LEVELS])
    crossed, u = roots((slow[:, :, None] - levels).reshape(len(slow), -1))
    turning, at, least_speed = turns(slow)
    near = np.abs(least_speed) < _WIDTHS
    return np.concatenate([piece[crossed // len(levels)], piece[turning[near]]]), np.concatenate([u, at[near]])
