"""Least times along fixed joint paths, against formulas."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.limits.joint import AccelerationLimit, TorqueLimit, VelocityLimit
from brachis.robot import dynamics
from brachis.search import phase_plane

GANTRY = Path(__file__).parents[2] / "robots/gantry2/robot.urdf"
SCARA = Path(__file__).parents[2] / "robots/scara3/robot.urdf"
S = np.linspace(0.0, 1.0, 201)


def gantry(**limits: object) -> brachis.Robot:
    spec = {"torque": None, "velocity": None, "acceleration": None} | limits
    return brachis.Robot.from_urdf(
        GANTRY, gravity=[0, 0, 0], limits=brachis.LimitSpec(**spec)
    )


def least_time(robot: brachis.Robot, s: np.ndarray, q: np.ndarray) -> float:
    built = (
        build(robot, None)
        for build in (TorqueLimit.build, VelocityLimit.build, AccelerationLimit.build)
    )
    return phase_plane.least_time([limit for limit in built if limit is not None], s, q)


def joint_path(distance: float) -> np.ndarray:
    return np.column_stack([distance * S, np.zeros_like(S)])


def test_bang_bang_with_a_torque_limit():
    robot = gantry(torque=20.0)
    mass = dynamics.mass_matrices(robot, np.zeros((1, 2)))[0, 0, 0]
    assert least_time(robot, S, joint_path(0.4)) == pytest.approx(
        2.0 * np.sqrt(0.4 * mass / 20.0), rel=5e-3
    )


def test_bang_bang_with_an_acceleration_limit():
    assert least_time(gantry(acceleration=3.0), S, joint_path(0.4)) == pytest.approx(
        2.0 * np.sqrt(0.4 / 3.0), rel=5e-3
    )


def test_trapezoid_with_a_velocity_limit():
    robot = gantry(acceleration=3.0, velocity=0.5)
    assert least_time(robot, S, joint_path(0.4)) == pytest.approx(
        0.4 / 0.5 + 0.5 / 3.0, rel=5e-3
    )


def test_gravity_that_no_torque_holds():
    limits = brachis.LimitSpec(torque=1.0, velocity=None)
    robot = brachis.Robot.from_urdf(GANTRY, gravity=[-9.81, 0, 0], limits=limits)
    weight = np.abs(
        dynamics.torque(robot, np.zeros((1, 2)), np.zeros((1, 2)), np.zeros((1, 2)))
    ).max()
    assert weight > 1.0, "the case asks nothing"
    assert least_time(robot, S, joint_path(0.4)) == np.inf


def test_mass_matrices_are_what_the_torque_multiplies():
    robot = brachis.Robot.from_urdf(
        SCARA, friction={"armature": 0.3}, gravity=[0, 0, 0]
    )
    rng = np.random.default_rng(0)
    q, qddot = rng.normal(size=(2, 5, 3))
    expected = dynamics.torque(robot, q, np.zeros_like(q), qddot)
    np.testing.assert_allclose(
        np.einsum("kij,kj->ki", dynamics.mass_matrices(robot, q), qddot),
        expected,
        atol=1e-12,
    )


def test_a_curved_course_against_plain_trial():
    """Joints that turn against each other: the terms with the square of the speed decide."""
    robot = brachis.Robot.from_urdf(
        SCARA, gravity=[0, 0, 0], limits=brachis.LimitSpec(torque=10.0, velocity=None)
    )
    q = np.column_stack(
        [0.5 + np.sin(2.0 * S), -1.5 + 0.8 * S**2, 1.0 + np.cos(3.0 * S)]
    )
    assert least_time(robot, S, q) == pytest.approx(
        least_time_by_trial(robot, S, q), rel=0.02
    )


def least_time_by_trial(robot: brachis.Robot, s: np.ndarray, q: np.ndarray) -> float:
    """Least time by trying every x of a grid: backwards whether one can still brake, then forwards at full throttle."""
    step = s[1] - s[0]
    q_ds = np.gradient(q, step, axis=0, edge_order=2)
    q_dds = np.gradient(q_ds, step, axis=0, edge_order=2)
    limit = robot.limits.torque
    zero = np.zeros_like(q)
    a = dynamics.torque(robot, q, zero, q_ds)
    b = dynamics.torque(robot, q, q_ds, q_dds)

    def accelerations(k: int, x: float) -> tuple[float, float]:
        low, high = np.sort(
            [(-limit - b[k] * x) / a[k], (limit - b[k] * x) / a[k]], axis=0
        )
        return float(low.max()), float(high.min())

    grid = np.linspace(0.0, 4.0, 1001)
    reach = 0.0
    highest = np.zeros(len(s))
    for k in range(len(s) - 2, -1, -1):
        bounds = [(x, *accelerations(k, x)) for x in grid]
        good = [
            x for x, low, high in bounds if low <= high and x + 2 * step * low <= reach
        ]
        reach = max(good, default=0.0)
        highest[k] = reach
    x = np.zeros(len(s))
    for k in range(len(s) - 1):
        x[k + 1] = np.clip(
            x[k] + 2 * step * accelerations(k, x[k])[1], 0.0, highest[k + 1]
        )
    speed = np.sqrt(np.maximum(x, 1e-6))
    return float(np.sum(2 * step / (speed[1:] + speed[:-1])))
