"""What the timing costs, on a gantry whose fastest motion is known, and on the paper's line."""

import re

import pytest

import brachis
from support.effort import QUICK

LENGTH, SPEED, ACCELERATION = 0.5, 0.1, 2.0  # m, m/s, m/s^2
FASTEST = LENGTH / SPEED + SPEED / ACCELERATION


def slow(**keywords):
    """Plan a line at a low tool speed: the knots of few intervals leave long ways to it."""
    task = {
        "path": brachis.Line(by=[LENGTH, 0.0]),
        "start": [0.0, 0.0],
        "task_space": ["x", "y"],
        "tool_limits": {"speed": SPEED},
        "limits": {"acceleration": ACCELERATION},
        **QUICK,
    }
    return brachis.plan("gantry2", **{**task, **keywords})


def test_few_intervals_cost_what_the_fastest_motion_saves():
    result = slow(intervals=10)
    report = result.bottleneck()
    assert report.timing.least_time == pytest.approx(FASTEST, rel=1e-5)
    assert report.timing.gap == pytest.approx(result.t_end / FASTEST - 1.0, abs=1e-5)
    assert report.timing.gap > 0.1
    assert re.search(r"the timing costs about \d", str(report))
    assert "spline.intervals: auto" in str(report)
    assert report.to_dict()["timing_gap"]["gap"] == report.timing.gap


def test_a_refined_mesh_costs_next_to_nothing():
    result = slow(intervals="auto")
    report = result.bottleneck()
    assert result.t_end == pytest.approx(FASTEST, rel=3e-3)
    assert 0.0 < report.timing.gap < 3e-3
    assert "the timing costs" not in str(report)


def test_friction_is_part_of_the_least_time():
    result = brachis.plan(
        brachis.examples.scara_line,
        redundant_joints=["j1"],
        intervals="auto",
        rest="velocity",
        friction={"viscous": 0.5, "coulomb": 0.3},
        **QUICK,
    )
    assert result.verified
    assert -1e-3 < result.timing_gap.gap < 3e-3


def test_without_the_limit_on_jerk_the_least_time_is_a_bound():
    result = brachis.plan(
        brachis.examples.scara_line,
        redundant_joints=["j1"],
        intervals=10,
        limits={"torque": 10, "jerk": 100},
        **QUICK,
    )
    report = result.bottleneck()
    assert report.timing.left_out == ("jerk",)
    assert report.timing.gap > 0.0
    assert "even without the limit on jerk" in str(result.timing_gap)
    assert "the timing costs" not in str(report)
    assert not result.warnings


def test_a_redundant_arm_gains_at_least_that(scara):
    result = scara("j1")
    found = brachis.bottleneck.report(result.trajectory).timing
    finer = brachis.plan(result.task, intervals=80, start_from=result)
    assert found.gap == pytest.approx(result.t_end / finer.t_end - 1.0, abs=0.012)
    assert found.gap > 0.04
    assert any("spline.intervals" in str(issue) for issue in result.warnings)
