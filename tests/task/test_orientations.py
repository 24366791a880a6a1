"""How a task file orients the tool: what is accepted, what comes back, and what every mistake is told."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as SciPyRotation

import brachis
from brachis.errors import TaskError
from brachis.task import (
    ToolPose,
    json_schema,
    load_task,
    task_with,
)

LINE = {"line": {"to": [1, 0, 0]}}
ROTATE = {"rotate": {"axis": [0, 0, 2], "angle_deg": 90}}
QUATERNION = {"quaternion_wxyz": [0.6, 0, 0, -0.8]}
SPLINE = {
    "through": [[1, 0, 0], [1, 1, 0]],
    "orientations": [QUATERNION, {"rpy_deg": [1, 2, 3]}],
}


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
    LINE,
    LINE | {"orientation": None},
    LINE | {"orientation": "fixed"},
    LINE | {"orientation": "tangent"},
    LINE | {"orientation": {"tangent": {}}},
    LINE | {"orientation": {"tangent": {"up": [0, 1, 0]}}},
    LINE | {"orientation": ROTATE},
    LINE
    | {
        "orientation": {
            "rotate": ROTATE["rotate"] | {"frame": "tool", "profile": "smooth"}
        }
    },
    LINE | {"orientation": {"to": QUATERNION | {"profile": "smooth"}}},
    LINE | {"orientation": {"to": {"rotation_vector": [0, 0, 1]}}},
    LINE | {"orientation": {"to": {"rpy_deg": [1, 2, 3]}}},
    {"spline": SPLINE},
    {
        "spline": SPLINE
        | {
            "starts_at": [0, 0, 0],
            "starts_oriented": {"rotation_vector": [0, 0, 1]},
            "relative": True,
        }
    },
    {"turn": ROTATE},
    {"turn": {"to": {"rpy_deg": [1, 2, 3], "profile": "smooth"}}},
]


@pytest.mark.parametrize("segment", SEGMENTS, ids=json.dumps)
def test_round_trip(segment):
    once = task(segment)
    assert load_task(json.loads(json.dumps(once.to_dict(), allow_nan=False))) == once
    validators = pytest.importorskip("jsonschema").validators
    validator = validators.validator_for(json_schema())(json_schema())
    assert validator.is_valid(written(segment))
    assert validator.is_valid(once.to_dict())


MISTAKES = [
    (
        LINE | {"orientation": "tangnt"},
        [
            "path[0].orientation: wrong form; found 'tangnt'",
            "fixed | tangent | {rotate",
        ],
    ),
    (LINE | {"orientation": 90}, ["path[0].orientation: wrong form; found 90"]),
    (
        LINE | {"orientation": {}},
        [
            "path[0].orientation: an orientation along a segment needs exactly one",
            "{tangent}",
        ],
    ),
    (
        LINE | {"orientation": ROTATE | {"to": QUATERNION}},
        ["path[0].orientation: ", "found a mapping with the keys rotate"],
    ),
    (
        LINE | {"orientation": {"rotat": {}}},
        ["path[0].orientation: ", "Did you mean 'rotate'?"],
    ),
    (
        LINE | {"orientation": {"rotate": {"axis": [0, 0, 1]}}},
        ["rotate.angle_deg: this key is required, and missing"],
    ),
    (
        LINE | {"orientation": {"rotate": {"axis": [0, 0, 0], "angle_deg": 9}}},
        [
            "path[0].orientation.rotate.axis: a direction cannot have zero length; found [0.0, 0.0, 0.0]"
        ],
    ),
    (
        LINE | {"orientation": {"rotate": {"axis": [1, 0], "angle_deg": 9}}},
        ["rotate.axis[2]: the list is too short"],
    ),
    (
        LINE | {"orientation": {"rotate": ROTATE["rotate"] | {"frame": "base"}}},
        [
            "path[0].orientation.rotate.frame: not one of the allowed values; found 'base'",
            "'path' or 'tool'",
        ],
    ),
    (
        LINE | {"orientation": {"rotate": ROTATE["rotate"] | {"profile": "linear"}}},
        ["path[0].orientation.rotate.profile: ", "'uniform' or 'smooth'"],
    ),
    (
        LINE | {"orientation": {"to": {"rpy": [0, 0, 0]}}},
        ["path[0].orientation.to: ", "the keys rpy; allowed: ", "rpy_deg (roll"],
    ),
    (
        LINE | {"orientation": {"to": {"quaternion": [1, 0, 0, 0]}}},
        [
            "path[0].orientation.to: an orientation needs exactly one convention",
            "quaternion_xyzw (quaternion, w last: ROS",
        ],
    ),
    (
        LINE | {"orientation": {"to": QUATERNION | {"rpy_deg": [0, 0, 0]}}},
        [
            "orientation.to: an orientation needs exactly one convention",
            "the keys quaternion_wxyz, rpy_deg",
        ],
    ),
    (
        LINE | {"orientation": {"to": [0, 0, 0]}},
        ["path[0].orientation.to: an orientation needs exactly one", "(a list)"],
    ),
    (
        LINE | {"orientation": {"to": {"quaternion_xyzw": [1, 0, 0]}}},
        ["to.quaternion_xyzw[3]: the list is too short"],
    ),
    (
        LINE | {"orientation": {"to": {"quaternion_wxyz": [1, 0, 0, 1]}}},
        [
            "path[0].orientation.to.quaternion_wxyz: the quaternion's length is 1.41421; found [1.0, 0.0, 0.0, 1.0]"
        ],
    ),
    (
        LINE | {"orientation": {"to": QUATERNION | {"frame": "tool"}}},
        ["orientation.to.frame: unknown key", "profile"],
    ),
    (
        LINE | {"orientation": {"tangent": {"up": [0, 0, 0]}}},
        ["orientation.tangent.up: a direction cannot have zero"],
    ),
    (
        LINE | {"orientation": {"tangent": True}},
        ["path[0].orientation.tangent: wrong type", "a mapping"],
    ),
    (
        {"turn": "fixed"},
        ["path[0].turn: a turn needs exactly one of its forms", "{rotate} | {to}"],
    ),
    (
        {"turn": {"tangent": {}}},
        ["path[0].turn: a turn needs exactly one of its forms"],
    ),
    (
        {"turn": ROTATE, "orientation": "fixed"},
        ["path[0].orientation: unknown key", "allowed: blend, stop, dwell, turn"],
    ),
    (
        {"spline": SPLINE | {"orientations": [QUATERNION]}},
        [
            "path[0].spline.orientations: the numbers of waypoints and of orientations differ",
            "found 1; allowed: 2",
        ],
    ),
    (
        {
            "spline": SPLINE
            | {"orientations": [QUATERNION, {"quaternion_wxyz": [2, 0, 0, 0]}]}
        },
        [
            "path[0].spline.orientations[1].quaternion_wxyz: the quaternion's length is 2"
        ],
    ),
    (
        {"spline": {"through": [[1, 0, 0]], "starts_oriented": QUATERNION}},
        [
            "path[0].spline.starts_oriented: an orientation at the start needs orientations"
        ],
    ),
    (
        {"spline": SPLINE, "orientation": "fixed"},
        [
            "path[0].orientation: the spline already has orientations",
            "found 'fixed'",
        ],
    ),
    ({"csv": {}}, ["path[0].csv.file: this key is required, and missing"]),
]


@pytest.mark.parametrize(
    ("segment", "expected"),
    MISTAKES,
    ids=[json.dumps(segment) for segment, _ in MISTAKES],
)
def test_every_mistake_is_named(segment, expected):
    with pytest.raises(TaskError) as caught:
        task(segment)
    message = str(caught.value)
    assert "mistakes" not in message, "one mistake, one complaint"
    for text in expected:
        assert text in message


def free(path_start, space="pose"):
    return load_task(
        written(LINE, space=space) | {"start": "free", "path_start": path_start}
    )


def test_a_path_may_start_at_a_pose_in_any_convention():
    turn = SciPyRotation.from_euler("xyz", [20, -35, 110], degrees=True)
    forms = {
        "quaternion_wxyz": np.roll(turn.as_quat(), 1),
        "quaternion_xyzw": turn.as_quat(),
        "rotation_vector": turn.as_rotvec(),
        "rpy_deg": [20, -35, 110],
        "kuka_abc_deg": turn.as_euler("ZYX", degrees=True),
        "staubli_xyz_deg": turn.as_euler("XYZ", degrees=True),
        "fanuc_wpr_deg": [20, -35, 110],
    }
    space = brachis.task_map_of(brachis.robots.iiwa14, "pose")
    for key, values in forms.items():
        task = free({"position": [1, 2, 3], key: values})
        assert load_task(json.loads(json.dumps(task.to_dict()))) == task
        assert task.path_start is not None
        found = space.read(task.path_start, "path_start")
        np.testing.assert_allclose(
            found, [1, 2, 3, *turn.as_matrix().ravel()], atol=1e-14
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
        [1, 2, 3, 1, 0, 0, 0],
        "pose",
        [
            "path_start: a list does not state its convention",
            "quaternion_xyzw (quaternion, w last: ROS",
        ],
    ),
    (
        {"position": [1, 2, 3]},
        "pose",
        ["path_start: an orientation needs exactly one convention", "kuka_abc_deg (A"],
    ),
    (
        {"rpy_deg": [1, 2, 3]},
        "pose_free_roll",
        ["path_start.position: this key is required"],
    ),
    (
        {"position": [1, 2, 3], "rpy_deg": [1, 2, 3]},
        "position",
        ["path_start: a position with an orientation needs"],
    ),
    (
        7,
        "pose",
        ["path_start: wrong form; found 7", "{position: [x, y, z], rpy_deg: [...]}"],
    ),
    (
        None,
        "pose",
        [
            "path_start: with a free start posture, the start of the path is missing",
            "allowed: {position: [x, y, z], ...} with one of",
        ],
    ),
]


@pytest.mark.parametrize(("path_start", "space", "expected"), WRONG_STARTS, ids=str)
def test_wrong_starts_of_a_path(path_start, space, expected):
    with pytest.raises(TaskError) as caught:
        free(path_start, space)
    for text in expected:
        assert text in str(caught.value)
