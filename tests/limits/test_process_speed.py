"""A constant speed of the tool over a part of the path: task, plan, start, knots, verification; tables of speed."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.errors import InputError, TaskError
from brachis.limits.process_speed import largest_acceleration
from brachis.limits.tool import SpeedTable
from brachis.robot import dynamics, task_map_of
from brachis.task import LimitSpec
from brachis.verify import verify_trajectory
from support.chains import planar_robot
from support.effort import QUICK

ROOT = Path(__file__).parents[2]
SPEED, BEGIN, END, LENGTH = 1.0, 0.25, 0.75, 1.2
ACCELERATION = 200.0 / 25.0
"""Of the gantry's bridge and tool."""


def task(part=None, *, speed=None, **spline):
    return {
        "brachis": 1,
        "robot": {
            "urdf": str(ROOT / "robots/gantry2/robot.urdf"),
            "limits": {"velocity": None},
        },
        "start": {"joints": [-0.6, 0.0]},
        "task_space": ["x", "y"],
        "path": [{"line": {"by": [LENGTH, 0.0]}}],
        "tool_limits": {"speed": speed, "process_speed": part or []},
        "spline": {"intervals": 20, "rest": "velocity", **spline},
        "search": QUICK,
    }


PART = {"speed": SPEED, "s": [BEGIN, END]}


@pytest.fixture(scope="module")
def result():
    return brachis.plan(task(PART))


def leg(way: float, speed: float) -> float:
    """Least time between rest and a speed over a way, by full force either way."""
    top = np.sqrt(ACCELERATION * way + 0.5 * speed**2)
    return float((2.0 * top - speed) / ACCELERATION)


def sampled(trajectory):
    """s and the tool's speed by differences, at 20,000 times."""
    t = np.linspace(0.0, trajectory.t_end, 20_001)
    motion = trajectory.at(t)
    positions, _ = trajectory.robot.tool_placements(motion.q)
    return motion.s, np.linalg.norm(np.gradient(positions, t, axis=0), axis=1)


def test_the_speed_is_constant_within_its_tolerance_and_reached_and_left_fast(result):
    free = brachis.plan(task())
    s, speed = sampled(free.trajectory)
    assert speed[(s > BEGIN) & (s < END)].min() > 2.0 * SPEED, (
        "without it the tool is much faster"
    )
    assert result.verified
    assert result.t_end > 1.2 * free.t_end
    s, speed = sampled(result.trajectory)
    inside = (s > BEGIN) & (s < END)
    assert np.abs(speed[inside] / SPEED - 1.0).max() <= 0.01 * 1.01
    assert speed[s < 0.9 * BEGIN].max() > 1.4 * SPEED, (
        "on the way to it the tool is as fast as it can"
    )
    fastest = leg(BEGIN * LENGTH, 1.01 * SPEED) + leg(
        (1.0 - END) * LENGTH, 1.01 * SPEED
    )
    fastest += (END - BEGIN) * LENGTH / (1.01 * SPEED)
    assert fastest <= result.t_end < 1.1 * fastest


@pytest.mark.parametrize("speed", [1.0, 0.3, 0.1])
def test_with_enough_knots_it_is_the_optimum(speed):
    fastest = leg(BEGIN * LENGTH, 1.01 * speed) + leg(
        (1.0 - END) * LENGTH, 1.01 * speed
    )
    fastest += (END - BEGIN) * LENGTH / (1.01 * speed)
    result = brachis.plan(
        task({**PART, "speed": speed}, intervals="auto", tolerance=5e-4)
    )
    assert result.verified
    assert result.t_end == pytest.approx(fastest, rel=1e-3)


def test_a_part_may_begin_and_end_with_a_path_that_is_passed_at_its_speed():
    whole = {"speed": 0.3, "s": [0.0, 1.0]}
    for given, key, found in (
        ({}, "s[0]", "0 m/s"),
        ({"start_speed": 0.3}, "s[1]", "0 m/s"),
        ({"start_speed": 0.3, "end_speed": 0.31}, "s[1]", "0.31 m/s"),
    ):
        with pytest.raises(InputError) as caught:
            brachis.plan({**task(whole), "boundary": given})
        assert f"tool_limits.process_speed[0].{key}" in str(caught.value)
        assert found in str(caught.value)
        assert "0.297 to 0.303 m/s" in str(caught.value)
    result = brachis.plan(
        {**task(whole), "boundary": {"start_speed": 0.3, "end_speed": 0.3}}
    )
    assert result.verified
    assert LENGTH / 0.303 <= result.t_end < LENGTH / 0.3
    begun = {**task({"speed": 0.3, "s": [0.0, 0.5]}), "boundary": {"start_speed": 0.3}}
    result = brachis.plan(begun)
    assert result.verified
    assert result.t_end == pytest.approx(
        0.5 * LENGTH / 0.303 + leg(0.5 * LENGTH, 0.303), rel=0.02
    )


def test_the_largest_acceleration_bounds_that_of_every_torque():
    q = np.array([0.4, -0.8, 0.3])
    robot = planar_robot("RRP")
    tool = task_map_of(robot, "position")
    jacobian = tool.jacobian(tool.twists(q[None]))[0]
    mass = dynamics.mass_matrices(robot, q[None])[0]
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    by_torque = jacobian @ np.linalg.solve(
        mass, (robot.limits.torque_upper * corners).T
    )
    for limits, found in (
        (LimitSpec(), by_torque),
        (LimitSpec(acceleration=0.1), 0.1 * jacobian @ corners.T),
    ):
        most = np.linalg.norm(found, axis=0).max()
        assert (
            most
            <= largest_acceleration(planar_robot("RRP", limits=limits), q)
            <= np.sqrt(3.0) * most
        )


def test_verification_looks_at_both_sides(result):
    for factor, side in (
        (1.03, "least process speed ratio"),
        (0.98, "process speed ratio"),
    ):
        part = result.task.tool_limits.process_speed[0].model_copy(
            update={"speed": factor * SPEED}
        )
        tool = result.task.tool_limits.model_copy(update={"process_speed": (part,)})
        other = result.task.model_copy(update={"tool_limits": tool})
        verification = verify_trajectory(
            dataclasses.replace(result.trajectory, task=other)
        )
        failed = [each for each in verification.checks if not each.passed]
        assert [each.name for each in failed] == [side]
        assert failed[0].subject == "tool"
        assert failed[0].value > 1.005


def test_its_tolerance_costs_what_is_said(result):
    report = brachis.bottleneck.report(result, check=True)
    (entry,) = [
        each
        for each in report.check.entries
        if str(each.sensitivity.label) == "tool process speed"
    ]
    assert entry.sensitivity.bound.side == "upper"
    assert entry.re_solved == pytest.approx(entry.predicted, rel=0.05)
    assert entry.re_solved < -2e-5
    assert "more tolerance above the process speed" in str(report)


def test_a_part_soon_after_the_start_is_reached_over_few_knots():
    """Uniform intervals would be longer than the time to reach the speed."""
    result = brachis.plan(task({"speed": 0.3, "s": [0.02, 0.5]}))
    assert result.verified
    lengths = np.diff(np.unique(result.trajectory.knots))
    assert lengths[0] < 0.3 * lengths.max()


def test_two_parts_with_tolerances_of_their_own():
    parts = [
        {"speed": 0.5, "s": [0.2, 0.35], "tolerance": "2 %"},
        {"speed": 0.8, "s": [0.6, 0.8], "tolerance": 0.05},
    ]
    result = brachis.plan(task(parts))
    assert result.verified
    s, speed = sampled(result.trajectory)
    for part, tolerance in zip(parts, (0.02, 0.05), strict=True):
        begin, end = part["s"]
        inside = (s > begin) & (s < end)
        assert np.abs(speed[inside] / part["speed"] - 1.0).max() <= 1.01 * tolerance


@pytest.mark.parametrize(
    ("tool", "where", "said"),
    [
        (
            {"process_speed": {"speed": 0.1, "s": [0.6, 0.3]}},
            "process_speed[0].s",
            "begin < end",
        ),
        (
            {"process_speed": {"speed": 0.1, "s": [-0.1, 0.3]}},
            "process_speed[0].s[0]",
            ">= 0",
        ),
        (
            {"process_speed": {"speed": 0.1, "s": [0.1, 0.3], "tolerance": 1e-5}},
            "process_speed[0].tolerance",
            "0.001",
        ),
        (
            {"process_speed": [PART, {"speed": 0.1, "s": [0.6, 0.9]}]},
            "process_speed[1].s",
            "begin above 0.75",
        ),
        (
            {"process_speed": PART, "speed": 0.5},
            "process_speed[0].speed",
            "at most 0.5 m/s",
        ),
        (
            {
                "process_speed": PART,
                "speed": {"s": [0.2, 0.4, 0.5], "speed": [2.0, 1.0, 0.2]},
            },
            "process_speed[0].speed",
            "at most 0.2 m/s",
        ),
        ({"speed": {"s": [0.0, 0.5], "speed": [1.0]}}, "tool_limits.speed.speed", "2"),
        (
            {"speed": {"s": [0.5, 0.2], "speed": [1.0, 1.0]}},
            "tool_limits.speed.s[1]",
            ">= 0.5",
        ),
        (
            {"speed": {"s": [0.5, 0.5, 0.5], "speed": [1.0, 2.0, 1.0]}},
            "tool_limits.speed.s",
            "a step",
        ),
        (
            {"speed": {"s": [0.5, 1.5], "speed": [1.0, 1.0]}},
            "tool_limits.speed.s[1]",
            "1",
        ),
        ({"acceleration": 0.0}, "tool_limits.acceleration", "1e-06"),
        ({"angular_speed": "fast"}, "tool_limits.angular_speed", "number"),
    ],
)
def test_what_makes_no_limit_is_refused_with_its_key(tool, where, said):
    with pytest.raises(TaskError) as caught:
        brachis.load_task({**task(), "tool_limits": tool})
    assert where in str(caught.value)
    assert said in str(caught.value)


def test_a_table_may_come_as_arrays_and_is_saved():
    given = {"s": np.linspace(0.0, 1.0, 3), "speed": np.array([1.0, 0.5, 1.0])}
    loaded = brachis.load_task({**task(), "tool_limits": {"speed": given}})
    assert loaded.tool_limits.speed.speed == (1.0, 0.5, 1.0)
    assert brachis.load_task(loaded.to_dict()) == loaded


def test_steps_become_ramps_on_their_faster_side():
    table = SpeedTable(
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
    flat = SpeedTable(np.linspace(0.0, 1.0, 10_001), np.full(10_001, 0.7))
    assert len(flat.places) == 2
