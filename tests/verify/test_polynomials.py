"""Roots and turns of polynomials in Bernstein form, against NumPy's."""

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.kernel import bernstein
from brachis.verify.motion import roots, turns


def powers_of(c):
    """Coefficients of the powers of u, the highest first, of one polynomial in Bernstein form."""
    m = len(c) - 1
    sums = np.zeros(m + 1)
    for k, value in enumerate(c):
        for i in range(m - k + 1):
            sums[k + i] += value * math.comb(m, k) * math.comb(m - k, i) * (-1.0) ** i
    return sums[::-1]


@pytest.mark.parametrize("degree", range(1, 6))
def test_roots_of_random_polynomials(degree):
    c = np.random.default_rng(degree).normal(size=(degree + 1, 300))
    column, u = roots(c)
    for f in range(c.shape[1]):
        expected = np.roots(powers_of(c[:, f]))
        real = np.sort(expected[np.abs(expected.imag) < 1e-10].real)
        assert_allclose(u[column == f], real[(real > 0.0) & (real < 1.0)], atol=1e-9)
    assert_array_equal(column, np.sort(column))
    assert_allclose(bernstein(c, column, u), 0.0, atol=1e-12)


def test_polynomials_without_a_root_and_without_a_number():
    column, u = roots(np.array([[1.0, np.nan, 0.0], [2.0, 1.0, 0.0], [1.0, -1.0, 0.0]]))
    assert (len(column), len(u)) == (0, 0)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_turns(scale):
    """u^2 (1 - u) turns at 2/3, where it is 4/27, and 1 - u^2 nowhere within (0, 1)."""
    c = scale * np.array([[0.0, 1.0], [0.0, 1.0], [1.0 / 3.0, 2.0 / 3.0], [0.0, 0.0]])
    column, u, value = turns(c)
    assert_array_equal(column, [0])
    assert_allclose(u, [2.0 / 3.0], rtol=1e-12)
    assert_allclose(value, [scale * 4.0 / 27.0], rtol=1e-12)


def test_roots_in_the_middle_of_parts_and_roots_that_nearly_meet():
    """Roots at 1/2, 1/4 and 5/8; then two that are 1e-6 apart, and two that a polynomial does not quite reach."""
    cubic = from_roots(0.5, 0.25, 0.625)
    assert_allclose(roots(cubic[:, None])[1], [0.25, 0.5, 0.625], atol=1e-15)
    near = from_roots(0.3, 0.300001)
    assert_allclose(roots(near[:, None])[1], [0.3, 0.300001], atol=1e-9)
    assert not len(roots(near[:, None] + 1e-9)[1])


def from_roots(*places):
    """Bernstein coefficients of the polynomial with these roots, by the polar form."""
    m = len(places)
    values = []
    for ones in range(m + 1):
        terms = [
            math.prod((place in chosen) - place for place in places)
            for chosen in itertools.combinations(places, ones)
        ]
        values.append(sum(terms) / len(terms))
    return np.array(values)
