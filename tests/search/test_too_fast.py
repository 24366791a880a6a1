"""Speeds that no motion has are refused with their place, and with what would do."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import brachis

GANTRY = Path(__file__).parents[2] / "robots/gantry2/robot.urdf"
RAIL = Path(__file__).parents[2] / "robots/tx90l_rail/robot.urdf"
LENGTH = 0.5


def slide(speed: float, part: tuple[float, float], **changes: object) -> dict:
    """A slide of 0.5 m along x with an acceleration of at most 1 m/s^2."""
    limits = {"acceleration": 1.0, "velocity": None, **changes.pop("limits", {})}
    return {
        "brachis": 1,
        "robot": {
            "urdf": str(GANTRY),
            "gravity": [0, 0, 0],
            "limits": limits,
            "friction": changes.pop("friction", {}),
        },
        "start": {"joints": [0.0, 0.0]},
        "task_space": ["x", "y"],
        "path": [{"line": {"by": [LENGTH, 0.0]}}],
        "spline": {"intervals": 20},
        "search": {"time_limit": 600.0},
        "tool_limits": {
            "process_speed": [
                {"speed": speed, "s": part},
                *changes.pop("parts", []),
            ]
        },
        **changes,
    }


@pytest.fixture
def no_hurry(monkeypatch):
    """Let trials take as long as they want."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 600.0)


def number_in_hint(error: brachis.BrachisError, key: str) -> float:
    """Return the number that a hint advises for a key."""
    found = re.search(
        rf"{re.escape(key)} to ([\d.]+).*? \(a plan with it was verified", error.hint
    )
    assert found, error.hint
    return float(found[1])


def largest_speed_in(error: brachis.BrachisError) -> float:
    """Return the largest speed that an error names."""
    return float(re.match(r"no more than ([\d.]+) m/s", error.allowed)[1])


@pytest.mark.usefixtures("no_hurry")
def test_a_run_up_that_is_too_short_is_refused_with_what_would_do(monkeypatch):
    """Over the way d the acceleration a leads to sqrt(2 a d)."""
    monkeypatch.setattr("brachis.search.remedies._TRIALS", 1)
    reason = (
        r"the process speed is too high for the x_axis acceleration limit: the path from s = 0 to 0\.1 is too short to "
        r"get from rest to 0\.5 m/s: that takes about ([\d.]+) m, and it is 0\.05 m long; found 0\.5 m/s"
    )
    with pytest.raises(brachis.PlanningError, match=reason) as caught:
        brachis.plan(slide(0.5, (0.1, 0.6)))
    needed = float(re.search(reason, str(caught.value))[1])
    assert needed == pytest.approx(0.125, rel=0.01)
    possible = np.sqrt(2.0 * 0.1 * LENGTH)
    most = largest_speed_in(caught.value)
    assert 0.9 * possible < most <= possible
    assert caught.value.where == "tool_limits.process_speed[0].speed"
    assert number_in_hint(caught.value, "tool_limits.process_speed[0].speed") == most
    assert brachis.plan(slide(most, (0.1, 0.6))).verified


def test_two_speeds_too_near_to_each_other(monkeypatch):
    """Between 0.1 m/s and v are 0.05 m: v^2 = 0.01 + 0.1."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    with pytest.raises(
        brachis.PlanningError,
        match=r"s = 0\.4 to 0\.5 is too short to get from 0\.1 m/s to 0\.45 m/s",
    ) as caught:
        brachis.plan(slide(0.1, (0.1, 0.4), parts=[{"speed": 0.45, "s": [0.5, 0.6]}]))
    assert caught.value.where == "tool_limits.process_speed[1].speed"
    assert 0.9 * np.sqrt(0.11) < largest_speed_in(caught.value) < np.sqrt(0.11)


class TriedError(Exception):
    """A plan was tried."""


def refuse(*_):
    raise TriedError


def test_of_two_legs_that_are_too_short_the_message_has_the_worse_one(monkeypatch):
    """0.05 m are somewhat too short to reach 0.35 m/s, and 0.0005 m are far too short to leave it."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    with pytest.raises(
        brachis.PlanningError,
        match=r"s = 0\.5 to 0\.501 is too short to get from 0\.35 m/s to 0\.1 m/s",
    ):
        brachis.plan(slide(0.35, (0.1, 0.5), parts=[{"speed": 0.1, "s": [0.501, 0.6]}]))


def test_friction_that_helps_to_brake_is_no_reason_to_refuse(monkeypatch):
    """25 N brake 25 kg from 0.32 m/s in 0.05 m, and with 10 N of friction from 0.37 m/s."""

    monkeypatch.setattr("brachis.search.pipeline.rank_candidate", refuse)
    limits = {"acceleration": None, "torque": 25.0}
    with pytest.raises(TriedError):
        brachis.plan(slide(0.36, (0.5, 0.9), limits=limits, friction={"coulomb": 10.0}))
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    with pytest.raises(
        brachis.PlanningError,
        match=r"s = 0\.9 to 1 is too short to get from 0\.36 m/s to rest",
    ):
        brachis.plan(slide(0.36, (0.5, 0.9), limits=limits))


def test_a_speed_that_joint_velocities_forbid(monkeypatch):
    """The limit itself can be asked for."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    limits = {"velocity": 0.3}
    with pytest.raises(
        brachis.PlanningError,
        match=r"too high for the x_axis velocity limit at s = 0\.3;",
    ) as caught:
        brachis.plan(slide(0.5, (0.3, 0.6), limits=limits))
    assert largest_speed_in(caught.value) == 0.3
    assert brachis.plan(slide(0.3, (0.3, 0.6), limits=limits)).verified


def test_a_jerk_that_leaves_too_short_a_run_up(monkeypatch):
    """The phase plane knows no jerk, so that plans are tried: j t^3 / 6 takes 0.1 m to (j d^2)^(1/3) and less."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    few = {"spline": {"intervals": 6}, "search": {"effort": "single"}}
    with pytest.raises(
        brachis.PlanningError,
        match=r"no motion within the limits was found.*Lower tool_limits.process_speed\[0\].speed",
    ):
        brachis.plan(slide(0.4, (0.2, 0.6), limits={"jerk": 2.0}, **few))


def test_speeds_far_out_of_reach_of_a_redundant_arm_cost_no_plan(
    monkeypatch,
):
    monkeypatch.setattr(
        "brachis.search.guesses.screen", lambda *_: pytest.fail("a plan was tried")
    )
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    content = {
        "brachis": 1,
        "robot": {"urdf": str(RAIL)},
        "start": {"joints": [0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1]},
        "task_space": "pose",
        "path": [{"line": {"by": [0, 0.8, 0]}}],
        "search": {"effort": "single"},
    }
    with pytest.raises(
        brachis.PlanningError,
        match=r"the process speed is too high for the .* along the best joint path that was found",
    ):
        brachis.plan(
            {
                **content,
                "tool_limits": {"process_speed": {"speed": 20.0, "s": [0.3, 0.7]}},
            }
        )
    with pytest.raises(
        brachis.PlanningError,
        match=r"boundary.start_speed: the start speed is too high for the",
    ):
        brachis.plan({**content, "boundary": {"start_speed": 20.0}})


@pytest.mark.usefixtures("no_hurry")
def test_a_speed_at_the_end_that_the_velocity_limit_forbids(monkeypatch):
    monkeypatch.setattr("brachis.search.remedies._TRIALS", 1)
    with pytest.raises(
        brachis.PlanningError,
        match=r"the end speed is too high for the x_axis velocity limit at s = 1; found 0.9 m/s",
    ) as caught:
        brachis.plan(
            slide(
                0.2, (0.3, 0.6), limits={"velocity": 0.3}, boundary={"end_speed": 0.9}
            )
        )
    assert caught.value.where == "boundary.end_speed"
    assert (
        number_in_hint(caught.value, "boundary.end_speed")
        == largest_speed_in(caught.value)
        == 0.3
    )


def test_two_speeds_that_are_too_high_are_both_in_the_message(monkeypatch):
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    both = {"start_speed": 0.9, "end_speed": 0.9}
    lower = r"Lower boundary\.start_speed and lower boundary\.end_speed \(how"
    with pytest.raises(brachis.PlanningError, match=lower) as caught:
        brachis.plan(slide(0.3, (0.3, 0.6), limits={"velocity": 0.3}, boundary=both))
    assert largest_speed_in(caught.value) == 0.3


def test_a_speed_that_is_slightly_too_high_is_the_reason_after_plans_fail(monkeypatch):
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    limits = {"velocity": 0.3}
    few = {"spline": {"intervals": 6}, "search": {"effort": "single"}}
    content = slide(0.305, (0.3, 0.6), limits=limits, **few)
    with monkeypatch.context() as patch:
        patch.setattr("brachis.search.pipeline.rank_candidate", refuse)
        with pytest.raises(TriedError):
            brachis.plan(content)
    with pytest.raises(
        brachis.PlanningError, match=r"too high for the x_axis velocity limit"
    ) as caught:
        brachis.plan(content)
    assert caught.value.allowed == "no more than 0.3 m/s (estimate)"


@pytest.mark.parametrize("speed", [0.299, 0.305])
def test_nothing_is_free_where_the_whole_path_has_a_given_speed(speed, monkeypatch):
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    ends = {"start_speed": speed, "end_speed": speed}
    content = slide(speed, (0.0, 1.0), limits={"velocity": 0.3}, boundary=ends)
    if speed < 0.3:
        result = brachis.plan(content)
        assert result.verified
        assert result.t_end == pytest.approx(LENGTH / speed, rel=1e-9)
        return
    with pytest.raises(brachis.PlanningError, match="too high for the x_axis velocity"):
        brachis.plan(content)
