"""A given speed of the tool over parts of the path: known optima of a gantry, with the speed met exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.robot import dynamics
from support.effort import QUICK

ROOT = Path(__file__).parents[1]
SPEED, BEGIN, END, LENGTH = 1.0, 0.25, 0.75, 1.2
ACCELERATION = 200.0 / 25.0
"""Of the gantry's bridge and tool."""


def task(part=None, boundary=None, **spline):
    return {
        "brachis": 1,
        "robot": {
            "urdf": str(ROOT / "robots/gantry2/robot.urdf"),
            "limits": {"velocity": None},
        },
        "start": {"joints": [-0.6, 0.0]},
        "task_space": ["x", "y"],
        "path": [{"line": {"by": [LENGTH, 0.0]}}],
        "tool_limits": {"process_speed": part or []},
        "boundary": boundary or {},
        "spline": {"intervals": 20, "rest": "velocity", **spline},
        "search": QUICK,
    }


PART = {"speed": SPEED, "s": [BEGIN, END]}


def leg(way: float, speed: float) -> float:
    """Least time between rest and a speed over a way, by full force either way."""
    top = np.sqrt(ACCELERATION * way + 0.5 * speed**2)
    return float((2.0 * top - speed) / ACCELERATION)


def fastest(speed: float) -> float:
    """Least time with the speed on the part in the middle."""
    ways = leg(BEGIN * LENGTH, speed) + leg((1.0 - END) * LENGTH, speed)
    return ways + (END - BEGIN) * LENGTH / speed


def speeds_along(trajectory):
    """s and the tool's speed by differences, at 5,000 times."""
    t = np.linspace(0.0, trajectory.t_end, 5_001)
    motion = trajectory.at(t)
    positions, _ = trajectory.robot.tool_placements(motion.q)
    return motion.s, np.linalg.norm(np.gradient(positions, t, axis=0), axis=1)


def test_the_speed_is_met_and_reached_and_left_fast():
    free = brachis.plan(task())
    s, speed = speeds_along(free.trajectory)
    assert speed[(s > BEGIN) & (s < END)].min() > 2.0 * SPEED, (
        "without it the tool is much faster"
    )
    result = brachis.plan(task(PART))
    assert result.verified
    assert result.t_end > 1.2 * free.t_end
    s, speed = speeds_along(result.trajectory)
    inside = (s > BEGIN + 1e-3) & (s < END - 1e-3)
    assert_allclose(speed[inside], SPEED, rtol=1e-8)
    assert speed[s < 0.9 * BEGIN].max() > 1.4 * SPEED, (
        "on the way to it the tool is as fast as it can"
    )
    assert fastest(SPEED) <= result.t_end < 1.05 * fastest(SPEED)


@pytest.mark.parametrize("speed", [1.0, 0.1])
def test_with_enough_knots_it_is_the_optimum(speed):
    part = {**PART, "speed": speed}
    result = brachis.plan(task(part, intervals="auto", tolerance=5e-4))
    assert result.verified
    assert result.t_end == pytest.approx(fastest(speed), rel=1e-3)


def test_a_part_may_begin_and_end_with_a_path_that_is_passed_at_its_speed():
    whole = {"speed": 0.3, "s": [0.0, 1.0]}
    result = brachis.plan(task(whole, {"start_speed": 0.3, "end_speed": 0.3}))
    assert result.verified
    assert result.t_end == pytest.approx(LENGTH / 0.3, rel=1e-9)
    begun = task({"speed": 0.3, "s": [0.0, 0.5]}, {"start_speed": 0.3})
    result = brachis.plan(begun)
    assert result.verified
    least = 0.5 * LENGTH / 0.3 + leg(0.5 * LENGTH, 0.3)
    assert result.t_end == pytest.approx(least, rel=0.02)


def test_a_part_soon_after_the_start():
    result = brachis.plan(task({"speed": 0.3, "s": [0.02, 0.5]}))
    assert result.verified
    ways = leg(0.02 * LENGTH, 0.3) + leg(0.5 * LENGTH, 0.3)
    assert result.t_end == pytest.approx(ways + 0.48 * LENGTH / 0.3, rel=0.02)


@pytest.mark.parametrize("speed", [0.02, 0.3])
def test_a_segment_has_a_speed_but_for_its_leads(speed):
    """By differences of Pinocchio's positions, between an approach and a stop, and behind it."""
    seam = {"line": {"by": [0.3, 0.0]}, "speed": speed}
    content = task()
    content["path"] = [
        {"line": {"by": [0.0, 0.1]}, "blend": 0.02},
        {**seam, "stop": True},
        seam,
    ]
    result = brachis.plan(content)
    assert result.verified
    assert result.trajectory.task.path[1].speed == speed
    t = np.linspace(0.0, result.t_end, 20_001)
    q = result.trajectory.position(t)
    places, _ = result.trajectory.robot.tool_placements(q)
    speeds = np.linalg.norm(np.gradient(places, t, axis=0), axis=1)
    begin = places[0, 0]
    x = places[:, 0] - begin
    lead = 0.1 * speed
    is_held = (x > 0.02) & (x < 0.3 - lead)
    is_held |= (x > 0.3 + lead) & (x < 0.6 - lead)
    step = 2.0 * np.diff(t)[0]
    is_held &= np.roll(is_held, 3) & np.roll(is_held, -3)
    assert_allclose(speeds[is_held], speed, rtol=1e-6)
    is_behind = (x > 0.021) & (x < 0.599)
    assert speeds[is_behind].max() < speed * (1.0 + 1e-3), "faster in a lead"
    assert is_held.sum() * step > 0.5 * 0.5 / speed
    (check,) = (c for c in result.verification.checks if c.name == "process speed")
    assert check.passed


def test_a_closed_motion_with_mean_torques_meets_its_own_beginning():
    result = brachis.plan(
        {
            "brachis": 1,
            "robot": {
                "urdf": str(ROOT / "robots/scara3/robot.urdf"),
                "gravity": [0.0, 0.0, 0.0],
                "limits": {"torque": 10.0, "velocity": None, "rms_torque": 5.0},
            },
            "start": "free",
            "path_start": [1.7, 0.0],
            "task_space": ["x", "y"],
            "path": [{"circle": {"center": [1.4, 0.0]}}],
            "boundary": {"periodic": True},
            "tool_limits": {"process_speed": {"speed": 0.4, "s": [0.2, 0.5]}},
            "spline": {"intervals": 10},
            "search": QUICK,
        }
    )
    assert result.verified, str(result.verification)
    t = np.linspace(0.0, result.t_end, 20_001)
    motion = result.trajectory.at(t)
    robot = result.trajectory.robot
    torque = dynamics.torque(robot, motion.q, motion.qdot, motion.qddot)
    mean = np.sqrt(np.trapezoid(torque**2, t, axis=0) / result.t_end)
    assert 4.99 < mean.max() < 5.001
    for own in (motion.q, motion.qdot, motion.qddot):
        assert_allclose(own[-1], own[0], atol=1e-9 * np.abs(own).max())


@pytest.mark.parametrize("factor", [1.0, 1.1])
def test_a_recorded_motion_is_checked_on_the_part_alone(factor, tmp_path):
    result = brachis.plan(task(PART, rest="full"))
    file = tmp_path / "motion.csv"
    brachis.export.write(result.trajectory, file, dt=0.002)
    asked = task({**PART, "speed": factor * SPEED})
    found = brachis.import_motion(file, task=asked)
    verification = brachis.verify_trajectory(found)
    checks = {check.name: check for check in verification.checks}
    assert checks["process speed"].value == pytest.approx(
        abs(1.0 / factor - 1.0), abs=1e-6
    )
    assert checks["process speed"].passed == (factor == 1.0)
    assert "s where process speeds begin and end" not in checks
