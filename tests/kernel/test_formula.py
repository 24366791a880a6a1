"""Recorded formulas against NumPy, and their slopes against complex steps."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.kernel import Formula
from brachis.kernel.formula import arccos, arctan2, ceil, cos, sin, sqrt

POINTS = 37  # not a multiple of what is computed side by side


def everything(a, b):
    """All operations, with constants, and with terms that are left out."""
    x, y = a[:, 0], a[:, 1]
    z = b[:, 0]
    root = sqrt(x * x + y * y + 1.0)
    parts = [
        (x + y) * z - 2.0,
        1.0 - x / root,
        -y * sin(z) + cos(-x) * -1.0,
        arctan2(x, y) + arccos(0.3 * sin(z)) / 2.0,
        x * 0.0 + y * 1.0 - 0.0,
        3.0 / root + ceil(z),
    ]
    return np.stack(parts, axis=1)


@pytest.fixture
def points():
    rng = np.random.default_rng(4)
    return rng.normal(size=(POINTS, 2)), rng.normal(size=(POINTS, 1))


def test_values(points):
    found = Formula.of(everything, 2, 1)(*points)
    assert_allclose(found, everything(*points), rtol=0.0, atol=1e-14)


def test_slopes(points):
    q = np.hstack(points)

    def function(q):
        return everything(q[:, :2], q[:, 2:])[:, :5]

    found = Formula.gradient(function, 3)(q)
    for joint in range(3):
        step = 1e-6 * np.eye(3)[joint]
        known = (function(q + step) - function(q - step)) / 2e-6
        assert_allclose(found[:, :, joint], known, atol=1e-8)


def test_a_part_has_fewer_steps_and_the_same_values(points):
    whole = Formula.of(everything, 2, 1)
    part = whole.select(np.s_[:2])
    assert len(part.steps) < len(whole.steps)
    assert_array_equal(part(*points), whole(*points)[:, :2])


def test_a_formula_comes_back_from_another_process(points):
    whole = Formula.of(everything, 2, 1)
    whole(*points)
    again = pickle.loads(pickle.dumps(whole))  # noqa: S301  (our own)
    assert_array_equal(again(*points), whole(*points))


def test_what_has_no_value_is_not_finite():
    found = Formula.of(lambda a: sqrt(a) / (a - a), 1)(np.array([[-1.0], [0.0], [1.0]]))
    assert not np.isfinite(found).any()


def test_a_row_is_found_as_a_whole():

    def function(a):
        return np.stack([sqrt(a[:, 0]), a[:, 1]], axis=1)

    whole = Formula.of(function, 2, discards_incomplete=True)
    points = np.array([[4.0, 5.0], [-1.0, 5.0], [4.0, np.inf]])
    found = whole(points)
    assert_array_equal(found[0], [2.0, 5.0])
    assert np.isnan(found[1:]).all()
    assert Formula.of(function, 2)(points)[1, 1] == 5.0


def test_points_of_another_size_are_errors(points):
    with pytest.raises(ValueError, match="needed"):
        Formula.of(everything, 2, 1)(*points[::-1])
