"""Least times along fixed courses, against formulas."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.robot import dynamics
from brachis.search.phase_plane import least_time

GANTRY = Path(__file__).parents[2] / "robots/gantry2/robot.urdf"
S = np.linspace(0.0, 1.0, 201)


def gantry(**limits: object) -> brachis.Robot:
    spec = {"torque": None, "velocity": None, "acceleration": None} | limits
    return brachis.Robot.from_urdf(GANTRY, gravity=[0, 0, 0], limits=brachis.LimitSpec(**spec))


def course(distance: float) -> np.ndarray:
    return np.column_stack([distance * S, np.zeros_like(S)])


def test_bang_bang_with_a_torque_limit():
    robot = gantry(torque=20.0)
    mass = dynamics.mass_matrices(robot, np.zeros((1, 2)))[0, 0, 0]
    assert least_time(robot, S, course(0.4)) == pytest.approx(2.0 * np.sqrt(0.4 * mass / 20.0), rel=5e-3)


def test_bang_bang_with_an_acceleration_limit():
    assert least_time(gantry(acceleration=3.0), S, course(0.4)) == pytest.approx(2.0 * np.sqrt(0.4 / 3.0), rel=5e-3)


def test_trapezoid_with_a_velocity_limit():
    robot = gantry(acceleration=3.0, velocity=0.5)
    assert least_time(robot, S, course(0.4)) == pytest.approx(0.4 / 0.5 + 0.5 / 3.0, rel=5e-3)


def test_gravity_that_no_torque_holds():
    limits = brachis.LimitSpec(torque=1.0, velocity=None)
    robot = brachis.Robot.from_urdf(GANTRY, gravity=[-9.81, 0, 0], limits=limits)
    weight = np.abs(dynamics.torque(robot, np.zeros((1, 2)), np.zeros((1, 2)), np.zeros((1, 2)))).max()
    assert weight > 1.0, "the case asks nothing"
    assert least_time(robot, S, course(0.4)) == np.inf


def test_mass_matrices_are_what_the_torque_multiplies():
    robot = brachis.Robot.from_urdf(
        Path(__file__).parents[2] / "robots/scara3/robot.urdf", friction={"armature": 0.3}, gravity=[0, 0, 0]
    )
    rng = np.random.default_rng(0)
    q, qddot = rng.normal(size=(2, 5, 3))
    expected = dynamics.torque(robot, q, np.zeros_like(q), qddot)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", dynamics.mass_matrices(robot, q), qddot), expected, atol=1e-12)
