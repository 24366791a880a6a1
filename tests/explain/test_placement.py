"""Gradients by placements and payload: of planning again, of symmetry, and where there is none."""

import numpy as np
import pytest

import brachis
from brachis.explain.placement import COORDINATES, move_in_task, transform_about
from brachis.task.settings import place_frame

LINE = {
    "brachis": 1,
    "robot": {"urdf": "scara3"},
    "start": "free",
    "path_start": [0.0, 0.0],
    "task_space": ["x", "y"],
    "frames": {"part": {"xyz": [1.2, -0.3, 0.0], "rpy_deg": [0.0, 0.0, 10.0]}},
    "path": {"frame": "part", "segments": [{"line": {"by": [0.3, 0.6]}}]},
    "spline": {"intervals": 24},
    "search": {"least_motion": False},
    "refinement": {"tolerance": 1e-5},
}
STEP = 0.003


def with_frame(task, xyz, yaw=10.0):
    return {**task, "frames": {"part": {"xyz": xyz, "rpy_deg": [0.0, 0.0, yaw]}}}


@pytest.fixture(scope="module")
def line():
    return brachis.plan(LINE)


def derivative(result, subject, figure):
    entries = {
        (entry.subject, entry.figure): entry.derivative for entry in result.gradients
    }
    return entries[subject, figure]


def gradient_by_planning(task, result, step=STEP):
    """Derivatives by x and y of the frame from plans of the moved task, (2,)."""
    xyz = np.array([1.2, -0.3, 0.0])
    found = []
    for change in step * np.eye(3)[:2]:
        times = []
        for side in (1.0, -1.0):
            moved = with_frame(task, (xyz + side * change).tolist())
            again = brachis.plan(moved, start_from=result)
            assert again.candidate.origin == "given motion"
            times.append(again.t_end)
        found.append((times[0] - times[1]) / (2.0 * step))
    return np.array(found)


def test_a_moved_workpiece_costs_what_its_gradient_says(line):
    found = gradient_by_planning(LINE, line)
    predicted = [derivative(line, "part", axis) for axis in "xy"]
    assert np.linalg.norm(predicted - found) < 0.05 * np.linalg.norm(found)
    assert np.linalg.norm(found) > 0.1


def test_the_workpiece_of_a_program_moves_all_its_paths():
    part = {"path": LINE["path"], "path_start": [0.0, 0.0]}
    back = {
        "path": {"frame": "part", "segments": [{"line": {"to": [0.0, 0.3]}}]},
        "path_start": [-0.2, 0.6],
    }
    task = {
        key: value for key, value in LINE.items() if key not in ("path", "path_start")
    }
    task["postures"] = {"home": [0.3, -1.0, 1.0]}
    task |= {"start": "home", "end": "start"}
    task["program"] = [{"move": "next"}, part, {"move": "next"}, back, {"move": "home"}]
    task["spline"] = {"intervals": 14}
    result = brachis.plan(task)
    found = gradient_by_planning(task, result, 0.01)
    predicted = [derivative(result, "part", axis) for axis in "xy"]
    # Plans of this program differ by 0.1 %, which is up to 10 % of what the step changes.
    assert np.linalg.norm(predicted - found) < 0.15 * np.linalg.norm(found)
    assert np.linalg.norm(found) > 1.0


def test_a_turned_workpiece_costs_what_its_gradient_says(line):
    xyz = [1.2, -0.3, 0.0]
    times = [
        brachis.plan(with_frame(LINE, xyz, 10.0 + turn), start_from=line).t_end
        for turn in (0.2, -0.2)
    ]
    found = (times[0] - times[1]) / np.radians(0.4)
    assert derivative(line, "part", "yaw") == pytest.approx(found, rel=0.05)


def test_a_heavier_payload_costs_what_its_gradient_says(line):
    times = [
        brachis.plan(LINE, robot={"payload": {"mass": mass}}, start_from=line).t_end
        for mass in (0.06, 0.02)
    ]
    found = (times[0] - times[1]) / 0.04
    assert derivative(line, "payload", "mass") == pytest.approx(found, rel=0.1)
    assert found > 0.0


def test_paths_in_a_frame_turn_about_the_same_point_as_paths_in_the_world():
    """A frame at the world's origin changes nothing."""
    task = {key: value for key, value in LINE.items() if key != "frames"}
    task |= {"path_start": [1.2, -0.3], "path": [{"line": {"by": [0.2, 0.6]}}]}
    frames = {"origin": {"xyz": [0.0, 0.0, 0.0]}}
    in_frame = brachis.plan({**task, "frames": frames, "path_frame": "origin"})
    in_world = brachis.plan(task, start_from=in_frame)
    turned = derivative(in_world, "path", "yaw")
    assert derivative(in_frame, "origin", "yaw") == pytest.approx(turned, rel=0.01)
    assert abs(turned) > 0.02


def test_the_base_moves_against_the_workpiece(line):
    """A turn about the vertical first axis changes nothing, because that joint has no end here."""
    for axis in "xy":
        moved = derivative(line, "part", axis)
        assert derivative(line, "base", axis) == pytest.approx(-moved, rel=1e-6)
    assert derivative(line, "base", "yaw") == pytest.approx(0.0, abs=1e-6)


def test_a_turn_out_of_the_plane_has_no_gradient(line):
    figures = {entry.figure for entry in line.gradients if entry.subject == "part"}
    assert figures == set(COORDINATES) - {"roll", "pitch"}


def test_a_given_start_posture_holds_the_path():
    result = brachis.plan(brachis.examples.scara_line, effort="single", strict=False)
    entries = {entry.subject: entry for entry in result.gradients}
    assert entries["path"].derivative is None
    assert "given posture" in entries["path"].note
    assert entries["payload"].derivative > 0.0


def test_gradients_are_saved_with_the_motion(line, tmp_path):
    line.save(tmp_path / "result.npz")
    saved = brachis.Trajectory.load(tmp_path / "result.npz")
    assert saved.sensitivities.gradients == line.gradients
    assert "Where it stands" in brachis.report.make_report(saved).html


def test_a_frame_moves_with_the_frames_in_it():
    frames = {
        "table": {"xyz": [1.0, 0.2, 0.0], "rpy_deg": [0.0, 0.0, 90.0]},
        "part": {"xyz": [0.1, 0.3, 0.0], "frame": "table"},
    }
    task = brachis.load_task({**LINE, "frames": frames})
    transform = transform_about({"x": 0.4, "yaw": 0.2}, np.array([1.0, 0.2, 0.0]))
    for name in frames:
        moved = move_in_task(task, name, transform)
        after = place_frame(moved.frames, name).transform
        before = place_frame(task.frames, name).transform
        assert np.allclose(after.homogeneous, (transform * before).homogeneous)
    part = place_frame(move_in_task(task, "table", transform).frames, "part")
    carried = transform * place_frame(task.frames, "part").transform
    assert np.allclose(part.transform.homogeneous, carried.homogeneous)


def test_a_moved_post_costs_what_its_gradient_says():
    """The elbow goes round the post; the path stays where it is."""
    post = {"capsule": {"radius": 0.05, "length": 0.2}, "frame": "post"}
    task = {
        "brachis": 1,
        "robot": {"urdf": "iiwa14"},
        "start": {"joints": [-0.4, 0.7, 0.0, -1.2, 0.0, 1.0, 0.0]},
        "task_space": "pose",
        "path": [{"line": {"by": [0.0, 0.5, 0.0]}}],
        "scene": [post],
        "frames": {"post": {"xyz": [0.35, 0.1, 0.65]}},
        "spline": {"intervals": 16},
        "search": {"least_motion": False},
        "refinement": {"tolerance": 1e-5},
    }
    result = brachis.plan(task)
    by_post = [derivative(result, "post", axis) for axis in "xyz"]
    axis = int(np.argmax(np.abs(by_post)))
    times = []
    for side in (1.0, -1.0):
        xyz = [0.35, 0.1, 0.65]
        xyz[axis] += side * STEP
        moved = {**task, "frames": {"post": {"xyz": xyz}}}
        times.append(brachis.plan(moved, start_from=result).t_end)
    found = (times[0] - times[1]) / (2.0 * STEP)
    assert abs(found) > 0.01
    assert by_post[axis] == pytest.approx(found, rel=0.05)


def test_parts_planned_one_by_one_have_no_gradients_by_placement():
    seam = {"line": {"by": [0.1, 0.2]}, "speed": 0.2}
    result = brachis.plan(
        "gantry2",
        start=[0.1, 0.1],
        task_space=["x", "y"],
        program=[{"move": "next"}, {"path": [seam], "path_start": [0.3, 0.2]}],
        effort="single",
    )
    notes = {entry.subject: entry.note for entry in result.gradients}
    assert "parts were planned one by one" in notes["path"]
    assert notes["base"] == notes["path"]
