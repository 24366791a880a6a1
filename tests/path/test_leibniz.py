"""Rotations and their derivatives by quaternions, and the search for the smallest value."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from brachis.common.arrays import with_like_signs
from brachis.kernel import rotation_derivatives
from brachis.path.pose import smallest
from brachis.path.rotations import (
    quaternion_derivatives,
    rotation_of,
)
from brachis.task.points.units import quaternions_of
from support.arrays import assert_near

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


RANDOM = np.random.default_rng(5)
QUATERNION = RANDOM.uniform(-1, 1, (4, 6))
QUATERNION[0, 0] = 4.0


def rotation_at(sigma):
    return rotation_derivatives(polynomial(QUATERNION, sigma))


def test_quaternions_have_the_scalar_first():
    rotations = Rotation.random(50, rng=6)
    quaternions = quaternions_of(rotation_of(rotations.as_matrix()))
    assert_allclose(
        rotation_derivatives(quaternions[None])[0], rotations.as_matrix(), atol=1e-14
    )
    assert_array_equal(quaternions_of(Rotation.identity()), [1, 0, 0, 0])


def test_quaternion_derivatives_give_the_matrix_back():
    rotation = rotation_at(SIGMA[2:3])[:, 0]
    pose = np.pad(rotation.reshape(-1, 9), ((0, 0), (3, 0)))
    quaternion = quaternion_derivatives(pose)
    assert_near(rotation_derivatives(quaternion), rotation, 1e-12)


def test_signs_of_neighbours():
    half = np.linspace(0, 12, 13) / 2
    quaternions = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
    flipped = quaternions * RANDOM.choice([-1.0, 1.0], 13)[:, None]
    assert_allclose(
        with_like_signs(flipped), quaternions * np.sign(flipped[0] @ quaternions[0])
    )


def test_the_smallest_value_is_found_between_the_points_looked_at():
    where, value = smallest(
        lambda sigma: np.abs(sigma - np.pi / 3), np.array([0.0, 1.0, 4.0])
    )
    assert where == pytest.approx(np.pi / 3, abs=1e-3)
    assert value < 1e-3
    assert smallest(lambda sigma: sigma, np.array([0.5, 2.0])) == (0.5, 0.5)
