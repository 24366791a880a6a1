"""Least times along fixed joint paths, against formulas."""

from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.limits.joint import AccelerationLimit, TorqueLimit, VelocityLimit
from brachis.problem.problem import Problem
from brachis.search import phase_plane
from brachis.search.stations import spread_stations
from brachis.task import task_with
from brachis.timing import JointPath, PhasePlane

GANTRY = Path(__file__).parents[2] / "robots/gantry2/robot.urdf"
S = np.linspace(0.0, 1.0, 201)


def gantry(**limits):
    spec = {"torque": None, "velocity": None, "acceleration": None} | limits
    return brachis.Robot.from_urdf(
        GANTRY, gravity=[0, 0, 0], limits=brachis.LimitSpec(**spec)
    )


def least_time(robot, s, q):
    built = (
        build(robot, None)
        for build in (TorqueLimit.build, VelocityLimit.build, AccelerationLimit.build)
    )
    limits = [limit for limit in built if limit is not None]
    timing = PhasePlane(limits, JointPath.through(s, q)).solve()
    return np.inf if timing is None else timing.t_end


def joint_path(distance):
    return np.column_stack([distance * S, np.zeros_like(S)])


LENGTH = 0.5
FORCE = 20.0


def slide(content, **limits):
    """A task on one slide, and its joint path, (S,) and (S, n)."""
    line = {"path": brachis.Line(by=[LENGTH, 0.0]), **content}
    task = task_with(task_space=["x", "y"], start=[0.0, 0.0], **line)
    problem = Problem.of(gantry(**limits), task)
    s = spread_stations(problem)
    return problem, s, np.column_stack([LENGTH * s, np.zeros_like(s)])


def with_stop(dwell):
    first = brachis.Line(by=[0.4 * LENGTH, 0.0], stop=True, dwell=dwell)
    return {"path": first + brachis.Line(by=[0.6 * LENGTH, 0.0])}


def acceleration_of(force):
    return force / gantry(torque=force).chain.mass_matrices(np.zeros((1, 2)))[0, 0, 0]


def way_beside(distance, speed, acceleration):
    """Least time over a distance from rest to a speed, or from it to rest: as fast as can be, then at the speed."""
    peak = np.sqrt(acceleration * distance + 0.5 * speed**2)
    return (2.0 * peak - speed) / acceleration


@pytest.mark.parametrize("dwell", [0.0, 0.3])
def test_a_stop_and_a_dwell(dwell):
    problem, s, q = slide(with_stop(dwell), torque=FORCE)
    a = acceleration_of(FORCE)
    parts = [2.0 * np.sqrt(share * LENGTH / a) for share in (0.4, 0.6)]
    expected = sum(parts) + dwell
    assert phase_plane.least_time(problem, s, q) == pytest.approx(expected, rel=1e-6)
    without, s, q = slide({}, torque=FORCE)
    assert phase_plane.least_time(without, s, q) < expected - dwell - 0.1


def test_a_given_speed_with_its_run_up_and_run_out():
    speed = 0.2
    content = {"tool_limits": {"process_speed": {"speed": speed, "s": [0.2, 0.6]}}}
    problem, s, q = slide(content, torque=FORCE)
    a = acceleration_of(FORCE)
    times = [times[-1] for _, times in phase_plane.fastest_times(problem, s, q)]
    expected = [
        way_beside(0.2 * LENGTH, speed, a),
        0.4 * LENGTH / speed,
        way_beside(0.4 * LENGTH, speed, a),
    ]
    np.testing.assert_allclose(times, expected, rtol=1e-6)
    assert phase_plane.least_time(problem, s, q) == pytest.approx(sum(expected))


@pytest.mark.parametrize("velocity, is_possible", [(0.2, True), (0.19, False)])
def test_a_given_speed_that_the_limits_do_not_allow(velocity, is_possible):
    content = {"tool_limits": {"process_speed": {"speed": 0.2, "s": [0.2, 0.6]}}}
    problem, s, q = slide(content, acceleration=3.0, velocity=velocity)
    times = phase_plane.fastest_times(problem, s, q)
    assert [part is not None for part in times] == [is_possible] * 3
    assert np.isfinite(phase_plane.least_time(problem, s, q)) == is_possible


def test_how_much_faster_a_motion_may_be():
    """Where it accelerates by a third of the limit, 3 ** 0.5; where it is at half its velocity limit, twice."""
    robot = gantry(acceleration=3.0, velocity=1.0)
    limits = [VelocityLimit.build(robot, None), AccelerationLimit.build(robot, None)]
    plane = PhasePlane(limits, JointPath.through(S, joint_path(0.4)))
    speed, place, label = plane.speed_factor(
        np.where(S < 0.7, 1.0, 0.5 / 0.4), np.zeros_like(S)
    )
    assert (speed, label) == (pytest.approx(2.0), "x_axis velocity")
    assert place == pytest.approx(0.7, abs=0.01)
    factor, place, label = plane.speed_factor(
        np.ones_like(S), np.where(S > 0.3, -1.0 / 0.4, 0.0)
    )
    assert (factor, label) == (pytest.approx(np.sqrt(3.0)), "x_axis acceleration")
    assert place == pytest.approx(0.3, abs=0.01)


def test_the_limit_that_holds_a_motion_back():
    robot = gantry(acceleration=3.0, velocity=0.4)
    limits = [VelocityLimit.build(robot, None), AccelerationLimit.build(robot, None)]
    for distance, label in ((0.05, "acceleration"), (2.0, "velocity")):
        plane = PhasePlane(limits, JointPath.through(S, joint_path(distance)))
        rate = plane.fastest((0.0, 0.0))
        assert plane.active_limit(rate) == f"x_axis {label}"
        assert plane.largest_rate(0)[0] == pytest.approx(0.4 / distance)
