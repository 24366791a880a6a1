"""How a task file orients the tool: what is accepted, what comes back, and what every mistake is told."""

import json

import pytest
import yaml

from brachis.errors import TaskError
from brachis.task import (
    ToolPose,
    json_schema,
    load_task,
    task_with,
)

LINE = {"line": {"to": [1, 0, 0]}}


def written(*segments, space="pose"):
    return {
        "brachis": 1,
        "start": {"joints": [0]},
        "task_space": space,
        "path": list(segments),
    }


def task(*segments):
    return load_task(written(*segments))


SEGMENTS = [
    "line: {to: [1, 0, 0]}",
    "{line: {to: [1, 0, 0]}, orientation: null}",
    "{line: {to: [1, 0, 0]}, orientation: fixed}",
    "{line: {to: [1, 0, 0]}, orientation: tangent}",
    "{line: {to: [1, 0, 0]}, orientation: {tangent: {}}}",
    "{line: {to: [1, 0, 0]}, orientation: {tangent: {up: [0, 1, 0]}}}",
    "{line: {to: [1, 0, 0]}, orientation: {rotate: {axis: [0, 0, 2], angle_deg: 90}}}",
    (
        "{line: {to: [1, 0, 0]}, orientation: {rotate: {axis: [0, 0, 2], angle_deg: 90, frame: tool, "
        "profile: smooth}}}"
    ),
    "{line: {to: [1, 0, 0]}, orientation: {to: {quaternion_wxyz: [0.6, 0, 0, -0.8], profile: smooth}}}",
    "{line: {to: [1, 0, 0]}, orientation: {to: {rotation_vector: [0, 0, 1]}}}",
    "{line: {to: [1, 0, 0]}, orientation: {to: {rpy_deg: [1, 2, 3]}}}",
    (
        "spline: {through: [[1, 0, 0], [1, 1, 0]], orientations: [{quaternion_wxyz: [0.6, 0, 0, -0.8]}, "
        "{rpy_deg: [1, 2, 3]}]}"
    ),
    (
        "spline: {through: [[1, 0, 0], [1, 1, 0]], orientations: [{quaternion_wxyz: [0.6, 0, 0, -0.8]}, "
        "{rpy_deg: [1, 2, 3]}], starts_at: [0, 0, 0], starts_oriented: {rotation_vector: [0, 0, 1]}, "
        "relative: true}"
    ),
    "turn: {rotate: {axis: [0, 0, 2], angle_deg: 90}}",
    "turn: {to: {rpy_deg: [1, 2, 3], profile: smooth}}",
]


@pytest.mark.parametrize("text", SEGMENTS)
def test_a_saved_task_comes_back(text):
    segment = yaml.safe_load(text)
    once = task(segment)
    assert load_task(json.loads(json.dumps(once.to_dict(), allow_nan=False))) == once
    validators = pytest.importorskip("jsonschema").validators
    validator = validators.validator_for(json_schema())(json_schema())
    assert validator.is_valid(written(segment))
    assert validator.is_valid(once.to_dict())


MISTAKES = [
    (
        "{line: {to: [1, 0, 0]}, orientation: tangnt}",
        r"path\[0\].orientation: wrong form; found 'tangnt'.*fixed \| tangent \| \{rotate",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: 90}",
        r"path\[0\].orientation: wrong form; found 90",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {}}",
        r"path\[0\].orientation: an orientation along a segment needs exactly one.*\{tangent\}",
    ),
    (
        (
            "{line: {to: [1, 0, 0]}, orientation: {rotate: {axis: [0, 0, 2], angle_deg: 90}, to: "
            "{quaternion_wxyz: [0.6, 0, 0, -0.8]}}}"
        ),
        r"path\[0\].orientation: .*found a mapping with the keys rotate",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {rotat: {}}}",
        r"path\[0\].orientation: .*Did you mean 'rotate'\?",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {rotate: {axis: [0, 0, 1]}}}",
        "rotate.angle_deg: this required key is missing",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {rotate: {axis: [0, 0, 0], angle_deg: 9}}}",
        r"path\[0\].orientation.rotate.axis: a direction cannot have zero length; found \[0.0, 0.0, 0.0\]",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {rotate: {axis: [1, 0], angle_deg: 9}}}",
        r"rotate.axis\[2\]: the list is too short",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {rotate: {axis: [0, 0, 2], angle_deg: 90, frame: base}}}",
        r"path\[0\].orientation.rotate.frame: not one of the allowed values; found 'base'.*'path' or 'tool'",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {rotate: {axis: [0, 0, 2], angle_deg: 90, profile: linear}}}",
        r"path\[0\].orientation.rotate.profile: .*'uniform' or 'smooth'",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {to: {rpy: [0, 0, 0]}}}",
        r"path\[0\].orientation.to: .*the keys rpy; allowed: .*rpy_deg \(roll",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {to: {quaternion: [1, 0, 0, 0]}}}",
        (
            r"path\[0\].orientation.to: an orientation needs exactly one convention.*quaternion_xyzw \(quaternion,"
            r" w last: ROS"
        ),
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {to: {quaternion_wxyz: [0.6, 0, 0, -0.8], rpy_deg: [0, 0, 0]}}}",
        "orientation.to: an orientation needs exactly one convention.*the keys quaternion_wxyz, rpy_deg",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {to: [0, 0, 0]}}",
        r"path\[0\].orientation.to: an orientation needs exactly one.*\(a list\)",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {to: {quaternion_xyzw: [1, 0, 0]}}}",
        r"to.quaternion_xyzw\[3\]: the list is too short",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {to: {quaternion_wxyz: [1, 0, 0, 1]}}}",
        (
            r"path\[0\].orientation.to.quaternion_wxyz: the quaternion's length is 1.41421; found \[1.0, 0.0, 0.0,"
            r" 1.0\]"
        ),
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {to: {quaternion_wxyz: [0.6, 0, 0, -0.8], frame: tool}}}",
        "orientation.to.frame: unknown key.*profile",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {tangent: {up: [0, 0, 0]}}}",
        "orientation.tangent.up: a direction cannot have zero",
    ),
    (
        "{line: {to: [1, 0, 0]}, orientation: {tangent: true}}",
        r"path\[0\].orientation.tangent: wrong type.*a mapping",
    ),
    (
        "turn: fixed",
        r"path\[0\].turn: a turn needs exactly one of its forms.*\{rotate\} \| \{to\}",
    ),
    ("turn: {tangent: {}}", r"path\[0\].turn: a turn needs exactly one of its forms"),
    (
        "{turn: {rotate: {axis: [0, 0, 2], angle_deg: 90}}, orientation: fixed}",
        r"path\[0\].orientation: unknown key.*allowed: blend, stop, dwell, turn",
    ),
    (
        "spline: {through: [[1, 0, 0], [1, 1, 0]], orientations: [{quaternion_wxyz: [0.6, 0, 0, -0.8]}]}",
        (
            r"path\[0\].spline.orientations: the numbers of waypoints and of orientations differ.*found 1; "
            r"allowed: 2"
        ),
    ),
    (
        (
            "spline: {through: [[1, 0, 0], [1, 1, 0]], orientations: [{quaternion_wxyz: [0.6, 0, 0, -0.8]}, "
            "{quaternion_wxyz: [2, 0, 0, 0]}]}"
        ),
        r"path\[0\].spline.orientations\[1\].quaternion_wxyz: the quaternion's length is 2",
    ),
    (
        "spline: {through: [[1, 0, 0]], starts_oriented: {quaternion_wxyz: [0.6, 0, 0, -0.8]}}",
        r"path\[0\].spline.starts_oriented: an orientation at the start requires orientations",
    ),
    (
        (
            "{spline: {through: [[1, 0, 0], [1, 1, 0]], orientations: [{quaternion_wxyz: [0.6, 0, 0, -0.8]}, "
            "{rpy_deg: [1, 2, 3]}]}, orientation: fixed}"
        ),
        r"path\[0\].orientation: the spline already has orientations.*found 'fixed'",
    ),
    ("csv: {}", r"path\[0\].csv.file: this required key is missing"),
]


@pytest.mark.parametrize("segment, message", MISTAKES)
def test_the_error_names_the_key_the_value_and_the_alternatives(segment, message):
    with pytest.raises(TaskError, match=message) as caught:
        task(yaml.safe_load(segment))
    assert "mistakes" not in str(caught.value), "one mistake, one complaint"


def free(path_start, space="pose"):
    return load_task(
        written(LINE, space=space) | {"start": "free", "path_start": path_start}
    )


def test_another_start_of_the_path_takes_the_place_of_the_first_one():
    task = free({"position": [1, 2, 3], "rpy_deg": [0, 0, 90]})
    other = task_with(
        task, path_start={"position": [1, 2, 3], "kuka_abc_deg": [90, 0, 0]}
    )
    assert other.path_start == ToolPose.model_validate(
        {"position": [1, 2, 3], "kuka_abc_deg": [90, 0, 0]}
    )


WRONG_STARTS = [
    (
        "[1, 2, 3, 1, 0, 0, 0]",
        "pose",
        r"path_start: a list does not state the convention.*quaternion_xyzw \(quaternion, w last: ROS",
    ),
    (
        "position: [1, 2, 3]",
        "pose",
        r"path_start: an orientation needs exactly one convention.*kuka_abc_deg \(A",
    ),
    (
        "rpy_deg: [1, 2, 3]",
        "pose_free_roll",
        "path_start.position: this required key is missing",
    ),
    (
        "{position: [1, 2, 3], rpy_deg: [1, 2, 3]}",
        "position",
        "path_start: a position with an orientation needs",
    ),
    (
        "7",
        "pose",
        r"path_start: wrong form; found 7.*\{position: \[x, y, z\], rpy_deg: \[...\]\}",
    ),
    (
        "null",
        "pose",
        (
            r"path_start: this key is missing: nothing else states.*allowed: \{position: \[x, "
            r"y, z\], rpy_deg: \[...\]\}, or another convention"
        ),
    ),
]


@pytest.mark.parametrize("path_start, space, message", WRONG_STARTS)
def test_the_error_says_what_is_wrong_with_the_start_of_a_path(
    path_start, space, message
):
    with pytest.raises(TaskError, match=message):
        free(yaml.safe_load(path_start), space)
