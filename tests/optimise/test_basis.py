"""B-spline basis functions against SciPy's BSpline."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.interpolate import BSpline

from brachis.optimise.bspline import (
    clamped_knots,
    local_basis,
)
from support.arrays import assert_near

EVEN = np.linspace(0.0, 1.0, 10)
UNEVEN = np.array([0.0, 0.3, 0.35, 0.55, 0.56, 0.7, 1.0])


@pytest.mark.parametrize("breaks", [EVEN, UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("degree", range(2, 7))
def test_any_spline_and_its_derivatives(degree, breaks):
    knots = clamped_knots(degree, breaks)
    rng = np.random.default_rng(degree)
    coefficients = rng.normal(size=(len(knots) - degree - 1, 2))
    # Not at knots, where the highest derivative jumps.
    t_norm = np.concatenate([[0.0], np.sort(rng.uniform(0.0, 1.0, 200)), [1.0]])
    first, values = local_basis(knots, degree, t_norm)
    assert values.shape == (4, len(t_norm), degree + 1)
    windows = coefficients[first[:, None] + np.arange(degree + 1)]
    for order in range(min(degree, 3) + 1):
        expected = BSpline(knots, coefficients, degree)(t_norm, nu=order)
        curves = np.einsum("kw,kwc->kc", values[order], windows)
        assert_near(curves, expected, 1e-12)


def test_times_beyond_the_ends_are_taken_back():
    knots = clamped_knots(3, np.linspace(0.0, 1.0, 6))
    inside = local_basis(knots, 3, np.array([0.0, 1.0]))
    outside = local_basis(knots, 3, np.array([-1e-9, 1.0 + 1e-9]))
    assert_array_equal(inside[1], outside[1])
