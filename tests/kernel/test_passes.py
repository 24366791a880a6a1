"""Passes over the phase plane at their edges; `tests/timing` holds them to formulas."""

import itertools

import numpy as np

from brachis import kernel

FLAT = 1e-9
ROUNDING = 1e-6


def bounds_of_pairs(slope, lower, upper):
    """Least and largest x >= 0 at one place at which no lower line is above an upper one."""
    least, most = 0.0, np.inf
    for i, j in itertools.product(range(len(slope)), repeat=2):
        tilt = slope[i] - slope[j]
        clearance = upper[j] - lower[i]
        if tilt > FLAT:
            most = min(most, clearance / tilt)
        elif tilt < -FLAT:
            least = max(least, clearance / tilt)
        elif clearance < 0.0:
            return least, -1.0
    return least, most


def go_backwards(factor, least, most, floor, ceiling, last):
    low, high = [last], [last]
    for k in reversed(range(len(factor))):
        rising = factor[k] > FLAT
        to = np.min((high[0] - least[k][rising]) / factor[k][rising], initial=np.inf)
        of = np.max((low[0] - most[k][rising]) / factor[k][rising], initial=-np.inf)
        high.insert(0, min(to, ceiling[k]))
        low.insert(0, max(of, floor[k]))
        if low[0] > high[0] * (1.0 + ROUNDING) or high[0] < 0.0:
            return None
        high[0] = max(high[0], low[0])
    return np.array(low), np.array(high)


def test_without_rows_there_are_no_bounds():
    none = np.empty((3, 0))
    least, most = kernel.bounds_of_pairs(none, none, none, FLAT)
    assert np.array_equal(least, np.zeros(3))
    assert np.isinf(most).all()


def test_an_end_out_of_reach():
    steps = np.ones((3, 1)), -np.ones((3, 1)), np.full((3, 1), 0.1)
    levels = np.zeros(3), np.full(3, 0.2)
    assert kernel.go_backwards(steps, levels, 1.0, flat=FLAT, rounding=ROUNDING) is None
