"""Splines, against SciPy's."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline

from brachis.kernel import Basis, Spline, blossom, collocation

KNOTS = np.array([0.0, 0.0, 0.0, 0.0, 0.2, 0.5, 0.5, 0.5, 0.5, 0.9, 1.0, 1.0, 1.0, 1.0])
"""Of a cubic spline; two phases meet at 0.5."""
X = np.sort(np.append(np.random.default_rng(4).uniform(0.0, 1.0, 60), [0.0, 0.5, 1.0]))


@pytest.mark.parametrize("nu", range(4))
@pytest.mark.parametrize("shape", [(), (2,), (2, 3)])
def test_values_and_derivatives(nu, shape):
    points = np.random.default_rng(1).normal(size=(len(KNOTS) - 4, *shape))
    own = Spline(KNOTS, points, 3)(X.reshape(-1, 3), nu)
    wanted = BSpline(KNOTS, points, 3)(X.reshape(-1, 3), nu)
    assert own.shape == wanted.shape
    assert_allclose(own, wanted, rtol=1e-11, atol=1e-9)


def test_higher_derivatives_vanish():
    points = np.random.default_rng(1).normal(size=len(KNOTS) - 4)
    assert not Spline(KNOTS, points, 3)(X, 4).any()
    assert Spline(KNOTS, points, 3)(0.3).shape == ()


@pytest.mark.parametrize("degree", [1, 3, 5])
@pytest.mark.parametrize("more", [1, 2, 40, 500])
def test_interpolation(degree, more):
    rng = np.random.default_rng(more)
    places = np.cumsum(rng.uniform(0.01, 1.0, degree + more))
    values = rng.normal(size=(len(places), 2, 2))
    own = Spline.through(places, values, degree)
    wanted = make_interp_spline(places, values, k=degree)
    assert_allclose(own.knots, wanted.t)
    size = np.abs(wanted.c).max()
    assert_allclose(own.control_points, wanted.c, rtol=1e-9, atol=1e-9 * size)
    assert_allclose(own(places), values, rtol=1e-9, atol=1e-9 * size)


def test_cubic_interpolation_over_uneven_places():
    """Steps that differ by a factor of 1e6."""
    steps = 10.0 ** np.random.default_rng(2).uniform(-6.0, 0.0, 200)
    places = np.cumsum(steps)
    values = np.sin(places)
    x = np.linspace(places[0], places[-1], 300)
    own = Spline.through(places, values)
    wanted = CubicSpline(places, values)
    assert_allclose(own(x), wanted(x), atol=1e-12)
    assert_allclose(own(x, 1), wanted(x, 1), atol=1e-8)


def test_collocation():
    points = np.random.default_rng(3).normal(size=(len(KNOTS) - 4, 2))
    for nu in range(3):
        matrix = collocation(KNOTS, 3, X, nu)
        assert_allclose(matrix @ points, Spline(KNOTS, points, 3)(X, nu))


def test_few_places_are_joined_by_straight_lines():
    own = Spline.through(np.array([1.0, 1.5, 3.0]), np.array([0.0, 1.0, 4.0]))
    assert_allclose(own([1.25, 2.0, 3.0]), [0.5, 2.0, 4.0])


@pytest.mark.parametrize("count", [7, 9])
def test_as_many_values_as_places(count):
    with pytest.raises(ValueError, match=f"{count} values for 8 places"):
        Spline.through(np.arange(8.0), np.ones((count, 2)))


def test_values_in_any_order_of_memory():
    values = np.random.default_rng(5).normal(size=(8, 3))
    own = Spline.through(np.arange(8.0), np.asfortranarray(values))
    assert_allclose(own(np.arange(8.0)), values, atol=1e-14)


def test_no_place_and_no_curve():
    assert Spline(KNOTS, np.ones((len(KNOTS) - 4, 2)), 3)([]).shape == (0, 2)
    assert Spline(KNOTS, np.ones((len(KNOTS) - 4, 0)), 3)([0.1]).shape == (1, 0)


def test_numbers_that_do_not_exist():
    points = np.ones((len(KNOTS) - 4, 1))
    for piece in (2, len(points)):
        with pytest.raises(ValueError, match="a piece does not exist"):
            blossom(KNOTS, points, np.array([piece]), [np.zeros(1)] * 3)
    basis = np.ones((4, 1, 4))
    with pytest.raises(ValueError, match="a control point does not exist"):
        Basis(basis, np.array([len(points) - 3])).sum(points.T)
    with pytest.raises(ValueError, match="negative"):
        Basis(basis, np.array([-1]))
    with pytest.raises(ValueError, match="one index for each place"):
        Basis(basis, np.array([0, 1]))


@pytest.mark.parametrize(
    "places", [[0.0], [0.0, 1.0, 1.0, 2.0], [3.0, 2.0, 1.0, 0.0], [0.0] * 5]
)
def test_places_without_an_interpolation(places):
    with pytest.raises(ValueError, match="places of an interpolation"):
        Spline.through(np.array(places), np.ones(len(places)))
