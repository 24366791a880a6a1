"""Moving a workpiece or the base: what is found, what is written, what is refused."""

from dataclasses import replace

import numpy as np
import pinocchio
import pytest
import yaml

import brachis
from brachis.apps.place import read_range, write_task
from brachis.errors import InputError, UnknownNameError
from brachis.robot.plausibility import PlausibilityWarning
from brachis.task import Placement
from support.movable import TASK

RANGES = {"x": (-0.4, 0.2), "yaw_deg": (-30.0, 30.0)}


def tool_at_start(result):
    """Position of the tool where the motion begins, m."""
    trajectory = result.trajectory
    return trajectory.robot.tool_placement(trajectory.q[0]).translation


@pytest.fixture(scope="module")
def placing():
    return brachis.place(TASK, ranges=RANGES, starts=3, steps=3)


def test_a_poor_place_becomes_faster(placing):
    assert placing.gain > 0.1
    assert placing.after.verified
    assert placing.after.t_end == min(trial.t_end for trial in placing.trials)


def test_the_change_stays_in_its_ranges(placing):
    assert list(placing.change) == list(RANGES)
    for trial in placing.trials:
        for name, (low, high) in RANGES.items():
            assert low <= trial.change[name] <= high


def test_the_written_task_has_the_faster_motion(placing, tmp_path):
    file = tmp_path / "moved.yaml"
    file.write_text(write_task(placing.task))
    task = brachis.load_task(file)
    assert task == placing.task
    assert task.path_frame == "workpiece"
    again = brachis.plan(task, start_from=placing.after)
    assert again.t_end == pytest.approx(placing.after.t_end, rel=0.01)


def test_the_path_turns_about_its_beginning(placing):
    first = tool_at_start(placing.after)
    assert first[0] == pytest.approx(1.5 + placing.change["x"], abs=1e-6)
    assert first[1] == pytest.approx(-0.3, abs=1e-6)


def test_the_added_frame_has_a_name_that_no_frame_of_the_user_has():
    task = {**TASK, "frames": {"workpiece": {"xyz": [1.0, 0.0, 0.0]}}}
    ranges = {"x": (-0.4, 0.0)}
    placing = brachis.place(task, ranges=ranges, starts=1, steps=1)
    assert placing.moved == placing.task.path_frame == "workpiece_2"
    assert placing.task.frames["workpiece"].xyz == (1.0, 0.0, 0.0)
    assert placing.change["x"] < 0.0


def test_an_unverified_first_plan_is_not_the_fastest(monkeypatch):
    """The first plan is faster than all others, and may not be run."""

    def plan_too_fast(*args, **keywords):
        result = brachis.plan(*args, **keywords)
        report = result.verification
        failed = replace(report.checks[0], value=2.0, limit=1.0)
        checks = (failed, *report.checks[1:])
        return replace(result, verification=replace(report, checks=checks))

    monkeypatch.setattr("brachis.apps.place.move.plan", plan_too_fast)
    ranges = {"x": (0.0, 0.05)}
    placing = brachis.place(TASK, ranges=ranges, starts=2, steps=0)
    assert not placing.before.verified
    assert placing.after.verified
    assert placing.after.t_end > placing.before.t_end
    assert placing.trials[0].t_end == float("inf")
    assert "not verified" in placing.summary()["end time before"]


def test_the_base_moves_while_the_path_stays():
    placing = brachis.place(
        TASK, move="base", ranges={"x": (0.0, 0.3)}, starts=1, steps=2
    )
    first = tool_at_start(placing.after)
    assert first[:2] == pytest.approx([1.5, -0.3], abs=1e-6)
    assert placing.task.robot.mounting.xyz[0] == placing.change["x"] > 0.0
    assert placing.gain > 0.02


def test_places_out_of_reach_are_passed_over():
    placing = brachis.place(TASK, ranges={"x": (-0.1, 4.0)}, starts=4, steps=0)
    times = [trial.t_end for trial in placing.trials]
    assert max(times) == float("inf")
    assert placing.after.verified
    assert len(placing.to_dict()["trials"]) < len(times)


def test_a_range_in_mm_is_told():
    with pytest.warns(PlausibilityWarning, match="ranges.x: the range looks like mm"):
        placing = brachis.place(TASK, ranges={"x": (0.0, 400.0)}, starts=2, steps=0)
    shown = placing.summary()
    assert shown["by"].startswith("nothing: no other place is faster")
    assert shown["places tried"] == "2, 1 without a verified motion"


def test_a_written_program_has_its_task_space():
    path = {key: TASK[key] for key in ("path", "path_start")}
    content = {key: value for key, value in TASK.items() if key not in path}
    content |= {"program": [path, {"move": "next"}], "end": "start"}
    placing = brachis.place(content, ranges={"x": (-0.1, 0.0)}, starts=1, steps=0)
    written = yaml.safe_load(write_task(placing.task))
    assert written["task_space"] == ["x", "y"]
    assert "task_space" not in written["program"][0]
    assert brachis.load_task(written) == placing.task


def test_a_placement_has_no_noise_of_products():
    third = pinocchio.SE3(np.eye(3), np.array([0.1, 0.0, 0.0]))
    assert Placement.model_validate(third * third * third).xyz[0] == 0.3


def test_what_cannot_be_moved_is_refused():
    held = {**TASK, "start": {"joints": [0.3, -1.0, 1.0]}}
    del held["path_start"]
    with pytest.raises(InputError, match="given posture"):
        brachis.place(held, ranges=RANGES)
    with pytest.raises(UnknownNameError, match="frame"):
        brachis.place(TASK, move="table", ranges=RANGES)
    with pytest.raises(InputError, match="no range"):
        brachis.place(TASK, ranges={})
    with pytest.raises(UnknownNameError, match="coordinate"):
        brachis.place(TASK, ranges={"yaw": (0.0, 1.0)})
    with pytest.raises(InputError, match="not a range"):
        brachis.place(TASK, ranges={"x": (1.0, 1.0)})
    with pytest.raises(InputError, match="not a range"):
        read_range("x=3")


def test_paths_in_two_frames_have_no_common_workpiece():
    frames = {"left": {"xyz": [1.2, 0.0, 0.0]}, "right": {"xyz": [1.0, -0.5, 0.0]}}
    parts = [
        {
            "path": {"frame": name, "segments": [{"line": {"by": [0.0, 0.2]}}]},
            "path_start": [0.0, 0.0],
        }
        for name in frames
    ]
    task = {key: TASK[key] for key in ("brachis", "robot", "task_space", "start")}
    task |= {"frames": frames, "program": [parts[0], {"move": "next"}, parts[1]]}
    with pytest.raises(InputError, match="several frames"):
        brachis.place(task, ranges=RANGES)
