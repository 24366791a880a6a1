"""Derivatives of products, unit vectors and sines; rotations; and the search for the smallest value."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from brachis.common.arrays import with_like_signs
from brachis.kernel import rotation_derivatives
from brachis.path.pose import smallest
from brachis.path.rotations import (
    hat,
    product,
    quaternion_derivatives,
    rotation_of,
    sine_cosine,
    unit,
)
from brachis.task.points.units import quaternions_of

ORDER = 4
SIGMA = np.linspace(-1, 1, 7)


def polynomial(coefficients, sigma, order=ORDER):
    """Derivatives of vector polynomials, shape (order + 1, K, n)."""
    polynomials = [np.polynomial.Polynomial(row) for row in coefficients]
    return np.stack(
        [
            np.stack([p.deriv(k)(sigma) if k else p(sigma) for p in polynomials], -1)
            for k in range(order + 1)
        ]
    )


def assert_derivatives(function):
    """Each derivative of ``function(sigma)``, (order + 1, K, ...), is the slope of the one before."""
    exact, h = function(SIGMA), 1e-3
    slope = sum(
        w * (function(SIGMA + k * h) - function(SIGMA - k * h))
        for k, w in ((1, 45.0), (2, -9.0), (3, 1.0))
    )
    slope /= 60 * h
    assert len(exact) == ORDER + 1
    for k in range(ORDER):
        assert np.abs(exact[k + 1]).max() > 1e-3
        np.testing.assert_allclose(
            slope[k], exact[k + 1], atol=1e-8 * np.abs(exact[k + 1]).max()
        )


RANDOM = np.random.default_rng(5)
ONE, OTHER, QUATERNION = (RANDOM.uniform(-1, 1, (n, 6)) for n in (3, 3, 4))
ANGLE = RANDOM.uniform(-1, 1, (1, 6))
QUATERNION[0, 0] = 4.0


def rotation_at(sigma):
    return rotation_derivatives(polynomial(QUATERNION, sigma))


FUNCTIONS = {
    "scalar product": lambda s: product(
        polynomial(ONE, s), polynomial(OTHER, s), "...i,...i->..."
    ),
    "cross product": lambda s: product(
        hat(polynomial(ONE, s)), polynomial(OTHER, s), "...ij,...j->...i"
    ),
    "unit vector": lambda s: unit(polynomial(QUATERNION, s)),
    "sine": lambda s: sine_cosine(polynomial(ANGLE, s))[0],
    "cosine": lambda s: sine_cosine(polynomial(ANGLE, s))[1],
    "matrix": rotation_at,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_derivatives(name):
    assert_derivatives(FUNCTIONS[name])


def test_values():
    one, other = polynomial(ONE, SIGMA), polynomial(OTHER, SIGMA)
    np.testing.assert_allclose(
        FUNCTIONS["cross product"](SIGMA)[0], np.cross(one[0], other[0])
    )
    np.testing.assert_allclose(
        np.linalg.norm(FUNCTIONS["unit vector"](SIGMA)[0], axis=1), 1.0
    )
    np.testing.assert_allclose(
        FUNCTIONS["sine"](SIGMA)[0], np.sin(polynomial(ANGLE, SIGMA)[0])
    )


def test_quaternions_have_the_scalar_first():
    rotations = Rotation.random(50, rng=6)
    quaternions = quaternions_of(rotation_of(rotations.as_matrix()))
    np.testing.assert_allclose(
        rotation_derivatives(quaternions[None])[0], rotations.as_matrix(), atol=1e-14
    )
    np.testing.assert_array_equal(quaternions_of(Rotation.identity()), [1, 0, 0, 0])


def test_quaternion_derivatives_give_the_matrix_back():
    rotation = rotation_at(SIGMA[2:3])[:, 0]
    pose = np.pad(rotation.reshape(-1, 9), ((0, 0), (3, 0)))
    quaternion = quaternion_derivatives(pose)
    np.testing.assert_allclose(
        rotation_derivatives(quaternion), rotation, atol=1e-12 * np.abs(rotation).max()
    )


def test_signs_of_neighbours():
    half = np.linspace(0, 12, 13) / 2
    quaternions = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
    flipped = quaternions * RANDOM.choice([-1.0, 1.0], 13)[:, None]
    np.testing.assert_allclose(
        with_like_signs(flipped), quaternions * np.sign(flipped[0] @ quaternions[0])
    )


def test_the_smallest_value_is_found_between_the_points_looked_at():
    where, value = smallest(
        lambda sigma: np.abs(sigma - np.pi / 3), np.array([0.0, 1.0, 4.0])
    )
    assert where == pytest.approx(np.pi / 3, abs=1e-3)
    assert value < 1e-3
    assert smallest(lambda sigma: sigma, np.array([0.5, 2.0])) == (0.5, 0.5)
