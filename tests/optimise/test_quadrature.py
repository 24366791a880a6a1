"""Weights of means over time at collocation points."""

import numpy as np
import pytest

from brachis.common.arrays import spread
from brachis.optimise.bspline import clamped_knots
from brachis.optimise.grid import FixedGrid

BREAKS = np.array([0.0, 0.2, 0.5, 0.6, 1.0])
EXTRA = np.array([0.23, 0.2301, 0.23013, 0.55, 0.8, 0.9999])


@pytest.fixture(
    params=[(1, 1), (2, 2), (3, 3), (8, 3)], ids=lambda each: f"{each[0]} points"
)
def case(request):
    points, exact = request.param
    return np.union1d(spread(BREAKS, points), EXTRA if points > 1 else []), exact


@pytest.mark.parametrize("degree", [2, 3])
def test_polynomials_are_integrated_exactly_in_every_interval(case, degree):
    t_norm, exact = case
    grid = FixedGrid(clamped_knots(degree, BREAKS), degree, t_norm)
    weights = grid.mean_weights(np.empty(0))
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    # Where the acceleration may jump at a knot, what is known there belongs to the interval behind it.
    for power in range(exact if degree == 2 else exact + 1):
        assert weights @ t_norm**power == pytest.approx(1.0 / (power + 1), abs=1e-10)
