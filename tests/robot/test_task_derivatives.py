"""Task Jacobian, bias acceleration and their derivatives against differences of forward task_map."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brachis.robot import bind, task_map_of
from support.chains import gantry_robot, planar_robot
from support.spatial import rail_arm

CASES = [
    ("RPRC", "xy", ["x", "y", "yaw"]),
    ("RPRC", "xz", ["x", "z", "pitch"]),
    ("RPRC", "xz", ["z", "pitch"]),
    ("RRRC", "xy", ["z", "x", "y", "yaw"]),
    ("RRP", "tilted", ["x", "y", "z"]),
    ("RPR", "tilted", ["z"]),
]


def case(pattern, plane, rows, count=9):
    robot = planar_robot(pattern, plane)
    task_map = task_map_of(robot, rows)
    rng = np.random.default_rng(4)
    # Small angles keep yaw away from its jump at pi.
    return task_map, *(
        scale * rng.uniform(-1.0, 1.0, (count, robot.n)) for scale in (0.6, 2.0, 3.0)
    )


def jacobian_at(task_map, q):
    return task_map.jacobian(task_map.twists(q))


def bias_at(task_map, q, qdot):
    """Task acceleration at constant joint velocity, V_q qdot, (K, m)."""
    slopes = task_map.derivatives(task_map.twists(q), qdot, 0.0 * qdot).velocity_q
    return np.einsum("kmn,kn->km", slopes, qdot)


def by_joint(function, q, h=1e-5):
    """Central differences of a (K, m) function of postures (K, n): (K, m, n)."""
    steps = h * np.eye(q.shape[1])
    return np.stack(
        [(function(q + step) - function(q - step)) / (2.0 * h) for step in steps],
        axis=2,
    )


@pytest.mark.parametrize("pattern, plane, rows", CASES, ids=str)
def test_jacobian(pattern, plane, rows):
    task_map, q, _, _ = case(pattern, plane, rows)
    exact = jacobian_at(task_map, q)
    assert exact.shape == (len(q), len(rows), len(pattern))
    assert_allclose(exact, by_joint(task_map.values, q), atol=1e-9)


@pytest.mark.parametrize("pattern, plane, rows", CASES, ids=str)
def test_bias_is_the_acceleration_at_constant_joint_velocity(pattern, plane, rows):
    task_map, q, qdot, _ = case(pattern, plane, rows)
    h = 1e-4
    values = [task_map.values(q + t * qdot) for t in (-h, 0.0, h)]
    expected = (values[0] - 2.0 * values[1] + values[2]) / h**2
    assert np.abs(expected).max() > 0.1
    assert_allclose(bias_at(task_map, q, qdot), expected, atol=1e-5)


def check_derivatives(task_map, q, qdot, qddot):
    """Compare V_q, A_q and A_v with differences of velocity and acceleration."""

    def velocity(posture):
        return np.einsum("kmn,kn->km", jacobian_at(task_map, posture), qdot)

    def acceleration(posture, speed):
        bias = bias_at(task_map, posture, speed)
        return np.einsum("kmn,kn->km", jacobian_at(task_map, posture), qddot) + bias

    exact = task_map.derivatives(task_map.twists(q), qdot, qddot)
    assert_allclose(exact.velocity_q, by_joint(velocity, q), atol=1e-8)
    assert_allclose(
        exact.acceleration_q, by_joint(lambda p: acceleration(p, qdot), q), atol=1e-7
    )
    assert_allclose(
        exact.acceleration_qdot, by_joint(lambda v: acceleration(q, v), qdot), atol=1e-7
    )
    for derivative in (exact.velocity_q, exact.acceleration_q, exact.acceleration_qdot):
        assert np.abs(derivative).max() > 0.1


@pytest.mark.parametrize("pattern, plane, rows", CASES, ids=str)
def test_derivatives(pattern, plane, rows):
    check_derivatives(*case(pattern, plane, rows))


# Pinocchio returns arrays of one joint without their last axis.
def test_one_joint_alone():
    robot = gantry_robot([(0.6, 0.0, 0.8)])
    task_map = task_map_of(robot, ["x"])
    q = np.array([[0.3], [0.4]])
    assert_allclose(jacobian_at(task_map, q), np.full((2, 1, 1), 0.6))
    assert_allclose(bias_at(task_map, q, q), np.zeros((2, 1)), atol=1e-15)
    for part in vars(task_map.derivatives(task_map.twists(q), q, q)).values():
        assert_allclose(part, np.zeros((2, 1, 1)), atol=1e-15)


def pose_case(space):
    robot, task_map = bind(rail_arm(), space)
    rng = np.random.default_rng(5)
    return task_map, *(
        scale * rng.uniform(-1.0, 1.0, (7, robot.n)) for scale in (2.0, 2.0, 3.0)
    )


def twist(task_map, q, direction, h=1e-4):
    """Body twist (K, 6) of the motion q + t * direction at t = 0, from poses."""
    ahead, here, behind = (task_map.values(q + t * direction) for t in (h, 0.0, -h))
    return (task_map.difference(ahead, here) - task_map.difference(behind, here)) / (
        2.0 * h
    )


@pytest.mark.parametrize("space", ["pose", "pose_free_roll"])
def test_jacobian_of_a_pose_gives_the_body_twist(space):
    task_map, q, qdot, _ = pose_case(space)
    jacobian = jacobian_at(task_map, q)
    assert jacobian.shape == (len(q), 6, q.shape[1])
    assert_allclose(
        np.einsum("kmn,kn->km", jacobian, qdot), twist(task_map, q, qdot), atol=1e-6
    )


@pytest.mark.parametrize("space", ["pose", "pose_free_roll"])
def test_acceleration_of_a_pose_is_the_derivative_of_the_body_twist(space):
    task_map, q, qdot, qddot = pose_case(space)
    h = 1e-5

    def velocity(t):
        return np.einsum(
            "kmn,kn->km",
            jacobian_at(task_map, q + t * qdot + 0.5 * t**2 * qddot),
            qdot + t * qddot,
        )

    exact = np.einsum("kmn,kn->km", jacobian_at(task_map, q), qddot) + bias_at(
        task_map, q, qdot
    )
    assert_allclose(exact, (velocity(h) - velocity(-h)) / (2.0 * h), atol=1e-7)


@pytest.mark.parametrize("space", ["pose", "pose_free_roll"])
def test_derivatives_of_a_pose(space):
    check_derivatives(*pose_case(space))
