"""Where a motion is checked: in every piece, every knot interval, every piece of the path, and where joints reverse.

A time that is not checked can hide anything. Every quintic piece is checked within, however short it is, and the more
often the further it moves a joint. Coulomb friction is checked within its own width wherever a joint reverses or nearly
does.
"""

from __future__ import annotations

import numpy as np

from brachis.errors import InputError
from brachis.path import Path
from brachis.trajectory import Trajectory
from brachis.verify.motion import Pieces, roots, turns
from brachis.verify.report import VerifyOptions

MOST_INSTANTS = 200_000
"""Instants at which a motion is checked before limits ask for more: some seconds' work, and 1 GB."""
_LEAST_STEPS = 3
"""Steps in every piece: their ends tell a cubic acceleration from any other."""
_TRAVEL = 0.05
"""No joint moves further in a step, rad or m."""

Places = tuple[np.ndarray, np.ndarray]
"""Pieces (K,) and places u in them (K,)."""


def all_places(
    trajectory: Trajectory, pieces: Pieces, path: Path, options: VerifyOptions
) -> Places:
    """List all places at which a motion is checked, in any order.

    Raises
    ------
    InputError
        They are more than `MOST_INSTANTS`.
    """
    parts = (
        _spread(trajectory, pieces, options),
        _within_path_pieces(pieces, path.breaks, options),
        _peaks(pieces),
        _reversals(pieces),
    )
    piece, u = (np.concatenate(part) for part in zip(*parts, strict=True))
    _check_count(len(piece))
    return piece, u


def _spread(trajectory: Trajectory, pieces: Pieces, options: VerifyOptions) -> Places:
    """Both ends of every piece and places between, no two of them further apart than a knot interval allows."""
    knots = np.unique(trajectory.knots) * trajectory.t_end
    edges = np.union1d(pieces.times, knots[(knots > 0.0) & (knots < pieces.times[-1])])
    first, _ = pieces.place(edges[:-1])
    low = (edges[:-1] - pieces.times[first]) / pieces.lengths[first]
    high = (edges[1:] - pieces.times[first]) / pieces.lengths[first]
    middle = 0.5 * (edges[1:] + edges[:-1])
    interval = np.searchsorted(knots, middle).clip(1, len(knots) - 1)
    share = np.diff(edges) / np.diff(knots)[interval - 1]
    by_interval = share * options.points_per_interval - 1e-6  # less rounding
    travel = np.abs(np.diff(pieces.position, axis=0)).sum(axis=0).max(axis=1)
    by_travel = travel[first] * (high - low) / _TRAVEL
    wanted = np.nan_to_num(np.maximum(by_interval, by_travel))
    steps = np.ceil(np.clip(wanted, _LEAST_STEPS, 10_000)).astype(int)
    count = steps + 1
    _check_count(int(count.sum()))
    spans = zip(low, high, count, strict=True)
    u = np.concatenate([np.linspace(*span) for span in spans])
    return np.repeat(first, count), u


def _check_count(count: int) -> None:
    """Refuse to check a motion at more than `MOST_INSTANTS` instants."""
    if count > MOST_INSTANTS:
        raise InputError(
            "the motion is too long, too fast or too finely divided to be verified",
            where="trajectory",
            found=f"{count} instants to look at",
            allowed=f"{MOST_INSTANTS}: {_LEAST_STEPS + 1} in every piece between nodes, one for every {_TRAVEL:g} rad "
            "or m that a joint travels, 32 in every knot interval and in every piece of the path",
            hint="Split the motion into parts",
        )


def _within_path_pieces(
    pieces: Pieces, breaks: np.ndarray, options: VerifyOptions
) -> Places:
    """Spread places over every piece of the path, however short: no small blend is stepped over."""
    parts = np.linspace(0.0, 1.0, options.points_per_interval)
    _check_count(len(breaks) * len(parts))
    s = (breaks[:-1, None] + np.diff(breaks)[:, None] * parts).ravel()
    return pieces.place(pieces.times_of(s))


def _peaks(pieces: Pieces) -> Places:
    """Find where the acceleration of a joint turns within a piece, beyond its values at the ends of the piece."""
    ends = pieces.acceleration[[0, -1]]
    beyond = np.maximum(
        pieces.acceleration.max(axis=0) - ends.max(axis=0),
        ends.min(axis=0) - pieces.acceleration.min(axis=0),
    )
    # Coefficients may leave the range between both ends by 1 % of the largest acceleration.
    piece, joint = np.nonzero(beyond > 0.01 * np.abs(ends).max(axis=(0, 1)))
    turning, u, _ = turns(pieces.acceleration[:, piece, joint])
    return piece[turning], u


def _reversals(pieces: Pieces) -> Places:
    """Find where joints with Coulomb friction cross multiples of its width, or turn near zero velocity."""
    # Between these speeds, in widths, friction rises from 29 % to all but 2e-6 of its torque.
    speeds = np.array([0.3, 1.0, 2.0, 3.0, 4.5, 7.0])
    levels = np.concatenate([-speeds[::-1], [0.0], speeds])
    near = 10.0  # widths; a turn at a lower speed is nearly a reversal
    friction = pieces.robot.friction
    rubbing = np.flatnonzero(friction.coulomb > 0.0)
    velocity = pieces.velocity[:, :, rubbing] / friction.v_eps[rubbing]
    least = velocity.min(axis=0)
    most = velocity.max(axis=0)
    # A joint that stands still crosses zero only by rounding.
    moving = np.maximum(most, -least) > speeds[0]
    piece, joint = np.nonzero(moving & (least < near) & (most > -near))
    slow = velocity[:, piece, joint]
    crossing, u = roots((slow[:, :, None] - levels).reshape(len(slow), -1))
    turning, at, least_speed = turns(slow)
    is_near = np.abs(least_speed) < near
    found = [piece[crossing // len(levels)], piece[turning[is_near]]]
    return np.concatenate(found), np.concatenate([u, at[is_near]])
