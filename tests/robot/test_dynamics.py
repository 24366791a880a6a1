"""Torques and their derivatives: Lagrange's equations, the friction formula, central differences."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brachis.errors import InputError
from brachis.robot import Robot, dynamics
from support.chains import gantry_robot, planar_robot

FRICTION = {
    "armature": [0.3, 0.2, 0.1],
    "viscous": {"j1": 4.0, "j3": 2.0},
    "coulomb": 5.0,
    "coulomb_velocity": 0.4,
}


def states(n, count=12, seed=0):
    rng = np.random.default_rng(seed)
    return tuple(
        scale * rng.uniform(-1.0, 1.0, (count, n)) for scale in (3.0, 2.0, 5.0)
    )


class RodArm:
    """Three uniform slender rods of 1 m and 10 kg in a plane, by hand: absolute angles, Lagrange's equations."""

    mass, length = 10.0, 1.0

    @classmethod
    def mass_matrix(cls, q):
        # In absolute angles theta_i: M_ij = c_ij l^2 cos(theta_i - theta_j), c from integrating along the rods.
        share = np.array(
            [[7.0 / 3.0, 1.5, 0.5], [1.5, 4.0 / 3.0, 0.5], [0.5, 0.5, 1.0 / 3.0]]
        )
        theta = np.cumsum(q)
        absolute = (
            cls.mass * cls.length**2 * share * np.cos(theta[:, None] - theta[None])
        )
        to_absolute = np.tril(np.ones((3, 3)))
        return to_absolute.T @ absolute @ to_absolute

    @classmethod
    def potential(cls, q, gravity):
        theta = np.cumsum(q)
        return (
            cls.mass
            * gravity
            * cls.length
            * float(np.array([2.5, 1.5, 0.5]) @ np.sin(theta))
        )

    @classmethod
    def torque(cls, q, qdot, qddot, gravity):
        """Return M qddot + Mdot qdot - d(kinetic)/dq + d(potential)/dq, with differences of closed formulas."""
        h = 1e-6
        slopes = [
            (cls.mass_matrix(q + h * e) - cls.mass_matrix(q - h * e)) / (2 * h)
            for e in np.eye(3)
        ]
        rate = sum(slope * speed for slope, speed in zip(slopes, qdot, strict=True))
        kinetic = np.array([0.5 * qdot @ slope @ qdot for slope in slopes])
        pull = [
            (cls.potential(q + h * e, gravity) - cls.potential(q - h * e, gravity))
            / (2 * h)
            for e in np.eye(3)
        ]
        return cls.mass_matrix(q) @ qddot + rate @ qdot - kinetic + np.array(pull)


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_scara_is_three_slender_rods(scara_urdf, gravity):
    robot = Robot.from_urdf(scara_urdf, gravity=[0.0, -gravity, 0.0])
    q, qdot, qddot = states(3)
    exact = robot.dynamic_chain.torque_derivatives(q, qdot, qddot)
    expected = np.array(
        [RodArm.torque(*state, gravity) for state in zip(q, qdot, qddot, strict=True)]
    )
    assert_allclose(dynamics.torque(robot, q, qdot, qddot), expected, atol=1e-6)
    matrices = np.array([RodArm.mass_matrix(posture) for posture in q])
    assert_allclose(exact.qddot, matrices, atol=1e-12)


def test_friction_formula():
    rigid = planar_robot("RPR", "xz")
    robot = planar_robot("RPR", "xz", friction=FRICTION)
    q, qdot, qddot = states(3)
    armature, viscous = np.array([0.3, 0.2, 0.1]), np.array([4.0, 0.0, 2.0])
    expected = armature * qddot + viscous * qdot + 5.0 * np.tanh(qdot / 0.4)
    assert np.abs(expected).min() > 0.0
    torques = [dynamics.torque(arm, q, qdot, qddot) for arm in (robot, rigid)]
    assert_allclose(torques[0] - torques[1], expected, atol=1e-12)


@pytest.mark.parametrize(
    "pattern, plane", [("RPR", "xz"), ("CRR", "tilted"), ("RRP", "xy")]
)
def test_derivatives_against_central_differences(pattern, plane):
    robot = planar_robot(pattern, plane, friction=FRICTION, gravity=[1.0, -2.0, -9.81])
    state = states(3)
    exact = robot.dynamic_chain.torque_derivatives(*state)
    h = 1e-5
    for place, block in enumerate((exact.q, exact.qdot, exact.qddot)):
        assert np.abs(block).max() > 0.1
        for joint in range(3):
            sides = []
            for sign in (1.0, -1.0):
                moved = list(state)
                moved[place] = state[place] + sign * h * np.eye(3)[joint]
                sides.append(dynamics.torque(robot, *moved))
            difference = (sides[0] - sides[1]) / (2.0 * h)
            assert_allclose(
                block[:, :, joint], difference, atol=2e-8 * np.abs(block).max()
            )


def test_coulomb_derivative_is_finite_far_from_rest():
    robot = planar_robot("RRR", friction={"coulomb": 5.0, "coulomb_velocity": 1e-3})
    q, _, qddot = states(3)
    fast = np.full_like(q, 50.0)
    by_qdot = robot.dynamic_chain.torque_derivatives(q, fast, qddot).qdot
    without = planar_robot("RRR").dynamic_chain.torque_derivatives(q, fast, qddot).qdot
    assert np.all(np.isfinite(by_qdot))
    assert_allclose(by_qdot, without, atol=1e-12)


def test_one_joint_alone():
    robot = gantry_robot([(1.0, 0.0, 0.0)])
    state = states(1)
    assert_allclose(dynamics.torque(robot, *state), 2.0 * state[2], atol=1e-12)
    derivatives = robot.dynamic_chain.torque_derivatives(*state)
    assert_allclose(derivatives.qddot, np.full((12, 1, 1), 2.0))


@pytest.mark.parametrize(
    "friction, words",
    [
        ({"viscous": -1.0}, r"friction\.viscous: out of range; found -1\.0"),
        (
            {"armature": [0.0, float("nan"), 0.0]},
            r"friction\.armature\[1\]: not a finite number",
        ),
        (
            {"coulomb_velocity": 0.0},
            r"friction\.coulomb_velocity: out of range; found 0\.0; allowed: > 0",
        ),
        (
            {"coulomb": [1.0]},
            r"robot\.friction\.coulomb: the list has the wrong number of values",
        ),
    ],
)
def test_friction_that_cannot_be(friction, words):
    with pytest.raises(InputError, match=words):
        planar_robot("RRR", friction=friction)
