"""A motion that is written to a file and imported is the motion that it was, with its path."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.apps import bottleneck, export, plots
from brachis.apps.recording import import_motion, read_recording
from brachis.apps.recording.nodes import nodes_of
from brachis.apps.recording.recording import Recording
from brachis.errors import InputError, PathError, ResultFileError
from brachis.robot import Robot
from brachis.trajectory import Recovered, Trajectory
from brachis.verify import verify_trajectory

from .conftest import DT, ROOT, SCARA


def test_the_motion_comes_back(imported, motion):
    t = np.linspace(0.0, motion.t_end, 3001)
    assert imported.t_end == motion.t_end
    assert_allclose(imported.position(t), motion.position(t), atol=1e-8)
    assert_allclose(imported.velocity(t), motion.velocity(t), atol=1e-5)
    assert imported.task.spline.rest == "full"


def test_its_path_comes_back_and_it_verifies(imported, motion):
    found = verify_trajectory(imported)
    assert {check.name for check in found.checks if not check.passed} <= {
        "torque ratio"
    }
    assert found.worst_ratio == pytest.approx(1.0, abs=2e-3)
    assert found.path_error < 1e-6
    (path,) = (check for check in found.checks if check.name == "path error")
    assert (path.allowed, path.remark) == (
        1e-6,
        "the path was recovered from the motion",
    )
    places = np.array(
        [motion.robot.tool_placement(q).translation[:2] for q in imported.q]
    )
    start = places[0]
    assert np.abs(places[:, 0] - start[0]).max() < 1e-9  # a line along y


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
    wrong = {
        "the tolerance of a path is out of range": {"tolerance": 0.1},
        "not the rows of a file; found rows ": {"rows": [[0.0, 1.0, 2.0, 3.0]]},
        "error .4,.; allowed: rows .K, 4. with ascending times": {"error": [0.0] * 4},
        "recovered.rows: .*found 'none'": {"rows": "none"},
        "not a finite number": {
            "rows": [[0.0, 1.0, 2.0, 3.0], [1.0, 1.0, 2.0, float("nan")]]
        },
    }
    for message, change in wrong.items():
        monkeypatch.setattr(
            Recovered, "to_file", lambda _, change=change: {**own, **change}
        )
        imported.save(tmp_path / "today.npz")
        with pytest.raises(ResultFileError, match=message):
            Trajectory.load(tmp_path / "today.npz")


def test_a_motion_that_leaves_its_recovered_path_fails(imported):
    q = np.array(imported.q)
    q[len(q) // 2] += 1e-5
    (path,) = (
        check
        for check in verify_trajectory(replace(imported, q=q)).checks
        if check.name == "path error"
    )
    assert not path.passed


def test_bottlenecks_are_when_limits_are_active(imported):
    found = bottleneck.report(imported)
    assert found.sensitivities is None
    assert found.to_dict()["sensitivities"] is None
    text = str(found)
    assert text.startswith(
        "what limits cost is unknown: the motion was not planned, or that is not stored with it\n"
    )
    assert "is at its torque limit for" in text
    with pytest.raises(InputError, match="the cost of its limits cannot be computed"):
        bottleneck.report(imported, check=True)


def test_few_digits_get_a_smoothing_spline(motion, table, write):
    t, q, _ = table
    found = import_motion(write("t,j1,j2,j3", t, q, fmt="%.6f"), task=motion.task)
    assert any(
        "smoothing spline, 2.9e-07 rad (rms) off" in line
        for line in found.recovered.told
    )
    assert 1e-6 < found.recovered.tolerance < 1e-5  # as the digits have it
    assert found.t_end == pytest.approx(motion.t_end, abs=2.5 * DT)
    middle = np.linspace(0.2, 2.0, 500)
    times = np.linspace(
        0.0, 2.0 * DT, 3
    )  # the rows that were left out at the beginning are whole ones
    later = min(
        times,
        key=lambda late: np.abs(
            found.position(middle) - motion.position(middle + late)
        ).max(),
    )
    assert_allclose(found.position(middle), motion.position(middle + later), atol=2e-6)
    assert_allclose(
        found.acceleration(middle), motion.acceleration(middle + later), atol=0.2
    )


@pytest.mark.parametrize("digits", [4, 5, 6, 8])
def test_rest_is_found_in_few_digits(digits, motion, table, write):
    """And the time in which the last digit does not show yet that the motion has begun belongs to it."""
    t, q, _ = table
    recording = read_recording(
        write("t,j1,j2,j3", t, q, fmt=f"%.{digits}f"), motion.robot, {}
    )
    nodes = nodes_of(recording, recording.rounding / np.sqrt(3.0))
    assert nodes.at_rest == (True, True)
    assert recording.t[-1] == pytest.approx(motion.t_end, abs=2.5 * DT)


@pytest.mark.parametrize("digits", [4, 5, 6, 8])
def test_accelerations_that_set_in_with_a_jump_are_no_rest(digits, write):
    t = np.arange(0.0, 2.001, DT)
    way = np.where(t < 1.0, 0.5 * t**2, 1.0 - 0.5 * (2.0 - t) ** 2)[:, None] * [
        1.0,
        -0.5,
        0.02,
    ]
    recording = read_recording(
        write("t,j1,j2,j3", t, way, fmt=f"%.{digits}f"), Robot.from_urdf(SCARA), {}
    )
    assert nodes_of(recording, recording.rounding / np.sqrt(3.0)).at_rest == (
        True,
        False,
    )


def test_few_digits_of_a_rail_say_nothing_of_the_joints(write):
    robot = brachis.robots.tx90l_rail
    t = np.linspace(0.0, 1.0, 251)
    progress = t**4 * (35.0 - 84.0 * t + 70.0 * t**2 - 20.0 * t**3)
    q = np.outer(progress, np.full(robot.n, 0.3))
    rail = robot.position_units.index("m")
    q[:, rail] = q[:, rail].round(4)  # 0.1 mm
    header = ",".join(["t", *robot.joint_names])
    recording = read_recording(write(header, t, q), robot, {})
    assert recording.rounding[rail] == pytest.approx(5e-5)
    assert not np.delete(recording.rounding, rail).any()
    nodes = nodes_of(recording, recording.rounding / np.sqrt(3.0))
    smoothed = "positions in m, velocities and accelerations of a smoothing spline, 2.9e-05 m (rms) off"
    assert smoothed in nodes.notes
    assert not any("rad" in line for line in nodes.notes)


def test_rates_that_contradict_the_positions_are_left_out(motion, write):
    samples = motion.sample(DT)
    header = ",".join(
        [
            "t",
            *(
                f"{kind}{joint}"
                for kind in ("", "qd_", "qdd_")
                for joint in ("j1", "j2", "j3")
            ),
        ]
    )
    path = write(header, samples.t, samples.q, samples.qdot, 2.0 * samples.qddot)
    found = import_motion(path, task=motion.task)
    assert any(
        "the file's accelerations do not agree" in line for line in found.recovered.told
    )
    assert_allclose(found.acceleration(samples.t), samples.qddot, atol=0.05)


def test_positions_with_noise_get_a_smoothing_spline(motion, write):
    samples, noise = motion.sample(0.002), 1e-5
    q = samples.q + noise * np.random.default_rng(0).standard_normal(samples.q.shape)
    path = write("t,j1,j2,j3", samples.t, q)
    found = verify_trajectory(
        import_motion(path, task=motion.task, tolerance=1e-4, noise=noise)
    )
    assert found.path_error < 1e-4
    assert found.worst_ratio == pytest.approx(1.0, abs=0.05)
    with pytest.raises(PathError, match="set their noise, or raise the tolerance"):
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
    from scipy.interpolate import BPoly

    pieces = BPoly.from_derivatives(
        nodes.t, np.stack([nodes.q, nodes.qdot, nodes.qddot], axis=1)
    )
    fine = np.linspace(0.0, 2.0, 20001)
    assert np.abs(pieces(fine, nu=2)).max() < 1.005
    assert_allclose(pieces(t), q, atol=1e-12)
    assert "accelerations jump between 1 pair of rows" in nodes.notes


def test_ends_in_motion(motion, table, write):
    t, q, qdot = table
    kept = slice(60, -60)
    found = import_motion(
        write("t,j1,j2,j3,qd_j1,qd_j2,qd_j3", t[kept], q[kept], qdot[kept]),
        task=motion.task,
    )
    boundary = found.task.boundary
    for speed, end in (
        (boundary.start_speed, t[kept][0]),
        (boundary.end_speed, t[kept][-1]),
    ):
        before, after = (
            motion.robot.tool_placement(q).translation
            for q in motion.position(end + np.array([-1e-5, 1e-5]))
        )
        assert speed == pytest.approx(np.linalg.norm(after - before) / 2e-5, rel=1e-4)
    failed = {
        check.name for check in verify_trajectory(found).checks if not check.passed
    }
    assert failed <= {"torque ratio"}


def test_a_tool_that_stops_and_turns_off_is_an_error(motion, table, write):
    t, q, _ = table
    back = q + 0.5 * (q - q[0]) * [0.0, 0.0, 1.0]
    path = write(
        "t,j1,j2,j3",
        np.append(t, t[-1] + t[1:]),
        np.concatenate([q, back[-2::-1] + q[-1] - back[-1]]),
    )
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
    robot, t = (
        Robot.from_urdf(ROOT / "robots/iiwa14/robot.urdf"),
        np.linspace(0.0, 2.0, 401),
    )
    u = t / 2.0
    progress = (u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3))[:, None]
    q = np.array([0.1, 0.5, 0.2, -1.2, 0.3, 0.9, 0.4]) + progress * [
        0.4,
        -0.2,
        0.3,
        0.3,
        -0.2,
        0.1,
        0.5,
    ]
    found = import_motion(
        write(",".join(["t", *robot.joint_names]), t, q), robot, task_space=space
    )
    result = verify_trajectory(found)
    assert result.passed, result
    assert result.path_error < 1e-6
    assert brachis.import_motion is import_motion
