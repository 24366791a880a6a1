"""A root-mean-square torque below what holds the arm is named, with a number that is enough."""

import re

import pytest

import brachis
from brachis.task import task_with
from support.effort import QUICK

WEIGHT = 5.0 * 9.81
"""N, of what the gantry's y axis carries."""


def lift(limit, **changes):
    """Lift the tool of the gantry by 0.4 m."""
    limits = {"torque": 200.0, "rms_torque": {"y_axis": limit}}
    return task_with(
        robot={"urdf": "gantry2"},
        gravity=[0, -9.81, 0],
        limits=limits | changes.pop("limits", {}),
        start=[0.0, 0.4],
        task_space=["x", "y"],
        path=brachis.Line(by=[0.0, -0.4]),
        intervals=12,
        time_limit=600.0,
        **QUICK,
        **changes,
    )


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
    fall = lift(0.8 * WEIGHT, end_speed=2.5, limits={"velocity": None})
    assert brachis.plan(fall).verified


def test_a_mean_torque_along_a_path_of_joints(monkeypatch):
    """The second joint bears the arm, and the posture decides how much."""
    monkeypatch.setattr("brachis.search.remedies._TIME", 0.0)
    reason = r"rms torque limit of 'joint_2' is too low to hold"
    with pytest.raises(brachis.PlanningError, match=reason) as caught:
        brachis.plan(
            "iiwa14",
            limits={"rms_torque": {"joint_2": 10.0}},
            start=[0.0, 0.3, 0.0, -1.2, 0.0, 0.8, 0.0],
            task_space="joints",
            path=brachis.Line(to=[0.6, 0.5, -0.3, -0.9, 0.4, 0.6, 0.5]),
        )
    assert "joint_4" not in str(caught.value)
    span = r"([\d.]+) to ([\d.]+) Nm to hold the arm"
    low, high = map(float, re.match(span, caught.value.found).groups())
    assert 10.0 < low < high
