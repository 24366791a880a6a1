"""A given speed of the tool over parts of the path: known optima of a gantry, with the speed met exactly."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.robot import dynamics
from brachis.task import task_with
from brachis.trajectory import phase_rows
from support.checks import check_of
from support.effort import QUICK

SPEED, BEGIN, END, LENGTH = 1.0, 0.25, 0.75, 1.2
ACCELERATION = 200.0 / 25.0
"""Of the gantry's bridge and tool."""


def plan(part=None, **changes):
    line = {
        "limits": {"velocity": None},
        "start": [-0.6, 0.0],
        "task_space": ["x", "y"],
        "path": brachis.Line(by=[LENGTH, 0.0]),
        "tool_limits": {"process_speed": part or []},
        "intervals": 20,
        "rest": "velocity",
    }
    return brachis.plan("gantry2", **{**line, **QUICK, **changes})


PART = {"speed": SPEED, "s": [BEGIN, END]}


def leg(way, speed):
    """Least time between rest and a speed over a way, by full force either way."""
    top = np.sqrt(ACCELERATION * way + 0.5 * speed**2)
    return float((2.0 * top - speed) / ACCELERATION)


def fastest(speed):
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
    free, result = plan(), plan(PART)
    s, speed = speeds_along(free.trajectory)
    # Without it the tool is much faster.
    assert speed[(s > BEGIN) & (s < END)].min() > 2.0 * SPEED
    assert result.verified
    assert result.t_end > 1.2 * free.t_end
    s, speed = speeds_along(result.trajectory)
    inside = (s > BEGIN + 1e-3) & (s < END - 1e-3)
    assert_allclose(speed[inside], SPEED, rtol=1e-8)
    # On the way to it the tool is as fast as it can.
    assert speed[s < 0.9 * BEGIN].max() > 1.4 * SPEED
    assert fastest(SPEED) <= result.t_end < 1.05 * fastest(SPEED)


@pytest.mark.parametrize("speed", [1.0, 0.1])
def test_with_enough_knots_it_is_the_optimum(speed):
    spline = {"intervals": "auto", "tolerance": 5e-4, "rest": "velocity"}
    result = plan({**PART, "speed": speed}, spline=spline, intervals="auto")
    assert result.verified
    assert result.t_end == pytest.approx(fastest(speed), rel=1e-3)


def test_a_part_may_begin_and_end_with_a_path_that_is_passed_at_its_speed():
    ends = {"start_speed": 0.3, "end_speed": 0.3}
    result = plan({"speed": 0.3, "s": [0.0, 1.0]}, **ends)
    assert result.verified
    assert result.t_end == pytest.approx(LENGTH / 0.3, rel=1e-9)
    result = plan({"speed": 0.3, "s": [0.0, 0.5]}, start_speed=0.3)
    assert result.verified
    least = 0.5 * LENGTH / 0.3 + leg(0.5 * LENGTH, 0.3)
    assert result.t_end == pytest.approx(least, rel=0.02)


def test_a_part_soon_after_the_start():
    result = plan({"speed": 0.3, "s": [0.02, 0.5]})
    assert result.verified
    ways = leg(0.02 * LENGTH, 0.3) + leg(0.5 * LENGTH, 0.3)
    assert result.t_end == pytest.approx(ways + 0.48 * LENGTH / 0.3, rel=0.02)


@pytest.mark.parametrize("speed", [0.02, 0.3])
def test_a_segment_has_a_speed_but_for_its_leads(speed):
    """By differences of Pinocchio's positions, between an approach and a stop, and behind it."""
    approach = {"line": {"by": [0.0, 0.1]}, "blend": 0.02}
    seam = {"line": {"by": [0.3, 0.0]}, "speed": speed}
    result = plan(path=[approach, {**seam, "stop": True}, seam])
    assert result.verified
    assert result.trajectory.task.path[1].speed == speed
    t = np.linspace(0.0, result.t_end, 20_001)
    q = result.trajectory.position(t)
    places, _ = result.trajectory.robot.tool_placements(q)
    speeds = np.linalg.norm(np.gradient(places, t, axis=0), axis=1)
    x = places[:, 0] - places[0, 0]
    lead = 0.1 * speed
    is_held = (x > 0.02) & (x < 0.3 - lead)
    is_held |= (x > 0.3 + lead) & (x < 0.6 - lead)
    is_held &= np.roll(is_held, 3) & np.roll(is_held, -3)
    assert_allclose(speeds[is_held], speed, rtol=1e-6)
    is_behind = (x > 0.021) & (x < 0.599)
    assert speeds[is_behind].max() < speed * (1.0 + 1e-3), "faster in a lead"
    assert is_held.sum() * 2.0 * t[1] > 0.5 * 0.5 / speed
    assert check_of(result.verification, "process speed").passed
    texts = [row[-1] for row in phase_rows(result.trajectory.phases)]
    held = 300.0 - 200.0 * speed
    assert any(f"{speed} m/s on {held:.4g} of 300 mm" in text for text in texts)


def test_a_closed_motion_with_mean_torques_meets_its_own_beginning():
    result = brachis.plan(
        "scara3",
        gravity=[0.0, 0.0, 0.0],
        limits={"torque": 10.0, "velocity": None, "rms_torque": 5.0},
        start="free",
        path_start=[1.7, 0.0],
        task_space=["x", "y"],
        path=brachis.Circle([1.4, 0.0]),
        periodic=True,
        tool_limits={"process_speed": {"speed": 0.4, "s": [0.2, 0.5]}},
        intervals=10,
        **QUICK,
    )
    assert result.verified, str(result.verification)
    motion = result.trajectory.at(np.linspace(0.0, result.t_end, 20_001))
    robot = result.trajectory.robot
    torque = dynamics.torque(robot, motion.q, motion.qdot, motion.qddot)
    mean = np.sqrt(np.trapezoid(torque**2, motion.t, axis=0) / result.t_end)
    assert 4.99 < mean.max() < 5.001
    for curves in (motion.q, motion.qdot, motion.qddot):
        size = np.abs(curves).max()
        assert_allclose(curves[-1], curves[0], atol=1e-9 * size)


@pytest.mark.parametrize("factor", [1.0, 1.1])
def test_a_recorded_motion_is_checked_on_the_part_alone(factor, tmp_path):
    result = plan(PART, rest="full")
    file = tmp_path / "motion.csv"
    brachis.export.write(result.trajectory, file, dt=0.002)
    limits = {"process_speed": {**PART, "speed": factor * SPEED}}
    task = task_with(result.task, tool_limits=limits, rest="velocity")
    verification = brachis.verify_trajectory(brachis.import_motion(file, task=task))
    check = check_of(verification, "process speed")
    assert check.value == pytest.approx(abs(1.0 / factor - 1.0), abs=1e-6)
    assert check.passed == (factor == 1.0)
    names = [check.name for check in verification.checks]
    assert "s where process speeds begin and end" not in names
