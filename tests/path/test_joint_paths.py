"""Paths of joints: what they may consist of, in which order the joints stand, and what is refused."""

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from brachis.errors import BrachisError, PathError, TaskError
from brachis.path import build_path
from brachis.robot.task_map.protocol import joint_rows
from brachis.task import task_with

ROWS = joint_rows(["a", "b", "x"])
START = [0.1, 0.2, 0.3]
CLAMPED = {
    "degree": 4,
    "knots": [0] * 5 + [1] * 5,
    "control_points": [START, *np.eye(3).tolist(), [1, 1, 1]],
}


def task(path, **keys):
    return task_with(start=START, task_space="joints", path=path, **keys)


def build(path, start=START):
    return build_path(task(path).path, start, ROWS)


def at(path, s):
    return path.sample(np.atleast_1d(s)).target


def test_a_spline_passes_its_waypoints():
    path = build([{"spline": {"through": [[0.5, 0.5, 0.5], [0.1, 0.9, 0.2]]}}])
    chord = np.linalg.norm([0.4, 0.3, 0.2])
    whole = chord + np.linalg.norm([0.4, 0.4, 0.3])
    assert_allclose(at(path, chord / whole), [[0.5, 0.5, 0.5]], atol=1e-12)


def test_joints_may_stand_in_another_order(tmp_path):
    plain = build([{"spline": {"through": [[0.5, 0.6, 0.7], [0.1, 0.9, 0.2]]}}])
    through = [[0.7, 0.5, 0.6], [0.2, 0.1, 0.9]]
    file = tmp_path / "path.csv"
    file.write_text("x,a,b\n0.3,0.1,0.2\n0.7,0.5,0.6\n0.2,0.1,0.9\n")
    s = np.linspace(0.0, 1.0, 7)
    for segment in (
        {"spline": {"through": through, "joints": ["x", "a", "b"]}},
        {"csv": {"file": str(file)}},
    ):
        assert_allclose(at(build([segment]), s), at(plain, s), atol=1e-14)


def test_the_error_names_a_column_of_joints_in_degrees(tmp_path):
    (tmp_path / "path.csv").write_text("a_deg,b_deg\n0,0\n10,20\n")
    with pytest.raises(TaskError, match=r"path\.csv: line 1: .*columns a_deg, b_deg"):
        task([{"csv": {"file": str(tmp_path / "path.csv")}}])


def test_bsplines_are_taken_as_they_are():
    path = build([{"bspline": CLAMPED}])
    assert_allclose(at(path, [0.0, 1.0]), [START, [1, 1, 1]], atol=1e-15)
    moved = build([{"bspline": {**CLAMPED, "relative": True}}], [1.1, 0.2, 0.3])
    assert_allclose(at(moved, 1.0), [[2, 1, 1]], atol=1e-15)
    with pytest.raises(PathError, match="does not start where"):
        build([{"bspline": CLAMPED}], [0.2, 0.2, 0.3])


REFUSED = [
    ("circle: {center: [0, 0, 0]}", "a joint path cannot have this segment"),
    (
        "turn: {rotate: {axis: [0, 0, 1], angle_deg: 3}}",
        "a joint path cannot have this segment",
    ),
    ("line: {length: 1, angle_deg: 3}", "needs 2 position rows"),
    ("line: {by: [1, 2]}", "found 2: .*joint a, joint b, joint x"),
    (
        "spline: {through: [[1, 1, 1]], joints: [a, b, c]}",
        r"spline\.joints.*'c'.*a, b, x",
    ),
    ("spline: {through: [[1, 1]], joints: [a, b]}", "must be named exactly once"),
    ("{line: {by: [1, 2, 3]}, orientation: fixed}", "needs a task space of poses"),
    (
        (
            "bspline: {degree: 4, knots: [0, 0, 0, 0, 0, 1, 1, 1, 1, 1], control_points: [[0.1, 0.2], [0.1, 0.2],"
            " [0.1, 0.2], [0.1, 0.2], [0.1, 0.2]]}"
        ),
        r"control_points\[0\]: wrong number",
    ),
    (
        (
            "bspline: {degree: 4, knots: [0, 0, 0, 0, 0, 1, 1, 1, 1, 1], control_points: [[0.1, 0.2, 0.3], [0.1, "
            "0.2, 0.3], [0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [0.1, 0.2, 0.3]]}"
        ),
        "zero length",
    ),
]


@pytest.mark.parametrize("segment, message", REFUSED)
def test_the_error_says_what_a_path_of_joints_cannot_be(segment, message):
    with pytest.raises(BrachisError, match=message):
        build([yaml.safe_load(segment)])


def test_a_corner_is_refused_with_its_place():
    with pytest.raises(
        PathError, match=r"a corner of 90 degrees.*path\[0\].*blend \(rad, m\)"
    ):
        build([{"line": {"by": [0.3, 0, 0]}}, {"line": {"by": [0, 0.3, 0]}}])


@pytest.mark.parametrize(
    "parts, words",
    [
        ({"degree": 3}, "degree"),
        (
            {"knots": [0] * 5 + [1] * 6},
            "the number of knots is wrong; found 11; allowed: 10",
        ),
        ({"knots": [0, 0, 0, 0, 0.1, *[1] * 5]}, "not clamped"),
        ({"knots": [1] * 5 + [0] * 5}, "not clamped"),
        (
            {"knots": [0] * 5 + [0.5, 0.5] + [1] * 5, "control_points": [START] * 7},
            "occurs 2 times, so that .* third jumps; .*allowed: at most 1",
        ),
    ],
)
def test_bsplines_that_are_none(parts, words):
    with pytest.raises(TaskError, match=words):
        task([{"bspline": {**CLAMPED, **parts}}])


@pytest.mark.parametrize(
    "key, more",
    [
        ("redundant_joints", {"redundant_joints": ["a"]}),
        ("branch", {"branch": "elbow up"}),
        ("search.guesses", {"search": {"guesses": "numeric"}}),
    ],
)
def test_there_is_nothing_to_choose(key, more):
    with pytest.raises(TaskError, match=f"{key}: a joint path leaves no choice"):
        task([{"line": {"by": [1, 0, 0]}}], **more)
