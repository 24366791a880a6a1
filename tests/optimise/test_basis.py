"""B-spline basis functions against SciPy's BSpline."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from brachis.common.arrays import greville
from brachis.optimise.bspline import basis_matrix, clamped_uniform_knots, local_basis

CASES = [
    (degree, derivative)
    for degree in range(2, 7)
    for derivative in range(min(degree, 3) + 1)
]


def knots_of(degree: int, *, uniform: bool) -> np.ndarray:
    if uniform:
        return clamped_uniform_knots(degree, 9)
    inner = np.cumsum([0.0, 0.3, 0.05, 0.2, 0.01, 0.14, 0.3])
    return np.concatenate([np.zeros(degree), inner / inner[-1], np.ones(degree)])


@pytest.mark.parametrize("uniform", [True, False])
@pytest.mark.parametrize(("degree", "derivative"), CASES)
def test_any_spline_and_its_derivatives(degree, derivative, uniform):
    knots = knots_of(degree, uniform=uniform)
    rng = np.random.default_rng(degree)
    coefficients = rng.normal(size=(len(knots) - degree - 1, 2))
    # At a knot the highest derivative jumps; everywhere else, and at the ends, there is one value.
    t_norm = np.concatenate([[0.0], np.sort(rng.uniform(0.0, 1.0, 200)), [1.0]])
    if derivative < degree:
        t_norm = np.union1d(t_norm, knots)
    expected = BSpline(knots, coefficients, degree)(t_norm, nu=derivative)
    scale = np.abs(expected).max()
    assert scale > 0.0
    first, values = local_basis(knots, degree, t_norm)
    assert values.shape == (4, len(t_norm), degree + 1)
    mine = np.einsum(
        "kw,kwc->kc",
        values[derivative],
        coefficients[first[:, None] + np.arange(degree + 1)],
    )
    np.testing.assert_allclose(mine, expected, atol=1e-12 * scale)
    if derivative == 0:
        matrix = basis_matrix(knots, degree, t_norm)
        assert matrix.shape == (len(t_norm), len(coefficients))
        np.testing.assert_allclose(matrix @ coefficients, expected, atol=1e-12 * scale)
        np.testing.assert_allclose(matrix @ greville(knots, degree), t_norm, atol=1e-12)


def test_times_beyond_the_ends_are_taken_back():
    knots = clamped_uniform_knots(3, 5)
    inside = basis_matrix(knots, 3, np.array([0.0, 1.0]))
    outside = basis_matrix(knots, 3, np.array([-1e-9, 1.0 + 1e-9]))
    np.testing.assert_array_equal(inside, outside)
