"""A root-mean-square torque below what holds the arm is named, with a number that is enough."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import brachis

ROBOTS = Path(__file__).parents[2] / "robots"
WEIGHT = 5.0 * 9.81
"""N, of what the gantry's y axis carries."""


def lift(limit: float, **changes: object) -> dict:
    """Lift the tool of the gantry by 0.4 m."""
    return {
        "brachis": 1,
        "robot": {
            "urdf": str(ROBOTS / "gantry2/robot.urdf"),
            "gravity": [0, -9.81, 0],
            "limits": {"torque": 200.0, "rms_torque": {"y_axis": limit}},
            "friction": changes.pop("friction", {}),
        },
        "start": {"joints": [0.0, 0.4]},
        "task_space": ["x", "y"],
        "path": [{"line": {"by": [0.0, -0.4]}}],
        "spline": {"intervals": 12},
        "search": {"effort": "single", "least_motion": False, "time_limit": 600.0},
        **changes,
    }


def test_a_mean_force_below_the_weight_is_named_with_one_that_is_enough(monkeypatch):
    monkeypatch.setattr("brachis.search.remedies._TIME", 600.0)
    monkeypatch.setattr("brachis.search.remedies._NEAR", 1.3)
    with pytest.raises(
        brachis.PlanningError, match="too low to hold the arm against gravity"
    ) as caught:
        brachis.plan(lift(0.6 * WEIGHT))
    error = caught.value
    assert error.where == "robot.limits.rms_torque.y_axis"
    assert error.found.startswith(f"{WEIGHT:.4g} N to hold the arm")
    assert error.allowed == f"{0.6 * WEIGHT:.4g} N"
    advised = float(
        re.search(
            r"Raise robot\.limits\.rms_torque\.y_axis to ([\d.]+) N \(a plan",
            error.hint,
        )[1]
    )
    assert WEIGHT < advised < 1.3 * WEIGHT
    assert brachis.plan(lift(advised)).verified


def test_no_plan_begins_where_no_posture_holds(monkeypatch):
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    monkeypatch.setattr(
        "brachis.search.pipeline.rank_candidate",
        lambda *_: pytest.fail("a plan was tried"),
    )
    with pytest.raises(brachis.PlanningError, match="too low to hold the arm"):
        brachis.plan(lift(0.6 * WEIGHT))


def test_a_fall_is_tried_where_the_end_is_passed_in_motion():
    """Nothing is held in a free fall of 0.4 m, at whose end the tool has 2.8 m/s."""
    falls = {"boundary": {"end_speed": 2.5}, "path": [{"line": {"by": [0.0, -0.4]}}]}
    task = lift(0.8 * WEIGHT, **falls)
    task["robot"]["limits"]["velocity"] = None
    assert brachis.plan(task).verified


def test_a_mean_torque_along_a_path_of_joints(monkeypatch):
    """The second joint bears the arm, and the posture decides how much."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    task = {
        "brachis": 1,
        "robot": {
            "urdf": str(ROBOTS / "iiwa14/robot.urdf"),
            "limits": {"rms_torque": {"joint_2": 10.0}},
        },
        "start": {"joints": [0.0, 0.3, 0.0, -1.2, 0.0, 0.8, 0.0]},
        "task_space": "joints",
        "path": [{"line": {"to": [0.6, 0.5, -0.3, -0.9, 0.4, 0.6, 0.5]}}],
    }
    with pytest.raises(
        brachis.PlanningError, match=r"rms torque limit of 'joint_2' is too low to hold"
    ) as caught:
        brachis.plan(task)
    assert "joint_4" not in str(caught.value)
    low, high = map(
        float,
        re.match(
            r"([\d.]+) to ([\d.]+) Nm to hold the arm", caught.value.found
        ).groups(),
    )
    assert 10.0 < low < high
