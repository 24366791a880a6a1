"""Numbers that an error advises are tried before."""

import re

import pytest

import brachis
from brachis.common.deadline import Deadline
from brachis.errors import PlanningError, Remedy
from brachis.robot.from_task import robot_for
from brachis.search import remedies as module
from brachis.search.hopeless import round_to_three_digits
from brachis.task import task_with


@pytest.fixture
def task():
    return task_with(
        robot={"urdf": "scara3"},
        limits={"torque": 10.0},
        payload={"mass": 8.0},
        start=[0.5, -2.1, 2.1],
        task_space=["x", "y"],
        path=brachis.Line(by=[0.0, 1.0]),
        end_speed=0.9,
    )


def hint(task, remedies, is_planned, *, seconds=60.0):
    """Return the hint where `is_planned` says of a changed task, a deadline and a number of batches what is planned."""
    error = PlanningError("no motion", hint="Try another path").with_remedies(*remedies)

    def replaced(_robot, changed, _families, _limits, *rest):
        return is_planned(changed, *rest)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "is_planned", replaced)
        robot = robot_for(None, task.robot)
        module.try_remedies(error, robot, task, [], [], Deadline.after(seconds))
    assert str(error).endswith(error.hint)
    return error.hint


@pytest.mark.parametrize("possible", [0.8, 0.52, 0.5, 0.41, 0.1])
def test_a_speed_is_lowered_to_nearly_the_largest_that_is_possible(task, possible):
    found = hint(
        task,
        [Remedy("boundary.end_speed", 0.9, 0.5, "m/s")],
        lambda changed, *_: changed.boundary.end_speed <= possible,
    )
    good, bad = re.match(
        r"Lower boundary\.end_speed to ([\d.]+) m/s \(a plan with it was verified; no plan was found with "
        r"([\d.]+) m/s\), or try another path",
        found,
    ).groups()
    assert float(good) <= possible < float(bad) <= 1.06 * float(good)


@pytest.mark.parametrize("needed", [11.0, 24.0, 70.0])
def test_a_limit_of_all_joints_is_raised_for_one(task, needed):
    limits = []

    def is_planned(changed, *_):
        limits.append(changed.robot.limits.torque)
        return changed.robot.limits.torque["j2"] >= needed

    found = hint(task, [Remedy("robot.limits.torque.j2", 10.0, 25.0, "Nm")], is_planned)
    good = float(
        re.match(r"Raise robot\.limits\.torque\.j2 to ([\d.]+) Nm \(a plan", found)[1]
    )
    assert needed <= good <= 1.06 * needed
    assert all(limit["j1"] == limit["j3"] == 10.0 for limit in limits)


def test_what_a_trial_of_one_joint_path_does_not_find_is_not_said_to_be_impossible(
    task,
):
    remedy = Remedy("robot.payload.mass", 8.0, 4.0, "kg")
    found = hint(
        task, [remedy], lambda changed, *_: changed.robot.payload.mass < 5.0 or None
    )
    assert re.match(
        r"Lower robot\.payload\.mass to 4\.\d+ kg \(a plan with it was verified\), or",
        found,
    )


def test_a_whole_search_that_finds_more_counts(task):
    """Quick trials stop at 0.5 m/s; with a whole search 0.6 m/s are possible."""

    def is_planned(changed, _, most):
        return changed.boundary.end_speed <= (0.5 if most else 0.6) or None

    found = hint(task, [Remedy("boundary.end_speed", 0.9, 0.45, "m/s")], is_planned)
    assert re.match(
        r"Lower boundary\.end_speed to 0\.5[01]\d* m/s \(a plan with it was verified\), or",
        found,
    )


@pytest.mark.parametrize("seconds", [0.0, 60.0])
def test_the_hint_has_no_number_without_a_verified_plan(task, seconds):
    remedies = [
        Remedy("boundary.end_speed", 0.9, 0.5, "m/s"),
        Remedy("robot.payload.mass", 8.0, 4.0, "kg"),
    ]
    found = hint(task, remedies, lambda *_: False, seconds=seconds)
    assert (
        found
        == "Lower boundary.end_speed and lower robot.payload.mass (by how much is not known), or try another path"
    )


@pytest.mark.parametrize("more", ["scene", "margins"])
def test_a_payload_is_no_advice_where_the_posture_alone_is_wrong(more):
    q = [0.0, 0.3, 0.0, -1.2, 0.0, 0.8, 0.0]
    keys = {
        "scene": {"scene": [brachis.HalfSpace([0, 0, 1], offset=0.5, name="floor")]},
        "margins": {"margins": {"joint_ends": 0.35}},
    }[more]
    with pytest.raises(brachis.errors.StartError) as caught:
        brachis.plan(
            "iiwa14",
            start=q,
            task_space="pose",
            path=brachis.Line(by=[0.1, 0.0, 0.0]),
            payload={"mass": 3.0},
            **keys,
        )
    assert "payload" not in caught.value.hint


@pytest.mark.parametrize("way", ["plan", "plan_many", "sweep"])
def test_of_many_plans_none_spends_time_on_advice(way, monkeypatch, tmp_path):
    trials = []
    monkeypatch.setattr(module, "is_planned", lambda *_: bool(trials.append(1)))
    task = task_with(
        robot={"urdf": "scara3"},
        gravity=[0.0, -9.81, 0.0],
        limits={"torque": [200.0, 300.0, 300.0]},
        start=[0.5, -2.1, 2.1],
        task_space=["x", "y"],
        path=brachis.Line(by=[0.0, 0.5]),
    )
    if way == "plan":
        with pytest.raises(brachis.errors.StartError) as caught:
            brachis.plan(task)
        message = str(caught.value)
    elif way == "plan_many":
        (error,) = brachis.plan_many([task])
        message = str(error)
    else:
        sweep = {"sweep": 1, "task": task.to_dict(), "rows": [{"spline.degree": 3}]}
        (row,) = brachis.sweep(sweep, tmp_path / "out", jobs=1).rows()
        message = row["message"]
    assert "Raise robot.limits.torque.j1 (by how much is not known)" in message
    assert bool(trials) is (way == "plan")


@pytest.mark.parametrize(
    "value, lower, upper",
    [(1.2345, 1.23, 1.24), (0.0098765, 0.00987, 0.00988), (1.13, 1.13, 1.13)],
)
def test_numbers_of_three_digits_stay(value, lower, upper):
    assert round_to_three_digits(value, down=True) == pytest.approx(lower, rel=1e-12)
    assert round_to_three_digits(value, down=False) == pytest.approx(upper, rel=1e-12)
    assert round_to_three_digits(-value, down=True) == -value
