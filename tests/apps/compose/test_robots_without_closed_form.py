"""The robots of the repository without a closed form for poses: as their sources say."""

import math

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis import Robot
from brachis.robot import dynamics

from .conftest import ROOT

X, _, Z = np.eye(3)
JOINTS = {"gen3": 7, "arm8": 8, "gen3_rails": 9}


def load(name):
    return Robot.from_urdf(ROOT / f"robots/{name}/robot.urdf")


@pytest.fixture
def gen3():
    return load("gen3")


def anywhere(robot, count):
    """Joints without end are turned once around."""
    limits = robot.limits
    lower = np.maximum(limits.position_lower, -math.pi)
    upper = np.minimum(limits.position_upper, math.pi)
    return np.random.default_rng(0).uniform(lower, upper, (count, robot.n))


@pytest.mark.parametrize("name, joints", JOINTS.items())
def test_their_drives_can_hold_them(name, joints):
    robot = load(name)
    assert robot.n == joints
    q = anywhere(robot, 2000)
    still = np.zeros_like(q)
    assert np.all(
        np.abs(dynamics.torque(robot, q, still, still)) < 0.7 * robot.limits.torque
    )


def test_gen3_limits_and_masses(gen3):
    ranges = np.radians([math.inf, 128.9, math.inf, 147.8, math.inf, 120.3, math.inf])
    assert_array_equal(gen3.limits.position_upper, ranges)
    assert_array_equal(gen3.limits.position_lower, -ranges)
    assert_allclose(gen3.limits.velocity, [1.3963] * 4 + [1.2218] * 3, atol=1e-4)
    assert_array_equal(gen3.limits.torque, [39] * 4 + [9] * 3)
    assert sum(body.mass for body in gen3.model.inertias) == pytest.approx(
        8.2, abs=0.02
    )


def test_gen3_is_the_published_chain(gen3):
    """Denavit-Hartenberg parameters, with half a turn about x before the first."""
    d = (-0.28481, -0.01175, -0.42076, -0.01275, -0.31436, -0.0003501, -0.167455)
    turns = np.array([0, 1, 1, 1, 1, 1, 1]) * math.pi
    twists = np.array([0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 1.0]) * math.pi
    for q in anywhere(gen3, 50):
        expected = pin.SE3(pin.exp3(math.pi * X), 0.0 * X)
        for angle, along, twist in zip(q + turns, d, twists, strict=True):
            turn = pin.SE3(pin.exp3(angle * Z), along * Z)
            expected = expected * turn * pin.SE3(pin.exp3(twist * X), 0.0 * X)
        assert gen3.tool_placement(q).isApprox(expected, 1e-12)


def test_gen3_rails_carry_the_same_arm_upside_down(gen3):
    robot = load("gen3_rails")
    hanging = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 1.6]))
    for q in anywhere(robot, 20):
        shift = pin.SE3(np.eye(3), np.array([*q[:2], 0.0]))
        expected = shift * hanging * gen3.tool_placement(q[2:])
        assert robot.tool_placement(q).isApprox(expected, 1e-12)
    for name in ("position_lower", "position_upper", "velocity", "torque"):
        assert_array_equal(getattr(robot.limits, name)[2:], getattr(gen3.limits, name))


def test_arm8_stands_upright_at_zero_and_no_neighbouring_axes_meet():
    robot = load("arm8")
    assert_allclose(
        robot.tool_placement(np.zeros(8)).translation, [0.04, 0.0, 1.4], atol=1e-12
    )
    placements = robot.model.jointPlacements[2:]
    assert [abs(placement.translation[0]) for placement in placements] == pytest.approx(
        [0.04] * 7
    )
