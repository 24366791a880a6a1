"""The tool's speed, through all of it: task key, plan, refinement, verification, bottleneck, timeline."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

import brachis
from brachis.limits.tool import SpeedProfile
from brachis.task import task_with
from brachis.verify import verify_trajectory
from support.checks import check_of, failed_checks
from support.effort import QUICK

CAP = 1.0


@pytest.fixture(scope="module")
def result():
    line = brachis.examples.tx90l_rail_line
    return brachis.plan(line, tool_limits={"speed": CAP}, **QUICK)


def test_verification_finds_a_tool_that_is_too_fast_by_pinocchios_own_velocity(result):
    check = check_of(result.verification, "tool speed ratio")
    assert (check.subject, check.unit, check.remark) == ("tool", "-", "")
    assert check.value == pytest.approx(1.0, abs=1e-4)
    trajectory = result.trajectory
    tighter = task_with(result.task, tool_limits={"speed": CAP / 1.001})
    verification = verify_trajectory(dataclasses.replace(trajectory, task=tighter))
    assert failed_checks(verification) == ["tool speed ratio"]
    check = check_of(verification, "tool speed ratio")
    assert check.value == pytest.approx(1.001, abs=1e-4)
    robot, state = trajectory.robot, trajectory.at(check.time)
    data, axes = robot.model.createData(), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    pin.forwardKinematics(robot.model, data, state.q[0], state.qdot[0])
    twist = pin.getFrameVelocity(robot.model, data, robot.frame_id, axes)
    speed = np.linalg.norm(twist.linear)
    assert speed * 1.001 / CAP == pytest.approx(check.value, rel=1e-9)


def speeds(trajectory, count=5_000):
    """Speed of the tool by differences of its position over the saved motion, m/s."""
    t = np.linspace(0.0, trajectory.t_end, count)
    positions, _ = trajectory.robot.tool_placements(trajectory.at(t).q)
    return np.linalg.norm(np.diff(positions, axis=0), axis=1) / np.diff(t)


@pytest.mark.parametrize("rows", [["x", "y"], ["x"]])
def test_rows_that_leave_a_direction_free_count_the_whole_speed(rows):
    """With only x prescribed the tool may move along y; the cap is on its speed in space."""
    result = brachis.plan(
        "scara3",
        gravity=[0, 0, 0],
        limits={"torque": 10, "velocity": None},
        start=[0.5, -2.0, 2.0],
        task_space=rows,
        path=brachis.Line(by=[-0.5, 0.3][: len(rows)]),
        tool_limits={"speed": 0.4},
        intervals=20,
        **QUICK,
    )
    assert result.verified
    assert speeds(result.trajectory).max() <= 0.4 * (1.0 + 1e-4)


def test_steps_become_ramps_on_their_faster_side():
    table = SpeedProfile(
        [0.0, 0.4, 0.4, 0.401, 0.401, 1.0], [1.0, 1.0, 3.0, 3.0, 2.0, 2.0]
    )
    s = np.linspace(0.0, 1.0, 100_001)
    given = np.where(s <= 0.4, 1.0, np.where(s < 0.401, 3.0, 2.0))
    found, slope = table.at(s)
    assert np.all(found <= given + 1e-12)
    assert np.mean(found < given - 1e-12) < 0.01
    inside = np.abs(s[:, None] - table.places).min(axis=1) > 2e-5
    np.testing.assert_allclose(
        slope[inside], np.gradient(found, s)[inside], atol=1e-6 * np.abs(slope).max()
    )
    assert table.at(np.array([np.nan]))[0][0] == np.inf
    flat = SpeedProfile(np.linspace(0.0, 1.0, 10_001), np.full(10_001, 0.7))
    assert len(flat.places) == 2
