"""Inserted knots leave the curves as they are; basis functions of interval lengths; times within intervals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline

from brachis.common.arrays import spread
from brachis.optimise.bspline import (
    basis_derivatives,
    basis_functions,
    clamped_knots,
    insert_knots,
)

LENGTHS = np.array([0.3, 0.05, 0.2, 0.01, 0.14, 0.3])


@settings(max_examples=60)
@given(
    degree=st.integers(1, 6),
    old=st.integers(1, 8),
    new=st.integers(0, 12),
    seed=st.integers(0, 99),
)
def test_the_same_curves(degree, old, new, seed):
    rng = np.random.default_rng(seed)
    breaks = np.unique(np.concatenate([[0.0, 1.0], rng.uniform(0.0, 1.0, old - 1)]))
    finer = np.union1d(breaks, rng.uniform(0.0, 1.0, new))
    knots, fine_knots = clamped_knots(degree, breaks), clamped_knots(degree, finer)
    points = rng.normal(size=(3, len(knots) - degree - 1))
    inserted = insert_knots(points, knots, fine_knots, degree)
    assert inserted.shape == (3, len(finer) - 1 + degree)
    t_norm = np.linspace(0.0, 1.0, 101)
    before, after = (
        BSpline(knots, points.T, degree)(t_norm),
        BSpline(fine_knots, inserted.T, degree)(t_norm),
    )
    assert_allclose(after, before, atol=1e-13)


@pytest.mark.parametrize("degree", range(2, 8))
def test_very_short_intervals_leave_the_curves_as_they_are(degree):
    rng = np.random.default_rng(degree)
    for _ in range(50):
        lengths = 10.0 ** rng.uniform(-4.0, 0.0, 6)
        breaks = np.append(0.0, np.cumsum(lengths) / lengths.sum())
        breaks[-1] = 1.0
        finer = np.union1d(breaks, rng.uniform(0.0, 1.0, 3))
        knots, fine_knots = (clamped_knots(degree, ends) for ends in (breaks, finer))
        points = rng.normal(size=(2, len(breaks) - 1 + degree))
        inserted = insert_knots(points, knots, fine_knots, degree)
        t = rng.uniform(0.0, 1.0, 100)
        before = BSpline(knots, points.T, degree)(t)
        after = BSpline(fine_knots, inserted.T, degree)(t)
        assert_allclose(after, before, atol=1e-8)


@pytest.mark.parametrize("degree", range(2, 7))
def test_basis_derivatives_are_differences(degree):
    padded = np.pad(LENGTHS, degree - 1)
    lengths = np.lib.stride_tricks.sliding_window_view(padded, 2 * degree - 1)
    fraction = np.linspace(0.05, 1.0, len(LENGTHS))
    exact = basis_derivatives(lengths, fraction)
    assert exact.shape == (4, 2 * degree - 1, len(LENGTHS), degree + 1)
    h = 1e-5
    for i, unit in enumerate(np.eye(2 * degree - 1)):
        ahead, behind = (
            basis_functions(lengths + step * unit, fraction) for step in (h, -h)
        )
        expected = (ahead - behind) / (2.0 * h)
        for order in range(4):
            scale = np.abs(exact[order]).max()
            assert (scale > 0.0) == (order <= degree)
            assert_allclose(exact[order, i], expected[order], atol=1e-4 * scale)
    # Twice the lengths: the same values, half the slopes, a quarter of the bends (Euler's theorem).
    for order, values in enumerate(basis_functions(lengths, fraction)):
        turned = np.einsum("ikw,ki->kw", exact[order], lengths)
        assert_allclose(
            turned, -order * values, atol=1e-12 * max(1.0, np.abs(values).max())
        )


def test_spread():
    assert_allclose(spread(np.array([0.0, 0.2, 1.0]), 2), [0.0, 0.1, 0.2, 0.6, 1.0])
    assert_allclose(
        spread(np.array([0.0, 0.3, 1.0]), np.array([3, 1])), [0.0, 0.1, 0.2, 0.3, 1.0]
    )
