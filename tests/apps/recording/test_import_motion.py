"""A motion that is written to a file and imported is the motion that it was, with its path."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import BPoly

import brachis
from brachis.apps import bottleneck, export, plots
from brachis.apps.recording import import_motion, read_recording
from brachis.apps.recording.nodes import nodes_of
from brachis.apps.recording.recording import Recording
from brachis.errors import InputError, PathError, ResultFileError
from brachis.trajectory import Recovered, Trajectory
from brachis.verify import verify_trajectory
from support.checks import check_of, failing_checks, with_entry

from .conftest import DT, SCARA, smooth_step


def test_the_motion_comes_back(imported, motion):
    t = np.linspace(0.0, motion.t_end, 3001)
    assert imported.t_end == motion.t_end
    assert_allclose(imported.position(t), motion.position(t), atol=1e-8)
    assert_allclose(imported.velocity(t), motion.velocity(t), atol=1e-5)
    assert imported.task.spline.rest == "full"


def check_of_path(trajectory):
    return check_of(verify_trajectory(trajectory), "path error")


def test_its_path_comes_back_and_it_verifies(imported, motion):
    assert failing_checks(imported) <= {"torque ratio"}
    verification = verify_trajectory(imported)
    assert verification.worst_ratio == pytest.approx(1.0, abs=2e-3)
    assert verification.path_error < 1e-6
    path = check_of_path(imported)
    assert path.allowed == 1e-6
    assert path.remark == "the path was recovered from the motion"
    x = motion.robot.tool_placements(imported.q)[0][:, 0]
    assert np.abs(x - x[0]).max() < 1e-9  # a line along y


def test_a_saved_recording_keeps_its_notes_and_its_path(imported, tmp_path):
    assert "accelerations are the file's" in imported.recovered.told
    assert any(line.startswith("unknown: ") for line in imported.recovered.told)
    imported.save(tmp_path / "today.npz")
    again = Trajectory.load(tmp_path / "today.npz")
    assert again.recovered.to_file() == imported.recovered.to_file()
    assert verify_trajectory(again).worst_ratio == pytest.approx(
        verify_trajectory(imported).worst_ratio, rel=1e-9
    )
    export.write(again, tmp_path / "again.csv", dt=0.01)
    (ax, *_) = plots.plot_motion(again).axes
    assert ax.lines[0].get_xdata()[-1] == again.t_end


def test_a_file_may_not_allow_itself_any_path(imported, tmp_path, monkeypatch):
    with pytest.raises(
        InputError,
        match=r"the tolerance of a path is out of range; found 0.1; allowed: 2e-07 to 0.001",
    ):
        replace(imported.recovered, tolerance=0.1)
    own = imported.recovered.to_file()
    row = [0.0, 1.0, 2.0, 3.0]
    for message, key, wrong in (
        ("the tolerance of a path is out of range", "tolerance", 0.1),
        ("not the rows of a file; found rows ", "rows", [row]),
        ("error .4,.; allowed: rows .K, 4. with ascending times", "error", [0.0] * 4),
        ("recovered.rows: .*found 'none'", "rows", "none"),
        ("not a finite number", "rows", [row, [1.0, 1.0, 2.0, math.nan]]),
    ):
        changed = {**own, key: wrong}
        monkeypatch.setattr(Recovered, "to_file", lambda _, changed=changed: changed)
        imported.save(tmp_path / "today.npz")
        with pytest.raises(ResultFileError, match=message):
            Trajectory.load(tmp_path / "today.npz")


def test_a_motion_that_leaves_its_recovered_path_fails(imported):
    off = with_entry(imported, "q", len(imported.q) // 2, 1e-5)
    assert not check_of_path(off).passed


def test_bottlenecks_are_when_limits_are_active(imported):
    found = bottleneck.report(imported)
    assert found.sensitivities is None
    assert found.to_dict()["sensitivities"] is None
    text = str(found)
    assert text.startswith(
        "the cost of the limits is unknown: the motion was not planned, or was saved without its sensitivities\n"
    )
    assert "is at its torque limit for" in text
    with pytest.raises(InputError, match="the cost of its limits cannot be computed"):
        bottleneck.report(imported, check=True)


def test_few_digits_get_a_smoothing_spline(motion, table, write):
    path = write("t,j1,j2,j3", *table[:2], fmt="%.6f")
    again = import_motion(path, task=motion.task)
    assert any(
        "smoothing spline, 2.9e-07 rad (rms) off" in line
        for line in again.recovered.told
    )
    assert 1e-6 < again.recovered.tolerance < 1e-5  # as the digits have it
    assert again.t_end == pytest.approx(motion.t_end, abs=2.5 * DT)
    t = np.linspace(0.2, 2.0, 500)

    def error(delay):
        return np.abs(again.position(t) - motion.position(t + delay)).max()

    # The rows that were left out at the beginning are whole ones.
    delay = min((0.0, DT, 2.0 * DT), key=error)
    assert error(delay) < 2e-6
    assert_allclose(again.acceleration(t), motion.acceleration(t + delay), atol=0.2)


def read_nodes(path, robot):
    """A recording, and its nodes by what its digits are off."""
    recording = read_recording(path, robot, {})
    return recording, nodes_of(recording, recording.rounding / np.sqrt(3.0))


@pytest.mark.parametrize("digits", [4, 5, 6, 8])
def test_rest_is_found_in_few_digits(digits, motion, table, write):
    """And the time in which the last digit does not show yet that the motion has begun belongs to it."""
    t, q, _ = table
    path = write("t,j1,j2,j3", t, q, fmt=f"%.{digits}f")
    recording, nodes = read_nodes(path, motion.robot)
    assert nodes.at_rest == (True, True)
    assert recording.t[-1] == pytest.approx(motion.t_end, abs=2.5 * DT)


@pytest.mark.parametrize("digits", [4, 5, 6, 8])
def test_accelerations_that_set_in_with_a_jump_are_no_rest(digits, write):
    t = np.arange(0.0, 2.001, DT)
    progress = np.where(t < 1.0, 0.5 * t**2, 1.0 - 0.5 * (2.0 - t) ** 2)
    path = write(
        "t,j1,j2,j3", t, progress, -0.5 * progress, 0.02 * progress, fmt=f"%.{digits}f"
    )
    _, nodes = read_nodes(path, brachis.robots.scara3)
    assert nodes.at_rest == (True, False)


def test_few_digits_of_a_rail_say_nothing_of_the_joints(write):
    robot = brachis.robots.tx90l_rail
    t = np.linspace(0.0, 1.0, 251)
    q = np.outer(smooth_step(t), np.full(robot.n, 0.3))
    rail = robot.position_units.index("m")
    q[:, rail] = q[:, rail].round(4)  # 0.1 mm
    header = ",".join(["t", *robot.joint_names])
    recording, nodes = read_nodes(write(header, t, q), robot)
    assert recording.rounding[rail] == pytest.approx(5e-5)
    assert not np.delete(recording.rounding, rail).any()
    smoothed = "positions in m, velocities and accelerations of a smoothing spline, 2.9e-05 m (rms) off"
    assert smoothed in nodes.notes
    assert not any("rad" in line for line in nodes.notes)


def test_rates_that_contradict_the_positions_are_left_out(motion, write):
    samples = motion.sample(DT)
    header = "t,j1,j2,j3,qd_j1,qd_j2,qd_j3,qdd_j1,qdd_j2,qdd_j3"
    path = write(header, samples.t, samples.q, samples.qdot, 2.0 * samples.qddot)
    again = import_motion(path, task=motion.task)
    assert any(
        "the file's accelerations do not agree" in line for line in again.recovered.told
    )
    assert_allclose(again.acceleration(samples.t), samples.qddot, atol=0.05)


def test_positions_with_noise_get_a_smoothing_spline(motion, write):
    samples, noise = motion.sample(0.002), 1e-5
    q = samples.q + noise * np.random.default_rng(0).standard_normal(samples.q.shape)
    path = write("t,j1,j2,j3", samples.t, q)
    found = verify_trajectory(
        import_motion(path, task=motion.task, tolerance=1e-4, noise=noise)
    )
    assert found.path_error < 1e-4
    assert found.worst_ratio == pytest.approx(1.0, abs=0.05)
    with pytest.raises(PathError, match="set their noise or raise the tolerance"):
        import_motion(path, task=motion.task)


def test_accelerations_that_jump_do_not_overshoot():
    """Bang-bang: a spline through the rows would exceed the acceleration by a fifth of the jump."""
    t = np.append(np.arange(0.0, 2.0, 0.01), 2.0)
    switch = 1.0037
    first, rest = np.minimum(t, switch), np.maximum(t - switch, 0.0)
    q = (0.5 * first**2 + switch * rest - 0.5 * rest**2)[:, None]
    nodes = nodes_of(
        Recording(t, q, None, None, np.zeros(1), ("rad",), "here", ()), np.zeros(1)
    )
    pieces = BPoly.from_derivatives(
        nodes.t, np.stack([nodes.q, nodes.qdot, nodes.qddot], axis=1)
    )
    fine = np.linspace(0.0, 2.0, 20001)
    assert np.abs(pieces(fine, nu=2)).max() < 1.005
    assert_allclose(pieces(t), q, atol=1e-12)
    assert "accelerations jump between 1 pair of rows" in nodes.notes


def test_ends_in_motion(motion, table, write):
    t, q, qdot = table
    middle = slice(60, -60)
    columns = (t[middle], q[middle], qdot[middle])
    path = write("t,j1,j2,j3,qd_j1,qd_j2,qd_j3", *columns)
    again = import_motion(path, task=motion.task)
    boundary = again.task.boundary
    speeds = [boundary.start_speed, boundary.end_speed]
    ends = t[middle][[0, -1]]
    assert speeds == pytest.approx(motion.at(ends).tool_speed, rel=1e-6)
    assert failing_checks(again) <= {"torque ratio"}


def test_a_tool_that_stops_and_turns_off_is_an_error(motion, table, write):
    t, q, _ = table
    back = q + 0.5 * (q - q[0]) * [0.0, 0.0, 1.0]
    times = np.append(t, t[-1] + t[1:])
    positions = np.concatenate([q, back[-2::-1] + q[-1] - back[-1]])
    path = write("t,j1,j2,j3", times, positions)
    with pytest.raises(
        PathError,
        match=r"follows no smooth path within the tolerance.* split the file there",
    ):
        import_motion(path, task=motion.task)


def test_a_task_file_is_named_if_its_robot_is_wrong(file, motion, tmp_path):
    content = motion.task.to_dict()
    content["robot"]["tool_frame"] = "nowhere"
    task = tmp_path / "task.yaml"
    task.write_text(json.dumps(content))
    with pytest.raises(InputError) as raised:
        import_motion(file, task=task)
    assert str(raised.value).startswith(f"{task}: ")
    with pytest.raises(InputError) as raised:
        import_motion(file, SCARA, task=task)
    assert "task.yaml" not in str(raised.value)


@pytest.mark.parametrize("space", ["pose", "pose_free_roll", "joints"])
def test_the_path_of_an_arm_in_space_comes_back(space, write):
    robot = brachis.robots.iiwa14
    t = np.linspace(0.0, 2.0, 401)
    start = [0.1, 0.5, 0.2, -1.2, 0.3, 0.9, 0.4]
    q = start + np.outer(smooth_step(t / 2.0), [0.4, -0.2, 0.3, 0.3, -0.2, 0.1, 0.5])
    path = write(",".join(["t", *robot.joint_names]), t, q)
    result = verify_trajectory(import_motion(path, robot, task_space=space))
    assert result.passed, result
    assert result.path_error < 1e-6
    assert brachis.import_motion is import_motion
