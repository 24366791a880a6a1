"""Every way in which a path can be wrong, and what is said about it."""

import re

import numpy as np
import pytest
import yaml

from brachis.errors import PathError
from brachis.path.joins import Join, row_corner, septic
from support.poses import row_path

X, XY, XYZ, XYW = ["x"], ["x", "y"], ["x", "y", "z"], ["x", "y", "yaw"]
RIGHT = {"line": {"by": [1, 0]}}
UP = {"line": {"by": [0, 1]}}


def error_of(segments, rows):
    with pytest.raises(PathError) as caught:
        row_path(segments, [0.0] * len(rows), rows)
    return caught.value


SEGMENTS = [
    (
        "line: {to: [0, 0]}",
        XY,
        r"path\[0\].line.to: the segment has zero length.*found \[0.0, 0.0\]",
    ),
    (
        "line: {to: [1, 2, 3]}",
        XY,
        r"path\[0\].line.to: wrong number.*found 3: \[1.0, 2.0, 3.0\].*2: \[x, y\]",
    ),
    (
        "line: {length: 1, angle_deg: 0}",
        XYZ,
        r"path\[0\].line: .*needs 2 position rows.*\[x, y, z\]",
    ),
    (
        "arc: {center: [1], angle_deg: 9}",
        X,
        r"path\[0\].arc: an arc needs 2 or 3 position rows.*Use line",
    ),
    (
        "helix: {center: [0.3, 0.0], pitch: 0.1, normal: [0, 0, 1]}",
        XY,
        "a helix needs 3 position rows",
    ),
    (
        "circle: {center: [1, 0, 0], turns: 1000000.0, normal: [0, 0, 1]}",
        XYZ,
        r"too many turns.*found 1e\+06 turns; allowed: at most 1000.*periodic",
    ),
    (
        "helix: {center: [1, 0, 0], turns: -1000000.0, pitch: 0.001}",
        XYZ,
        r"too many turns.*found 1e\+06 turns; allowed: at most 1000.*periodic",
    ),
    (
        "arc: {center: [1, 0, 0], angle_deg: 360000000.0, normal: [0, 0, 1]}",
        XYZ,
        r"too many turns.*found 1e\+06 turns; allowed: at most 1000.*periodic",
    ),
    (
        "arc: {center: [0, 0], angle_deg: 9}",
        XY,
        r"path\[0\].arc.center: .*zero length.*centre is at its start",
    ),
    (
        "arc: {center: [1, 0], angle_deg: 0}",
        XY,
        r"path\[0\].arc.angle_deg: the segment has zero length",
    ),
    (
        "arc: {center: [1, 0, 0], angle_deg: 9}",
        XYW,
        r"path\[0\].arc.center: wrong number.*2: \[x, y\]",
    ),
    (
        "circle: {center: [1, 0, 0]}",
        XYZ,
        r"path\[0\].circle.normal: .*found no normal.*via and to",
    ),
    (
        "circle: {center: [1, 0, 0], normal: [1, 0, 1]}",
        XYZ,
        "circle.normal: .*found 135 degrees",
    ),
    (
        "circle: {center: [1, 0], normal: [0, 0, 1]}",
        XY,
        r"path\[0\].circle.normal: .*allowed: no normal",
    ),
    (
        "circle: {center: [1, 0], yaw: tangent}",
        XY,
        r"path\[0\].circle.yaw: the task space has no angle.*Add an angle",
    ),
    (
        "arc: {via: [1, 1], to: [2, 2]}",
        XY,
        r"path\[0\].arc.via: .*lie on a line.*to \[2.0, 2.0\]",
    ),
    (
        "arc: {via: [2, 2], to: [0, 0]}",
        XY,
        r"path\[0\].arc.to: the segment has zero length",
    ),
    (
        "arc: {via: [1, 2, 3], to: [2, 2]}",
        XY,
        r"path\[0\].arc.via: wrong number of coordinates",
    ),
    (
        "spline: {through: [[1, 1], [1]]}",
        XY,
        r"path\[0\].spline.through\[1\]: wrong number.*2: \[x, y\]",
    ),
    (
        "spline: {through: [[0, 0], [1, 1], [1, 1]]}",
        XY,
        r"spline.through\[2\]: a waypoint repeats the previous one",
    ),
    (
        "spline: {through: [[0, 0]]}",
        XY,
        r"path\[0\].spline.through: the segment has zero length",
    ),
    (
        (
            "spline: {through: [[1000000000000.0, 0], [1000000000000.0, 1.0e-06], [1000000000000.0, 2.0e-06], [0,"
            " 0]]}"
        ),
        XY,
        r"no spline goes through the waypoints.*found distances from 1e-06 to 1e\+12.*similar distances",
    ),
    (
        "spline: {through: [[1, 1]], starts_at: [0, 0.0002]}",
        XY,
        r"path\[0\].spline.starts_at: the segment does not start where.*x = 0, y = 0, 0.0002 m off.*relative: true",
    ),
    (
        "spline: {through: [[1, 1]], starts_at: [0]}",
        XY,
        r"path\[0\].spline.starts_at: wrong number of coord",
    ),
    (
        "spline: {through: [[1, 1]], orientations: [{rpy_deg: [0, 0, 0]}]}",
        XY,
        (
            r"path\[0\].spline.orientations: orientations need a task space of poses.*\[x, y\].*Set task_space: "
            r"pose"
        ),
    ),
    (
        "{line: {by: [1, 0]}, orientation: fixed}",
        XY,
        r"path\[0\].orientation: this orientation needs.*found task_space \[x, y\]",
    ),
    (
        "turn: {to: {rpy_deg: [0, 0, 9]}}",
        XYZ,
        r"path\[0\].turn: this turn needs.*Set task_space: pose",
    ),
    (
        "turn: {to: {rpy_deg: [0, 0, 9]}}",
        XYW,
        r"path\[0\].turn: this turn needs.*line: \{by: \[..., angle\]\}",
    ),
]


@pytest.mark.parametrize("segment, rows, message", SEGMENTS)
def test_the_error_names_what_is_wrong_with_a_segment(segment, rows, message):
    assert re.search(message, str(error_of([yaml.safe_load(segment)], rows)))


def test_the_key_counts_segments():
    assert "path[1].line.by: " in str(error_of([RIGHT, {"line": {"by": [0, 0]}}], XY))


def test_a_corner_names_place_angle_and_key():
    error = error_of([RIGHT, UP], XY)
    assert str(error) == (
        "path[0] to path[1], at s = 0.5, x = 1, y = 0: the path must be smooth to the third derivative; found a corner "
        "of 90 degrees; allowed: consecutive segments that match up to the third derivative. Set path[0].blend (m) to "
        "round it, or path[0].stop: true to stop there"
    )
    assert error.s_interval == pytest.approx((0.5, 0.5))


@pytest.mark.parametrize(
    "angle, advice",
    [
        (180.0, "the third derivative. Set path[0].stop: true to stop there"),
        (172.5, "the third derivative. Set path[0].stop: true to stop there"),
        (171.5, "the third derivative. Set path[0].blend (m) to round it, or path[0]"),
    ],
)
def test_a_way_back_is_offered_no_blend(angle, advice):
    back = {"line": {"length": 0.5, "angle_deg": angle}}
    assert advice in str(error_of([RIGHT, back], XY))
    blended = [RIGHT | {"blend": 0.01}, back]
    if "blend" in advice:
        row_path(blended, [0.0, 0.0], XY)
    else:
        message = str(error_of(blended, XY))
        assert "too sharp for a blend" in message
        assert "allowed: more than 0.2" in message


def test_the_error_names_all_corners():
    assert "likewise path[1], path[2]" in str(
        error_of([RIGHT, UP, {"line": {"by": [0, -1]}}, RIGHT], XY)
    )
    assert "likewise path[1], path[3]" in str(
        error_of([RIGHT, UP, RIGHT, RIGHT, UP], XY)
    )


@pytest.mark.parametrize(
    "segments, rows, message",
    [
        (
            "[{line: {by: [1, 0]}}, {arc: {center: [1, 0.5], angle_deg: 90}}]",
            ["x", "y"],
            "a curvature jump of 2 1/m",
        ),
        (
            "[{arc: {center: [0, 1], angle_deg: 90}}, {arc: {center: [0.5, 1], angle_deg: 90}}]",
            ["x", "y"],
            "a curvature jump of 1 1/m",
        ),
        (
            "[{line: {by: [1, 0, 1]}}, {line: {by: [1, 0, 3]}}]",
            ["x", "y", "yaw"],
            "in yaw alone",
        ),
        (
            "[{spline: {through: [[1, 1], [2, 0]]}}, {line: {by: [1, 0]}}]",
            ["x", "y"],
            "a corner of ",
        ),
    ],
)
def test_the_error_says_what_jumps_at_a_join(segments, rows, message):
    assert message in str(error_of(yaml.safe_load(segments), rows))


@pytest.mark.parametrize(
    "order, jump, expected",
    [
        (1, [0.1, 0.0], "the parameter's speed changing from 1 to 1.1"),
        (1, [-1.0, 0.0], "the parameter's speed changing from 1 to 0"),
        (1, [-1.0, 1.0], "a corner of 90 degrees"),
        (2, [0.0, 0.1], "a curvature jump of 0.1 1/m"),
        (3, [0.0, 0.1], "a jump of 0.1 1/m^2 in the third derivative"),
        (3, [0.0, 1e-8], None),
    ],
)
def test_a_join_compares_every_derivative(order, jump, expected):
    before, after, far = np.zeros((3, 4, 2))
    before[1] = after[1] = far[1] = [1.0, 0.0]
    far[0] = [2.0, 1.0]
    after[order] += jump
    first = septic(-far, before, 2.0)
    second = septic(after, far, 2.0)
    corner = row_corner(Join(first, second, 0, 0.5, ("x", "y")))
    assert (corner and corner.found) == expected


def test_a_blend_that_is_too_long_is_told_the_longest():
    short = {"line": {"by": [0, 0.3]}}
    error = error_of([RIGHT | {"blend": 0.2}, short], XY)
    assert "path[0].blend: " in str(error)
    assert (
        "longer than half of a neighbouring segment; found 0.2 m; allowed: at most 0.15 m"
        in str(error)
    )
    assert error.s_interval == pytest.approx((1 / 1.3, 1 / 1.3))
    row_path([RIGHT | {"blend": 0.15}, short], [0.0, 0.0], XY)


@pytest.mark.parametrize(
    "length, written",
    [
        (0.3 - 0.27, "0.015 m"),  # which is 2.7e-17 m less than 0.03
        (2.0 / 3.0, "0.333333 m"),
        (24.0, "12 m"),
        (1e-5 / 3.0, "1e-06 m"),
    ],
)
def test_the_longest_blend_has_few_digits_and_fits_as_it_is_written(length, written):
    segments = [RIGHT | {"line": {"by": [50, 0]}, "blend": 20.0}]
    segments.append({"line": {"by": [0, length]}})
    longest = str(error_of(segments, XY)).split("at most ")[1]
    assert longest.startswith(written)
    segments[0]["blend"] = float(longest.split(" m")[0])
    row_path(segments, [0.0, 0.0], XY)


def test_neighbouring_blends_do_not_overlap():
    segments = [RIGHT | {"blend": 0.5}, UP | {"blend": 0.51}, RIGHT]
    assert "path[1].blend: " in str(error_of(segments, XY))


def test_a_blend_beside_a_turn_on_the_spot():
    segments = [{"line": {"by": [1, 0, 0]}, "blend": 0.1}, {"line": {"by": [0, 0, 1]}}]
    assert "a blend needs motion of the position on both sides" in str(
        error_of(segments, XYW)
    )
