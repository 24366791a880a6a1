"""Passes over the phase plane, against plain Python of the same formulas."""

import itertools

import numpy as np
import pytest

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


@pytest.fixture(params=range(20))
def lines(request):
    rng = np.random.default_rng(request.param)
    slope = rng.normal(size=(40, 5))
    slope[:, 4] = slope[:, 3]  # parallel
    middle = rng.normal(size=(40, 5))
    width = rng.uniform(0.1, 3.0, (40, 5))
    return slope, middle - width, middle + width


def test_bounds_of_pairs(lines):
    least, most = kernel.bounds_of_pairs(*lines, FLAT)
    known = [bounds_of_pairs(*row) for row in zip(*lines, strict=True)]
    assert np.array_equal(np.column_stack([least, most]), np.array(known))


def test_without_rows_nothing_is_bounded():
    none = np.empty((3, 0))
    least, most = kernel.bounds_of_pairs(none, none, none, FLAT)
    assert np.array_equal(least, np.zeros(3))
    assert np.isinf(most).all()


@pytest.mark.parametrize("seed", range(20))
def test_both_passes(seed):
    rng = np.random.default_rng(seed)
    factor = 1.0 + rng.normal(0.0, 0.4, (60, 4))
    factor[5] = 0.0
    least = -rng.uniform(0.1, 0.5, (60, 4))
    most = rng.uniform(0.1, 0.5, (60, 4))
    floor = np.zeros(60)
    ceiling = rng.uniform(0.5, 2.0, 60)
    known = go_backwards(factor, least, most, floor, ceiling, 0.0)
    found = kernel.go_backwards(
        (factor, least, most), (floor, ceiling), 0.0, flat=FLAT, rounding=ROUNDING
    )
    assert known is not None
    assert found is not None
    np.testing.assert_allclose(found, known, rtol=1e-14)
    x = [0.0]
    for k, row in enumerate(factor):
        reached = min(found[1][k + 1], *(row * x[k] + most[k]))
        x.append(max(reached, found[0][k + 1]))
    forwards = kernel.go_forwards(factor, most, found, 0.0)
    np.testing.assert_allclose(forwards, x, rtol=1e-14)


def test_an_end_that_cannot_be_reached():
    steps = np.ones((3, 1)), -np.ones((3, 1)), np.full((3, 1), 0.1)
    levels = np.zeros(3), np.full(3, 0.2)
    assert kernel.go_backwards(steps, levels, 1.0, flat=FLAT, rounding=ROUNDING) is None
