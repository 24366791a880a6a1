"""Files as they come: names of columns, units, other columns, mistakes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import brachis
from brachis.apps.recording import read_recording
from brachis.apps.recording.recording import check_units
from brachis.errors import InputError, TaskError
from brachis.robot import Robot

from .conftest import smooth_step

ROBOT = brachis.robots.scara3


def test_rows_in_which_the_motion_sets_out_gently_belong_to_it(write):
    t = np.linspace(0.0, 1.0, 1001)
    q = np.outer(smooth_step(t), [1.0, -1.0, 0.5])  # 3.5e-11 rad in the first ms
    recording = read_recording(write("t,j1,j2,j3", t, q), ROBOT, {})
    assert recording.t[-1] == 1.0
    assert not any("stands still" in line for line in recording.notes)


@pytest.mark.parametrize(
    "header, units, factors",
    [
        ("time,q_j1,q_j2,q_j3", {}, (1.0, 1.0)),
        ("Time [ms],J1_pos [deg],J2_pos [deg],J3_pos [deg]", {}, (1e3, 180.0 / np.pi)),
        ("t_ms,j1_deg,j2_deg,j3_deg", {}, (1e3, 180.0 / np.pi)),
        (
            "timestamp,position_j1,position_j2,position_j3",
            {"angle": "deg", "time": "us"},
            (1e6, 180.0 / np.pi),
        ),
    ],
)
def test_names_and_units(header, units, factors, table, write):
    t, q, _ = table
    found = read_recording(
        write(header, factors[0] * (t + 3.0), factors[1] * q), ROBOT, units
    )
    assert_allclose(found.t, t, atol=1e-12)
    assert_allclose(found.q, q, atol=1e-14)
    assert found.qdot is None


def test_columns_in_any_order_and_others_beside_them(table, write):
    t, q, qdot = table
    columns = (q[:, 2], qdot[:, [1, 0, 2]], t, q[:, :2], q[:, 0])
    path = write("j3,qd_j2,j1_vel [rad/s],dq_j3,t,j1,j2,j1_effort", *columns)
    found = read_recording(path, ROBOT, {})
    assert_array_equal(found.q, q)
    assert_array_equal(found.qdot, qdot)
    assert "ignored columns: j1_effort" in found.notes


def test_semicolons_and_decimal_commas(table, write):
    t, q, _ = table
    path = write("t,j1,j2,j3", t, q, fmt="%.12f")
    path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    assert_allclose(read_recording(path, ROBOT, {}).q, q, atol=1e-12)


def test_prismatic_joints_have_lengths(write):
    robot = brachis.robots.gantry2
    t = np.linspace(0.0, 1.0, 20)
    names = robot.joint_names
    path = write(f"t,{names[0]} [mm],{names[1]}", t, 100.0 * t, 0.2 * t)
    assert_allclose(
        read_recording(path, robot, {}).q, np.outer(t, [0.1, 0.2]), atol=1e-15
    )
    with pytest.raises(
        TaskError,
        match=r"unknown unit of column .* \[deg\]; found deg; allowed: m, cm, mm",
    ):
        read_recording(write(f"t,{names[0]} [deg],{names[1]}", t, t, t), robot, {})


def test_standing_still_before_and_after_does_not_count(table, write):
    t, q, _ = table
    waiting = np.pad(q, ((9, 5), (0, 0)), mode="edge")
    times = 0.004 * np.arange(len(waiting))
    recording = read_recording(write("t,j1,j2,j3", times, waiting), ROBOT, {})
    assert len(recording.t) == len(t)
    reason = "in which the robot stands still"
    assert f"left out 0.036 s before the motion, {reason} (9 rows)" in recording.notes
    assert f"left out 0.02 s after the motion, {reason} (5 rows)" in recording.notes


@pytest.mark.parametrize(
    "header, change, told",
    [
        (
            "t,j1,j2,j4",
            {},
            r"line 1: the position of 'j3' is missing; found t, j1, j2, j4; allowed: t, then j1, j2, j3",
        ),
        ("x,j1,j2,j3", {}, "the time is missing"),
        ("t,j1,j1,j3", {}, "the position of 'j1' occurs twice"),
        (
            "t,j1 [grad],j2,j3",
            {},
            r"unknown unit of column j1 \[grad\]; found grad; allowed: rad, mrad, deg",
        ),
        (
            "t,j1 [deg],j2,j3",
            {"angle": "rad"},
            "the unit in the header is not the requested unit; found deg",
        ),
        ("t,j1,j2,j3", {"angle": "grad"}, "there is no unit of angle named 'grad'"),
    ],
)
def test_headers_that_are_not_understood(header, change, told, table, write):
    with pytest.raises(InputError, match=told):
        read_recording(write(header, *table[:2]), ROBOT, check_units(change))


def test_only_some_velocities(table, write):
    with pytest.raises(TaskError, match="the velocity of 'j2' is missing"):
        read_recording(write("t,j1,j2,j3,qd_j1", *table[:2], table[2][:, 0]), ROBOT, {})


def test_rows_that_are_no_motion(table, write):
    t, q, _ = table
    with pytest.raises(
        TaskError,
        match=r"line 4: the times do not increase; found 0.004 s after 0.004 s",
    ):
        read_recording(
            write("t,j1,j2,j3", np.concatenate([t[:2], t[1:-1]]), q), ROBOT, {}
        )
    with pytest.raises(
        TaskError, match="moves in fewer than 5 rows; found 4 rows; allowed: 5 or more"
    ):
        read_recording(write("t,j1,j2,j3", t[:4], q[:4]), ROBOT, {})
    with pytest.raises(TaskError, match="the robot does not move"):
        read_recording(write("t,j1,j2,j3", t, 0.0 * q), ROBOT, {})
    with pytest.raises(
        TaskError,
        match=r"implausible angle \(degrees\?\); found [0-9.]+ rad at j1. If these are degrees, set",
    ):
        read_recording(write("t,j1,j2,j3", t, 100.0 * q), ROBOT, {})
    with pytest.raises(TaskError, match="the file does not exist"):
        read_recording("nowhere.csv", ROBOT, {})


@pytest.mark.parametrize("unit", ["deg/s^2", "deg/s2"])
def test_accelerations_with_their_unit(unit, table, write):
    t, q, qdot = table
    header = f"t,j1,j2,j3,qdd_j1 [{unit}],j2_acc [{unit}],a_j3_deg_per_s2"
    path = write(header, t, q, np.rad2deg(qdot))
    assert_allclose(read_recording(path, ROBOT, {}).qddot, qdot, rtol=1e-12)


def test_names_of_joints_may_have_spaces(table, write):
    t, q, _ = table
    text = ROBOT.urdf.replace('"j2"', '"joint 2"')
    robot = Robot.from_urdf("arm", urdf_text=text, tool_frame=ROBOT.tool_frame)
    found = read_recording(write("t,j1,joint 2_pos,j3", t, q), robot, {})
    assert_array_equal(found.q, q)
