"""What the knots cost, on a gantry whose fastest motion is known, and on the paper's line."""

from __future__ import annotations

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
    assert report.knots.t_end == pytest.approx(FASTEST, rel=2e-3)
    assert report.knots.saved == pytest.approx(1.0 - FASTEST / result.t_end, abs=2e-3)
    assert report.knots.saved > 0.1
    assert re.search(r"the knots cost about \d.* with 10 intervals: ", str(report))
    assert "spline.intervals: auto" in str(report)
    assert report.to_dict()["knots"]["saved"] == report.knots.saved


def test_a_refined_mesh_costs_next_to_nothing():
    result = slow(intervals="auto")
    report = result.bottleneck()
    assert result.t_end == pytest.approx(FASTEST, rel=3e-3)
    assert abs(report.knots.saved) < 3e-3
    assert "the knots cost" not in str(report)


@pytest.mark.parametrize(
    "limits",
    [{"friction": {"viscous": 0.5}}, {"limits": {"torque": 10, "jerk": 100}}],
    ids=str,
)
def test_nothing_is_said_if_the_phase_plane_leaves_out_what_holds_the_motion(limits):
    result = brachis.plan(
        brachis.examples.scara_line,
        redundant_joints=["j1"],
        intervals=10,
        **limits,
        **QUICK,
    )
    report = result.bottleneck()
    assert report.knots is None
    assert report.to_dict()["knots"] is None
    assert "the knots cost" not in str(report)


def test_a_redundant_arm_gains_at_least_that(scara):
    result = scara("j1")
    found = brachis.bottleneck.report(result.trajectory).knots
    finer = brachis.plan(result.task, intervals=80, start_from=result)
    assert found.saved == pytest.approx(1.0 - finer.t_end / result.t_end, abs=0.012)
    assert found.saved > 0.04
