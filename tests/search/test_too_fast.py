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
                {"speed": speed, "s": part, "tolerance": 0.02},
                *changes.pop("parts", []),
            ]
        },
        **changes,
    }


@pytest.fixture
def no_hurry(monkeypatch):
    """Let trials take as long as they want."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 600.0)


def advised(error: brachis.BrachisError, key: str) -> float:
    """Return the number that a hint advises for a key."""
    found = re.search(
        rf"{re.escape(key)} to ([\d.]+).*? \(a plan with it was verified", error.hint
    )
    assert found, error.hint
    return float(found[1])


@pytest.mark.usefixtures("no_hurry")
def test_a_run_up_that_is_too_short_is_told_with_what_would_do(monkeypatch):
    """Over the way d the acceleration a leads to sqrt(2 a d)."""
    monkeypatch.setattr("brachis.search.remedies._TRIALS", 1)
    with pytest.raises(
        brachis.PlanningError,
        match=r"the path before s = 0\.1 is too short to reach it",
    ) as caught:
        brachis.plan(slide(0.5, (0.1, 0.6)))
    possible = np.sqrt(2.0 * 0.1 * LENGTH)
    least = re.search(
        r"([\d.]+) to [\d.]+ m/s on that part, the least at s = 0.1", caught.value.found
    )
    assert float(least[1]) == pytest.approx(possible, rel=0.02)
    assert caught.value.allowed == "at least 0.49 m/s"
    assert caught.value.where == "tool_limits.process_speed[0].speed (tool)"
    speed = advised(caught.value, "tool_limits.process_speed[0].speed")
    assert 0.9 * possible < speed < 1.05 * possible
    assert brachis.plan(slide(speed, (0.1, 0.6))).verified


def test_no_number_is_advised_where_the_time_is_up(monkeypatch):
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    with pytest.raises(brachis.PlanningError) as caught:
        brachis.plan(slide(0.5, (0.1, 0.6)))
    assert re.match(
        r"Lower tool_limits\.process_speed\[0\]\.speed \(how far is not known\), or raise",
        caught.value.hint,
    )


def test_a_number_that_was_not_verified_is_not_advised(monkeypatch):
    """Only half of what the phase plane allows leads to a plan here."""

    def is_planned(_robot, task, *_):
        return task.tool_limits.process_speed[0].speed < 0.16

    monkeypatch.setattr("brachis.search.remedies.is_planned", is_planned)
    with pytest.raises(brachis.PlanningError) as caught:
        brachis.plan(slide(0.5, (0.1, 0.6)))
    assert 0.15 < advised(caught.value, "tool_limits.process_speed[0].speed") < 0.16
    assert "s[0] to" not in caught.value.hint


class TriedError(Exception):
    """A plan was tried."""


def test_friction_that_helps_to_brake_is_no_reason_to_refuse(monkeypatch):
    """25 N brake 25 kg from 0.32 m/s in 0.05 m, and with 10 N of friction from 0.37 m/s."""

    def solved(*_):
        raise TriedError

    monkeypatch.setattr("brachis.search.candidates.solve_candidate", solved)
    limits = {"acceleration": None, "torque": 25.0}
    with pytest.raises(TriedError):
        brachis.plan(slide(0.36, (0.5, 0.9), limits=limits, friction={"coulomb": 10.0}))
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    with pytest.raises(
        brachis.PlanningError,
        match=r"the path after s = 0\.9 is too short to reach it",
    ):
        brachis.plan(slide(0.36, (0.5, 0.9), limits=limits))


@pytest.mark.usefixtures("no_hurry")
def test_of_several_parts_the_one_is_told_that_is_too_fast(monkeypatch):
    monkeypatch.setattr("brachis.search.remedies._TRIALS", 1)
    with pytest.raises(
        brachis.PlanningError,
        match=r"the path after s = 0\.9 is too short to reach it",
    ) as caught:
        brachis.plan(
            slide(
                0.2,
                (0.1, 0.3),
                parts=[{"speed": 0.5, "s": [0.6, 0.9], "tolerance": 0.02}],
            )
        )
    assert advised(caught.value, "tool_limits.process_speed[1].s[1]") == pytest.approx(
        0.75, abs=0.011
    )
    assert (
        caught.value.where
        == "tool_limits.process_speed[1].speed (tool, s = 0.6 to 0.9)"
    )


def test_a_speed_that_joint_velocities_forbid():
    with pytest.raises(
        brachis.PlanningError,
        match=r"the x_axis velocity limit lets the tool keep no more than 0\.3 m/s",
    ):
        brachis.plan(slide(0.5, (0.3, 0.6), limits={"velocity": 0.3}))


def test_a_jerk_that_leaves_too_short_a_run_up(monkeypatch):
    """The phase plane knows no jerk; the plan without the process speed does: sqrt(j d^2) ** (2 / 3) and less."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    with pytest.raises(
        brachis.PlanningError, match="in the fastest motion without it"
    ) as caught:
        brachis.plan(slide(0.4, (0.2, 0.6), limits={"jerk": 2.0}))
    assert "the path before s = 0.2" in str(caught.value)


def test_speeds_far_out_of_reach_of_a_redundant_arm_are_refused_before_a_plan_is_tried(
    monkeypatch,
):
    monkeypatch.setattr(
        "brachis.search.starts.screen", lambda *_: pytest.fail("a plan was tried")
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
        match=r"rail velocity limit .* along the best joint path that was found",
    ):
        brachis.plan(
            {
                **content,
                "tool_limits": {"process_speed": {"speed": 20.0, "s": [0.3, 0.7]}},
            }
        )
    with pytest.raises(
        brachis.PlanningError,
        match=r"boundary.start_speed: .* this speed at the path's start",
    ):
        brachis.plan({**content, "boundary": {"start_speed": 20.0}})


@pytest.mark.usefixtures("no_hurry")
def test_a_speed_at_the_end_that_the_velocity_limit_forbids(monkeypatch):
    monkeypatch.setattr("brachis.search.remedies._TRIALS", 1)
    with pytest.raises(
        brachis.PlanningError,
        match=r"found 0.9 m/s; along one joint path about 0.3 m/s is possible",
    ) as caught:
        brachis.plan(
            slide(
                0.2, (0.3, 0.6), limits={"velocity": 0.3}, boundary={"end_speed": 0.9}
            )
        )
    assert caught.value.where == "boundary.end_speed"
    assert 0.27 < advised(caught.value, "boundary.end_speed") <= 0.3


def test_an_end_speed_that_another_one_at_the_start_makes_possible(monkeypatch):
    """The velocity limit allows 0.3 m/s at both ends; from rest the way is long enough for 0.1 m/s alone."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    both = {"start_speed": 0.9, "end_speed": 0.9}
    lower = r"Lower boundary\.start_speed and lower boundary\.end_speed"
    with pytest.raises(
        brachis.PlanningError, match=rf"joint path about 0\.3\d* m/s.*{lower}"
    ):
        brachis.plan(
            slide(
                0.3,
                (0.3, 0.6),
                limits={"velocity": 0.3, "acceleration": 0.01},
                boundary=both,
            )
        )
