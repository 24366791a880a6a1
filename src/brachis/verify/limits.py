"""Ratios to the limits of torque, velocity, acceleration and position, by formulas of the verification's own."""

from __future__ import annotations

import numpy as np

from brachis.robot import Robot
from brachis.verify.motion import Pieces, States
from brachis.verify.options import VerifyOptions
from brachis.verify.polynomials import turns
from brachis.verify.report import Check

LEAST_HALF_RANGE, LARGEST_HALF_RANGE = 1e-5, 1.0
"""A position ratio of 2 is beyond the end by half the range, but by no less and no more than this, rad or m."""


def limit_checks(robot: Robot, pieces: Pieces, states: States, options: VerifyOptions) -> list[Check]:
    """Worst ratio to every kind of limit that the robot has: of torque at the states, of the others anywhere."""
    limits, found = robot.limits, {}
    if np.isfinite(limits.torque).any():
        ratio = np.abs(states.tau) / limits.torque
        k, joint = np.unravel_index(np.argmax(ratio), ratio.shape)
        found["torque"] = float(ratio[k, joint]), int(joint), float(states.t[k])
    for kind, limit in (("velocity", limits.velocity), ("acceleration", limits.acceleration)):
        if np.isfinite(limit).any():
            ratio = getattr(pieces, kind) / limit
            found[kind] = _largest(pieces, ratio, -ratio)
    lower, upper = limits.position_lower, limits.position_upper
    if (np.isfinite(lower) | np.isfinite(upper)).any():
        half = np.clip(0.5 * upper - 0.5 * lower, LEAST_HALF_RANGE, LARGEST_HALF_RANGE)
        above = 1.0 + (pieces.nodes - upper + pieces.position) / half
        below = 1.0 + (lower - pieces.nodes - pieces.position) / half
        found["position"] = _largest(pieces, above, below)
    allowed = 1.0 + options.ratio_tolerance
    return [
        Check(f"{kind} ratio", value, allowed, "-", value <= allowed, robot.joint_names[joint], time)
        for kind, (value, joint, time) in found.items()
    ]


def _largest(pieces: Pieces, above: np.ndarray, below: np.ndarray) -> tuple[float, int, float]:
    """Find the largest value of polynomials in Bernstein form, two for every piece and joint, (m + 1, L, n) each.

    It is at an end of a piece or where a polynomial turns that has a coefficient above the values at all ends.

    Returns
    -------
    value, joint, time
    """
    flat = np.concatenate([above, below], axis=1).reshape(len(above), -1)
    ends = flat[[0, -1]]
    u, column = (int(index) for index in np.unravel_index(np.argmax(ends), ends.shape))
    value, place = float(ends[u, column]), float(u)
    higher = np.flatnonzero(flat.max(axis=0) > value)
    turning, at, values = turns(flat[:, higher])
    if values.max(initial=-np.inf) > value:
        k = int(np.argmax(values))
        value, column, place = float(values[k]), int(higher[turning[k]]), float(at[k])
    _, count, n = above.shape
    piece = column // n % count
    return value, column % n, float(pieces.times[piece] + place * pieces.lengths[piece])
