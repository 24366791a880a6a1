"""The timing gap of plans: never much below zero, whatever limits there are, and small with ``intervals: auto``."""

import dataclasses

import pytest
import yaml

import brachis
from brachis.limits import limits_of
from brachis.timing import TimingGap, find_timing_gap
from support.effort import QUICK

LIMITS = yaml.safe_load("""
torque: {}
friction: {friction: {viscous: 0.5, coulomb: 0.3}}
power: {limits: {torque: 10, power: 15}}
total power: {limits: {torque: 10, total_power: 20}}
acceleration: {limits: {torque: 10, acceleration: 6}}
tool speed: {tool_limits: {speed: 0.6}}
tool acceleration: {tool_limits: {acceleration: 1.5}}
torque at speed: {limits: {torque: 10, torque_speed: {j2: [[0, 10], [2, 4]]}}}
""")


def plan(**keywords):
    return brachis.plan(
        brachis.examples.scara_line, redundant_joints=["j1"], **keywords, **QUICK
    )


@pytest.mark.parametrize("kind", LIMITS)
def test_every_limit_is_known_to_the_phase_plane(kind):
    result = plan(intervals="auto", rest="velocity", **LIMITS[kind])
    assert result.verified
    gap = result.timing_gap
    assert gap.left_out == ()
    assert -1e-3 < gap.gap < 3e-3
    assert gap.t_end == result.trajectory.t_end
    assert not [each for each in result.warnings if each.where == "spline.intervals"]


def test_a_slow_plan_says_where_and_what_would_do():
    result = plan(intervals=8)
    (issue,) = result.warnings
    assert issue.where == "spline.intervals"
    assert "spline.intervals: auto" in issue.message
    assert f"{result.timing_gap.least_time:.4g} s" in issue.message
    assert result.to_dict()["timing_gap"]["gap"] == result.timing_gap.gap
    assert "no timing of this joint path is more than" in str(result)


def test_a_motion_with_few_knots_gets_its_own_path_s_fastest_timing(monkeypatch):
    """A mesh that is not refined far enough is retimed."""
    monkeypatch.setattr("brachis.optimise.mesh._MOST_VARIABLES", 40)
    result = plan(intervals="auto")
    assert result.verified
    assert result.candidate.reports[-1].solver == "phase plane"
    assert -1e-3 < result.timing_gap.gap < 1e-3


@pytest.mark.parametrize(
    "part, where",
    [
        ((0.2, 0.31), "mostly at s = 0.2 to 0.31;"),
        ((0.0, 1.0), "along the whole path;"),
    ],
)
def test_the_warning_says_where_time_is_lost(part, where):
    (issue,) = TimingGap(2.0, 1.8, 100, (), part, "think anew").issues()
    assert where in issue.message
    assert issue.message.endswith("think anew")


@pytest.mark.parametrize(
    "intervals, advice",
    [(8, "set spline.intervals: auto"), ("auto", "raise search.time_limit")],
)
def test_automatic_intervals_are_not_advised_where_they_are_set(intervals, advice):
    trajectory = plan(intervals=8).trajectory
    spline = trajectory.task.spline.model_copy(update={"intervals": intervals})
    task = trajectory.task.model_copy(update={"spline": spline})
    motion = dataclasses.replace(trajectory, task=task)
    gap = find_timing_gap(motion, limits_of(motion.robot, task))
    assert advice in gap.advice
    report = brachis.bottleneck.report(motion, solve=False)
    assert advice in str(report)


@pytest.mark.parametrize(
    "through",
    [
        [[0, 0.1, 0], [0, 0.2, 0], [0, 0.1, 0], [0, 1e-4, 0]],
        [[0.05, 0.07, 0], [0.15, 0.21, 0], [0.05, 0.07, 0]],
        [[0, 0, 0.1], [0, 0, -0.05], [0, 0, 0.12]],
    ],
)
def test_a_spline_there_and_back_is_not_promised_a_faster_timing(through):
    """The arm stands where the spline turns round: no grid of the phase plane steps over it."""
    content = yaml.safe_load("""
    brachis: 1
    robot: {urdf: ur10_rail, locked_joints: {rail: 0}, limits: {acceleration: 12}}
    start: {joints: [0, -1.2, 1.6, -0.4, 1.0, 0]}
    task_space: pose
    """)
    path = [{"spline": {"relative": True, "through": through}}]
    result = brachis.plan(content | {"path": path})
    assert result.verified
    assert -1e-3 < result.timing_gap.gap < 3e-3
    assert not result.warnings
