"""Speeds that no motion has are refused with their place, and with what would do."""

import re

import numpy as np
import pytest

import brachis
from brachis.task import task_with

LENGTH = 0.5
FEW = {"intervals": 6, "effort": "single"}


def slide(speed, interval, *further, **changes):
    """A slide of 0.5 m along x with an acceleration of at most 1 m/s^2, with a speed between two path coordinates."""
    limits = {"acceleration": 1.0, "velocity": None, **changes.pop("limits", {})}
    sections = {"intervals": 20, "time_limit": 600.0, **changes}
    return task_with(
        robot={"urdf": "gantry2"},
        gravity=[0, 0, 0],
        limits=limits,
        start=[0.0, 0.0],
        task_space=["x", "y"],
        path=brachis.Line(by=[LENGTH, 0.0]),
        tool_limits={"process_speed": [{"speed": speed, "s": interval}, *further]},
        **sections,
    )


@pytest.fixture(autouse=True)
def trial_time(monkeypatch):
    """Let no trial begin; tests that try something have time."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    monkeypatch.setattr("brachis.search.remedies._TRIALS", 1)


def error_of(task, reason):
    with pytest.raises(brachis.PlanningError, match=reason) as caught:
        brachis.plan(task)
    return caught.value


@pytest.fixture
def no_hurry(monkeypatch):
    """Let a trial take as long as it wants."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 600.0)


def number_in_hint(error, key):
    """Return the number that a hint advises for a key."""
    advice = rf"{re.escape(key)} to ([\d.]+).*? \(a plan with it was verified"
    match = re.search(advice, error.hint)
    assert match, error.hint
    return float(match[1])


def largest_speed_in(error):
    """Return the largest speed that an error names."""
    return float(re.match(r"about ([\d.]+) m/s", error.allowed)[1])


@pytest.mark.usefixtures("no_hurry")
def test_a_run_up_that_is_too_short_is_refused_with_what_would_do():
    """Over the way d the acceleration a leads to sqrt(2 a d)."""
    reason = (
        r"the process speed is too high for the x_axis acceleration limit: the path from s = 0 to 0\.1 is too short to "
        r"get from rest to 0\.5 m/s: that takes about ([\d.]+) m, and it is 0\.05 m long; found 0\.5 m/s"
    )
    error = error_of(slide(0.5, (0.1, 0.6)), reason)
    needed = float(re.search(reason, str(error))[1])
    assert needed == pytest.approx(0.125, rel=0.01)
    possible = np.sqrt(2.0 * 0.1 * LENGTH)
    advised = largest_speed_in(error)
    assert 0.9 * possible < advised <= possible
    assert error.where == "tool_limits.process_speed[0].speed"
    assert number_in_hint(error, error.where) == advised
    assert brachis.plan(slide(advised, (0.1, 0.6))).verified


def test_two_speeds_too_near_to_each_other():
    """Between 0.1 m/s and v are 0.05 m: v^2 = 0.01 + 0.1."""
    reason = r"s = 0\.4 to 0\.5 is too short to get from 0\.1 m/s to 0\.45 m/s"
    second = {"speed": 0.45, "s": [0.5, 0.6]}
    error = error_of(slide(0.1, (0.1, 0.4), second), reason)
    assert error.where == "tool_limits.process_speed[1].speed"
    assert 0.9 * np.sqrt(0.11) < largest_speed_in(error) < np.sqrt(0.11)


class TriedError(Exception):
    """A plan was tried."""


def refuse(*_):
    raise TriedError


def test_of_two_legs_that_are_too_short_the_message_has_the_worse_one():
    """0.05 m are somewhat too short to reach 0.35 m/s, and 0.0005 m are far too short to leave it."""
    reason = r"s = 0\.5 to 0\.501 is too short to get from 0\.35 m/s to 0\.1 m/s"
    error_of(slide(0.35, (0.1, 0.5), {"speed": 0.1, "s": [0.501, 0.6]}), reason)


def test_friction_that_helps_to_brake_is_no_reason_to_refuse(monkeypatch):
    """25 N brake 25 kg from 0.32 m/s in 0.05 m, and with 10 N of friction from 0.37 m/s."""
    monkeypatch.setattr("brachis.search.pipeline.rank_candidate", refuse)
    limits = {"acceleration": None, "torque": 25.0}
    with pytest.raises(TriedError):
        brachis.plan(slide(0.36, (0.5, 0.9), limits=limits, friction={"coulomb": 10.0}))
    reason = r"s = 0\.9 to 1 is too short to get from 0\.36 m/s to rest"
    error_of(slide(0.36, (0.5, 0.9), limits=limits), reason)


def test_a_speed_that_joint_velocities_forbid():
    """The limit itself can be asked for."""
    limits = {"velocity": 0.3}
    reason = r"too high for the x_axis velocity limit at s = 0\.3;"
    error = error_of(slide(0.5, (0.3, 0.6), limits=limits), reason)
    assert largest_speed_in(error) == 0.3
    assert brachis.plan(slide(0.3, (0.3, 0.6), limits=limits)).verified


def test_a_jerk_that_leaves_too_short_a_run_up():
    """The phase plane knows no jerk, so that plans are tried: j t^3 / 6 takes 0.1 m to (j d^2)^(1/3) and less."""
    task = slide(0.4, (0.2, 0.6), limits={"jerk": 2.0}, **FEW)
    reason = r"no motion within the limits was found.*Lower tool_limits.process_speed\[0\].speed"
    error_of(task, reason)


def test_speeds_far_out_of_reach_of_a_redundant_arm_cost_no_plan(monkeypatch):
    monkeypatch.setattr(
        "brachis.search.guesses.screen", lambda *_: pytest.fail("a plan was tried")
    )
    task = task_with(
        robot={"urdf": "tx90l_rail"},
        start=[0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1],
        task_space="pose",
        path=brachis.Line(by=[0, 0.8, 0]),
        effort="single",
    )
    limits = {"process_speed": {"speed": 20.0, "s": [0.3, 0.7]}}
    reason = r"the process speed is too high for the .* found 20 m/s \(0\.02 m/s, if mm/s were meant\); allowed: about"
    error_of(task_with(task, tool_limits=limits), reason)
    reason = r"boundary.start_speed: the start speed is too high for the"
    error_of(task_with(task, start_speed=20.0), reason)


@pytest.mark.usefixtures("no_hurry")
def test_a_speed_at_the_end_that_the_velocity_limit_forbids():
    task = slide(0.2, (0.3, 0.6), limits={"velocity": 0.3}, end_speed=0.9)
    reason = r"the end speed is too high for the x_axis velocity limit at s = 1; found 0.9 m/s"
    error = error_of(task, reason)
    assert error.where == "boundary.end_speed"
    assert number_in_hint(error, error.where) == largest_speed_in(error) == 0.3


def test_two_speeds_that_are_too_high_are_both_in_the_message():
    both = {"start_speed": 0.9, "end_speed": 0.9}
    lower = r"Lower boundary\.start_speed and lower boundary\.end_speed \(by how much"
    error = error_of(slide(0.3, (0.3, 0.6), limits={"velocity": 0.3}, **both), lower)
    assert largest_speed_in(error) == 0.3


def test_a_speed_that_is_slightly_too_high_is_the_reason_after_plans_fail(monkeypatch):
    task = slide(0.305, (0.3, 0.6), limits={"velocity": 0.3}, **FEW)
    with monkeypatch.context() as patch:
        patch.setattr("brachis.search.pipeline.rank_candidate", refuse)
        with pytest.raises(TriedError):
            brachis.plan(task)
    error = error_of(task, r"too high for the x_axis velocity limit")
    assert error.allowed == "about 0.3 m/s"


def test_nothing_is_free_where_the_whole_path_has_a_given_speed():
    allowed, refused = (
        slide(
            speed,
            (0.0, 1.0),
            limits={"velocity": 0.3},
            start_speed=speed,
            end_speed=speed,
        )
        for speed in (0.299, 0.305)
    )
    result = brachis.plan(allowed)
    assert result.verified
    assert result.t_end == pytest.approx(LENGTH / 0.299, rel=1e-9)
    error_of(refused, "too high for the x_axis velocity")
