"""Stops of a path, where it may have corners, and the parts of a path between two places."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.errors import PathError
from brachis.path import build_path
from brachis.path.sequence import PathFrame
from brachis.robot.task_map.protocol import POSE_ROWS
from brachis.task import Placement, task_with

RIGHT = {"line": {"by": [0.3, 0.0, 0.0]}}
UP = {"line": {"by": [0.0, 0.0, 0.1]}}
TURN = {"turn": {"rotate": {"axis": [0, 0, 1], "angle_deg": 90}}}
POSE = [0.5, 0.0, 0.4, *np.eye(3).ravel()]


def path_of(segments, space="position", frame=None):
    task = task_with(start=[0], task_space=space, path=segments)
    start, rows = (POSE, POSE_ROWS) if space == "pose" else (POSE[:3], ("x", "y", "z"))
    return build_path(task.path, start, rows, frame)


def test_a_path_has_corners_at_its_stops_alone():
    path = path_of([{**RIGHT, "stop": True}, {**UP, "dwell": 0.5}, RIGHT])
    assert_allclose(path.stops, [3 / 7, 4 / 7], atol=1e-15)
    assert len(path_of([RIGHT, RIGHT]).stops) == 0
    with pytest.raises(PathError, match=r"path\[1\].blend .* or path\[1\].stop: true"):
        path_of([{**RIGHT, "stop": True}, UP, RIGHT])


def test_the_tool_turns_on_the_spot_at_a_stop():
    with pytest.raises(PathError, match=r"a stop: .*set path\[0\].stop: true"):
        path_of([RIGHT, {**TURN, "stop": True}, UP], "pose")
    path = path_of([{**RIGHT, "stop": True}, {**TURN, "stop": True}, UP], "pose")
    assert len(path.stops) == 2
    sample = path.sample(path.stops)
    assert_allclose(sample.target[:, :3], [[0.8, 0, 0.4]] * 2, atol=1e-15)
    assert np.abs(sample.xi[0, :3]).max() < 1e-12
    assert np.abs(sample.xi[1, 3:]).max() < 1e-12


FRAME = PathFrame.of(
    Placement(xyz=(0.1, 0.2, 0.3), rpy_deg=(0, 0, 30)), ("x", "y", "z")
)


@pytest.mark.parametrize("space, frame", [("position", FRAME), ("pose", None)])
def test_a_part_of_a_path_is_the_path(space, frame):
    """Inside its ends to rounding, in the same s and frame, to all derivatives."""
    spline = {
        "spline": {"through": [[0.1, 0.1, 0.0], [0.2, 0.3, 0.1]], "relative": True}
    }
    path = path_of(
        [{**RIGHT, "blend": 0.05}, {**UP, "stop": True}, spline], space, frame
    )
    begin, end = 0.13, 0.87
    part = path.between(begin, end)
    assert part.breaks[[0, -1]].tolist() == [begin, end]
    inside = (path.knots > begin) & (path.knots < end)
    assert_array_equal(part.knots[1:-1], path.knots[inside])
    assert_array_equal(part.stops, path.stops)
    s = np.linspace(begin, end, 1000)
    one, other = path.sample(s), part.sample(s)
    for name in ("target", "xi", "xi_ds", "xi_dds"):
        expected = getattr(one, name)
        off = 1e-11 * np.abs(expected).max()
        assert_allclose(getattr(other, name), expected, atol=off)


def test_a_part_goes_on_as_it_begins_and_ends():
    path = path_of([{**RIGHT, "stop": True}, {**UP, "stop": True}, RIGHT])
    first, last = path.stops
    middle = path.between(first, last)
    sample = middle.sample([first, last, first - 0.1, last + 0.1])
    assert_allclose(sample.xi, [[0.0, 0.0, 0.7]] * 4, atol=1e-12)
    assert_allclose(sample.target[2:, 2], [0.4 - 0.07, 0.5 + 0.07])
    assert len(middle.stops) == 0
    assert middle.length == pytest.approx(0.1)
    # The path itself has the side behind the stop.
    assert_allclose(path.sample([last]).xi, [[0.7, 0.0, 0.0]], atol=1e-12)
    before = path.between(0.0, first).sample([first]).xi
    assert_allclose(before, [[0.7, 0.0, 0.0]], atol=1e-12)
