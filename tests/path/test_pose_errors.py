"""Every way in which a path of poses can be wrong, and what is said about it."""

import re

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from brachis.errors import PathError
from brachis.path import build_path
from brachis.robot.task_map.protocol import POSE_ROWS
from brachis.task import CsvSegment, PointFile
from support.poses import pose, pose_path

RIGHT = {"line": {"by": [1, 0, 0]}}
TURN = {"rotate": {"axis": [0, 0, 1], "angle_deg": 90}}
TILT = {"rotate": {"axis": [1, 0, 0], "angle_deg": 90}}


def error_of(segments):
    with pytest.raises(PathError) as caught:
        pose_path(segments, np.zeros(3), Rotation.identity())
    return caught.value


SEGMENTS = [
    (
        "line: {by: [0, 0, 0]}",
        r"path\[0\].line.by: the segment has zero length.*turn: \{...\} turns the tool",
    ),
    (
        "turn: {to: {rpy_deg: [0, 0, 0]}}",
        r"path\[0\].turn: the turn has zero length.*an orientation that differs",
    ),
    (
        "turn: {to: {rpy_deg: [180, 0, 0]}}",
        r"path\[0\].turn.to: the orientation is half a turn away.*rotate: \{axis",
    ),
    (
        "{line: {by: [1, 0, 0]}, orientation: {to: {rpy_deg: [180, 0, 0]}}}",
        r"path\[0\].orientation.to: .*found 180 degrees.*less than 180",
    ),
    (
        "circle: {center: [1, 0, 0], normal: [0, 0, 1], yaw: tangent}",
        "circle.yaw: .*orientation: tangent",
    ),
    (
        "{line: {by: [0, 0, 1]}, orientation: tangent}",
        r"path\[0\].orientation: the tangent becomes parallel to up.*found 0 degrees.*up: \[...\]",
    ),
    (
        "{circle: {center: [1, 0, 0], normal: [0, 1, 0]}, orientation: {tangent: {up: [0, 0.001, 1]}}}",
        (
            r"path\[0\].orientation: the tangent becomes parallel.*between them at x = 0, y = 0, z = 0.*1 degree "
            r"or more"
        ),
    ),
    (
        "{spline: {through: [[1, 0, 0], [1.000002, 0, 0], [0, 0, 0]]}, orientation: tangent}",
        r"path\[0\].orientation: the curve almost stops.*found x = 1.17",
    ),
    (
        (
            "spline: {through: [[1, 0, 0], [1, 1, 0], [1, 1, 1]], orientations: [{rpy_deg: [0, 0, 0]}, {rpy_deg: "
            "[0, 0, 9]}, {rpy_deg: [0, 0, 0]}], starts_oriented: {rotation_vector: [0, 0, 0.2]}}"
        ),
        r"path\[0\].spline.starts_oriented: .*an orientation that is 0.2 rad off",
    ),
    (
        (
            "spline: {through: [[1, 0, 0], [1, 1, 0], [1, 1, 1]], orientations: [{rpy_deg: [0, 0, 90]}, "
            "{rpy_deg: [0, 0, -90]}, {rpy_deg: [0, 0, 0]}]}"
        ),
        r"path\[0\].spline.orientations\[1\]: .*half a turn",
    ),
    (
        "{spline: {through: [[1, 0, 0], [1, 1.0e-09, 0], [2, 1, 0]]}, orientation: fixed}",
        (
            r"path\[0\].spline.through\[1\]: a waypoint repeats the previous one; found .*1e-09 \(m or rad\) away.*"
            r"Remove one of the two"
        ),
    ),
    (
        (
            "spline: {through: [[1, 0, 0], [1.01, 0, 0], [1.02, 0, 0], [2, 0, 0], [3, 0, 0]], orientations: "
            "[{rpy_deg: [0, 0, 170]}, {rpy_deg: [0, 0, 0]}, {rpy_deg: [0, 0, 170]}, {rpy_deg: [0, 0, 0]}, "
            "{rpy_deg: [0, 0, 170]}]}"
        ),
        r"path\[0\].spline.orientations\[.*differ too much over too short a distance.*0.5 or more",
    ),
]


@pytest.mark.parametrize("segment, message", SEGMENTS)
def test_the_error_names_what_is_wrong_with_a_segment(segment, message):
    assert re.search(message, str(error_of([yaml.safe_load(segment)])))


def test_a_jump_of_the_turning_rate_is_told_in_words():
    error = error_of([RIGHT | {"orientation": TURN}, RIGHT])
    assert str(error) == (
        "path[0] to path[1], at s = 0.5, x = 1, y = 0, z = 0: the path must be smooth to the third derivative; found "
        "the tool's turning rate jumps by 1.571 rad/m; allowed: consecutive segments that match up to the third "
        "derivative. Set profile: smooth where the tool turns, or path[0].blend (m) to round it, or "
        "path[0].stop: true to stop there"
    )
    assert error.s_interval == (0.5, 0.5)


@pytest.mark.parametrize(
    "segments, message",
    [
        (
            (
                "[{line: {by: [1, 0, 0]}, orientation: {rotate: {axis: [0, 0, 1], angle_deg: 90}}}, {line: {by: [1, "
                "0, 0]}, orientation: {rotate: {axis: [1, 0, 0], angle_deg: 90}}}]"
            ),
            "the tool's turning rate jumps by 2.221 rad/m",
        ),
        (
            (
                "[{turn: {rotate: {axis: [0, 0, 1], angle_deg: 90}}}, {turn: {rotate: {axis: [1, 0, 0], angle_deg: "
                "90}}}]"
            ),
            "the tool's turning rate jumps by 1.414 rad/rad.*Set profile: smooth where",
        ),
        (
            (
                "[{turn: {rotate: {axis: [0, 0, 1], angle_deg: 90}}}, {turn: {rotate: {axis: [0, 0, 1], angle_deg: "
                "90, profile: smooth}}}]"
            ),
            "the tool's turning rate jumps by 1 rad/rad",
        ),
        (
            "[{turn: {rotate: {axis: [0, 0, 1], angle_deg: 90}}}, {line: {by: [1, 0, 0]}}]",
            "a stop: .*Turn the tool along a segment, by its orientation",
        ),
        (
            "[{line: {by: [1, 0, 0]}}, {turn: {rotate: {axis: [0, 0, 1], angle_deg: 90}}}]",
            r"a stop: .*or set path\[0\].stop: true",
        ),
        (
            (
                "[{arc: {center: [0, 1, 0], angle_deg: 90, normal: [0, 0, 1]}, orientation: tangent}, {arc: {center: "
                "[0, 1, 0], angle_deg: 90, normal: [0, 0, 1]}}]"
            ),
            "the tool's turning rate jumps by 1 rad/m",
        ),
    ],
)
def test_the_error_says_what_jumps_at_a_join(segments, message):
    assert re.search(message, str(error_of(yaml.safe_load(segments))))


def test_a_blend_beside_a_turn_on_the_spot():
    message = str(error_of([RIGHT | {"blend": 0.1}, {"turn": TURN}]))
    assert "on one side the tool turns on the spot" in message
    assert "Turn the tool along a line" in message


def test_a_blend_in_which_the_tool_turns_too_much():
    fast = {"rotate": {"axis": [0, 0, 1], "angle_deg": 1500}}
    back = {"rotate": {"axis": [0, 0, 1], "angle_deg": -1500}}
    error = error_of(
        [RIGHT | {"orientation": fast, "blend": 0.4}, RIGHT | {"orientation": back}]
    )
    assert str(error).startswith("path[0].blend: path[0] to path[1], at s = 0.5")
    assert (
        "the tool turns too much in the blend; found quaternions interpolated with a quality of "
        in str(error)
    )
    assert error.s_interval == (0.5, 0.5)


def test_a_csv_file_has_to_be_read_before():
    start = pose(np.zeros(3), Rotation.identity())
    with pytest.raises(
        PathError, match=r"path\[0\].csv.file: the file has not been read; found a.csv"
    ):
        build_path([CsvSegment(csv=PointFile(file="a.csv"))], start, POSE_ROWS)
