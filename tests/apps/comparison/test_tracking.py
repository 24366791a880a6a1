"""Recordings of runs in the units of a controller, with errors that the tests put in."""

import csv

import numpy as np
import pytest

import brachis
from brachis.errors import InputError
from support.controllers import RAIL_START
from support.effort import QUICK


@pytest.fixture(scope="module")
def planned():
    """A line of all joints of an arm on a rail."""
    return brachis.plan(
        "tx90l_rail",
        path=brachis.Line(by=[0.25, 0.8, 0.3, 0.0, 0.1, 0.0, 0.2]),
        start=RAIL_START,
        task_space="joints",
        search=QUICK,
        intervals=10,
    ).trajectory


def record(planned, path, *, delay=0.0, error=None, torques=False):
    """Write a recording of a run in degrees and mm, every 4 ms, with half a second of rest before it."""
    times = np.arange(0.0, planned.t_end + 1.0, 0.004)
    run = (times - 0.5 - delay).clip(0.0, planned.t_end)
    q = planned.position(run)
    if error is not None:
        q = q + error(times)
    columns = {"t [ms]": 1e3 * times}
    columns |= {f"A{n} [deg]": np.degrees(q[:, n]) for n in range(1, 7)}
    columns |= {"E1 [mm]": 1e3 * q[:, 0]}
    if torques:
        tau = planned.torque(run)
        columns |= {f"tau_A{n}": tau[:, n] + 0.5 * n for n in range(1, 7)}
        columns |= {"tau_E1": tau[:, 0]}
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(np.column_stack([*columns.values()]).tolist())
    return path


def test_a_run_like_the_plan_has_no_error(planned, tmp_path):
    path = record(planned, tmp_path / "run.csv")
    tracking = brachis.compare_run(path, planned, "kuka_rsi_4ms")
    assert tracking.tool < 1e-6
    assert tracking.delay == pytest.approx(0.5, abs=0.02)
    assert max(axis.largest for axis in tracking.axes) < 1e-6
    assert tracking.t_end == pytest.approx(planned.t_end, abs=0.02)
    assert [axis.torque for axis in tracking.axes] == [None] * 7


def test_the_error_of_one_joint_is_found_in_its_place(planned, tmp_path):
    def bump(times):
        """Move joint 2 by 0.02 rad in the middle of the motion."""
        middle = 0.5 + 0.5 * planned.t_end
        bow = 0.02 * np.exp(-(((times - middle) / 0.03) ** 2))
        return np.outer(bow, [0, 0, 1, 0, 0, 0, 0])

    path = record(planned, tmp_path / "run.csv", error=bump, torques=True)
    tracking = brachis.compare_run(path, planned, "kuka_rsi_4ms")
    by_joint = {axis.joint: axis for axis in tracking.axes}
    worst = by_joint["joint_2"]
    assert worst.largest == pytest.approx(np.degrees(0.02), rel=0.1)
    assert worst.unit == "deg"
    assert worst.time == pytest.approx(0.5 * planned.t_end, abs=0.02)
    assert by_joint["joint_1"].largest < 0.1 * worst.largest
    assert tracking.tool > 5e-3
    assert by_joint["joint_6"].torque == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize(
    "profile, message",
    [
        ("abb_egm_4ms", "the position of 'J1' is missing"),
        ("kuka_rsi_4m", "Did you mean"),
    ],
)
def test_a_recording_that_does_not_fit_is_refused(profile, message, planned, tmp_path):
    path = record(planned, tmp_path / "run.csv")
    with pytest.raises(InputError, match=message):
        brachis.compare_run(path, planned, profile)


def test_a_run_of_another_plan_is_refused(planned, tmp_path):
    path = record(
        planned,
        tmp_path / "run.csv",
        error=lambda times: np.outer(0 * times + 2.0, np.eye(7)[1]),
    )
    with pytest.raises(
        InputError, match="not a run of the plan; found joint_1 deviates by 2 rad"
    ):
        brachis.compare_run(path, planned, "kuka_rsi_4ms")
