"""Paths that are travelled backwards, and closed paths that begin elsewhere: places, derivatives, stops and speeds."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.errors import InputError, PathError
from brachis.path import path_of
from brachis.problem.problem import Problem
from brachis.robot import bind
from brachis.task import load_task
from brachis.trajectory import Trajectory

POSE = {"position": [0.5, -0.2, 0.4], "rpy_deg": [180, 0, 0]}
TURN = {"rotate": {"axis": [0, 1, 0], "angle_deg": 20}}
BENT = [
    {"line": {"by": [0.0, 0.2, 0.0]}, "blend": 0.03},
    {"line": {"by": [0.1, 0.0, 0.0]}, "dwell": 0.3},
    {"arc": {"center": [0.5, 0.0, 0.4], "angle_deg": 90, "normal": [0, 0, 1]}},
]
TURNING = [{"line": {"by": [0.0, 0.3, 0.1]}, "orientation": TURN}]
CIRCLE = [{"circle": {"center": [0.5, 0.0, 0.4], "normal": [0, 0, 1]}}]
SIDES = ([0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [-0.2, 0.0, 0.0], [0.0, -0.2, 0.0])
SQUARE = [{"line": {"by": by}, "stop": True} for by in SIDES[:3]] + [
    {"line": {"by": SIDES[3]}}
]


def task_of(path, urdf="iiwa14", **keys):
    known = {"path_start": POSE["position"], "task_space": "position", **keys}
    robot = {"urdf": urdf}
    return load_task(
        {"brachis": 1, "robot": robot, "start": "free", "path": path, **known}
    )


def path_for(path, **keys):
    task = task_of(path, **keys)
    robot = getattr(brachis.robots, keys.get("urdf", "iiwa14"))
    _, task_map = bind(robot, task.task_space)
    return path_of(task_map, task)


def assert_is_shifted(path, written, place, sign):
    """Compare a path with another one at places given by a function of s, for derivatives that do or do not turn."""
    s = np.linspace(0.003, 0.997, 61)
    sample = path.sample(s)
    expected = written.sample(place(s))
    assert_allclose(sample.target, expected.target, atol=1e-12)
    assert_allclose(sample.xi, sign * expected.xi, atol=1e-11)
    assert_allclose(sample.xi_ds, expected.xi_ds, atol=1e-10)
    assert_allclose(sample.xi_dds, sign * expected.xi_dds, atol=1e-7)


@pytest.mark.parametrize(
    "segments, keys",
    [
        (BENT, {}),
        (TURNING, {"path_start": POSE, "task_space": "pose"}),
        (TURNING, {"path_start": POSE, "task_space": "pose_free_roll"}),
        (
            [{"line": {"by": [0.0, 0.2, 1.0]}}],
            {
                "task_space": ["x", "y", "yaw"],
                "path_start": [0.5, 0.0, 0.0],
                "urdf": "scara3",
            },
        ),
        (
            BENT,
            {
                "path_frame": "part",
                "frames": {"part": {"xyz": [0.1, 0, 0], "rpy_deg": [0, 0, 30]}},
            },
        ),
    ],
)
def test_a_reversed_path_has_the_same_places_backwards(segments, keys):
    written = path_for(segments, **keys)
    path = path_for(segments, path_reversed=True, **keys)
    assert path.length == pytest.approx(written.length, rel=1e-12)
    assert_allclose(path.knots, 1.0 - written.knots[::-1], atol=1e-12)
    if not len(written.stops):
        assert_is_shifted(path, written, lambda s: 1.0 - s, -1.0)
    part = path.between(0.2, 0.9)
    assert_allclose(
        part.sample([0.3, 0.8]).target, written.sample([0.7, 0.2]).target, atol=1e-12
    )


def test_stops_and_dwells_are_where_they_were():
    written = path_for(BENT)
    path = path_for(BENT, path_reversed=True)
    assert_allclose(path.stops, 1.0 - written.stops, atol=1e-12)
    assert [*path.dwells.values()] == [0.3]
    # At a stop, a sample is that of the curve after it.
    before, after = path.sample([path.stops[0] - 1e-12, path.stops[0]]).xi
    assert np.linalg.norm(before - after) > 0.1


@pytest.mark.parametrize("is_reversed", [False, True])
def test_a_circle_begins_anywhere(is_reversed):
    written = path_for(CIRCLE)
    path = path_for(CIRCLE, path_begin=0.3, path_reversed=is_reversed)
    sign = -1.0 if is_reversed else 1.0
    assert_is_shifted(path, written, lambda s: (0.3 + sign * s) % 1.0, sign)
    assert len(path.stops) == 0


@pytest.mark.parametrize(
    "begin, is_reversed, stops",
    [
        (0.25, False, [0.25, 0.5, 0.75]),
        (0.25, True, [0.25, 0.5, 0.75]),
        (0.1, False, [0.15, 0.4, 0.65, 0.9]),
        (0.1, True, [0.1, 0.35, 0.6, 0.85]),
    ],
)
def test_a_polygon_stops_at_its_corners_but_where_it_begins(begin, is_reversed, stops):
    path = path_for(SQUARE, path_begin=begin, path_reversed=is_reversed)
    assert_allclose(path.stops, stops, atol=1e-12)
    assert np.isin(path.stops, path.breaks).all()
    assert path.length == pytest.approx(0.8)
    first, last = path.sample([0.0, 1.0]).target
    assert_allclose(first, last, atol=1e-12)
    assert_allclose(first, path_for(SQUARE).sample([begin]).target[0], atol=1e-12)


def test_speeds_of_segments_stay_with_their_segments():
    path = [
        {"line": {"by": [0.0, 0.1, 0.0]}},
        {"line": {"by": [0.0, 0.2, 0.0]}, "speed": 0.1},
        {"line": {"by": [0.0, 0.1, 0.0]}, "speed": 0.1, "blend": 0.03},
        {"line": {"by": [0.1, 0.0, 0.0]}, "speed": 0.1},
        {"line": {"by": [0.1, 0.0, 0.0]}},
    ]
    legs = []
    for is_reversed in (False, True):
        task = task_of(path, path_reversed=is_reversed)
        problem = Problem.of(brachis.robots.iiwa14, task)
        legs.append([(leg.speed, leg.begin, leg.end) for leg in problem.legs])
    turned = [(speed, 1.0 - end, 1.0 - begin) for speed, begin, end in legs[1][::-1]]
    assert [speed for speed, *_ in turned] == [speed for speed, *_ in legs[0]]
    assert_allclose(
        [ends for _, *ends in turned], [ends for _, *ends in legs[0]], atol=1e-9
    )


@pytest.mark.parametrize(
    "path, keys, text",
    [
        (BENT, {"path_begin": 0.5}, "only a closed path can begin elsewhere"),
        (
            [{**SQUARE[0], "dwell": 0.2}, *SQUARE[1:]],
            {"path_begin": 0.25},
            "the path begins where the tool waits",
        ),
        (CIRCLE, {"path_begin": 1.0}, "path_begin"),
        (
            CIRCLE,
            {"path_reversed": True, "start": {"joints": [0] * 7}, "path_start": None},
            "path_start: this key is missing",
        ),
        (
            [{"line": {"to": [0.1] * 7}}],
            {
                "path_reversed": True,
                "start": {"joints": [0] * 7},
                "path_start": None,
                "task_space": "joints",
            },
            "a joint path leaves no choice",
        ),
    ],
)
def test_what_cannot_be_travelled_otherwise_is_refused(path, keys, text):
    with pytest.raises((InputError, PathError), match=text):
        path_for(path, **keys)


def test_feed_rates_hold_as_they_are_written():
    bspline = {
        "degree": 5,
        "knots": [0.0] * 6 + [0.2] * 6,
        "control_points": [[0.5, -0.2 + 0.04 * k, 0.4] for k in range(6)],
        "speeds": [[[0.0, 0.1], [0.2, 0.1]]],
    }
    task = task_of([{"bspline": bspline}], path_reversed=True)
    with pytest.raises(PathError, match="feed rates"):
        Problem.of(brachis.robots.iiwa14, task)


def test_a_reversed_seam_is_planned_saved_and_verified(tmp_path):
    keys = {"task_space": ["x", "y"], "path_start": [0.3, 0.2], "effort": "single"}
    seam = [{"line": {"by": [0.0, 0.4]}, "dwell": 0.1}, {"line": {"by": [0.2, 0.0]}}]
    start = {"joints": [0.5, 0.6]}
    result = brachis.plan("gantry2", path=seam, start=start, path_reversed=True, **keys)
    assert result.verified
    result.save(tmp_path / "seam.npz")
    loaded = Trajectory.load(tmp_path / "seam.npz")
    assert loaded.task.path_reversed
    assert brachis.verify_trajectory(loaded).passed
    # The joints of a gantry are the coordinates of its tool.
    assert_allclose(loaded.q[[0, -1]], [[0.5, 0.6], [0.3, 0.2]], atol=1e-9)
    written = brachis.plan("gantry2", path=seam, start="free", **keys)
    assert result.t_end == pytest.approx(written.t_end, rel=1e-4)
    with pytest.raises(brachis.errors.StartError, match="off the path"):
        brachis.plan("gantry2", path=seam, start=[0.3, 0.2], path_reversed=True, **keys)


def test_the_tool_of_a_reversed_seam_is_where_the_path_leads():
    """By Pinocchio's placements, and by a verification that does not accept the path as it is written."""
    arc = {"center": [0.5, 0.0, 0.4], "angle_deg": 60, "normal": [0, 0, 1]}
    keys = {"path_start": POSE, "task_space": "pose", "path_reversed": True}
    task = task_of([{"arc": arc, "orientation": TURN}], **keys)
    motion = brachis.plan(task, effort="single").trajectory
    t = np.linspace(0.0, motion.t_end, 41)
    places, rotations = motion.robot.tool_placements(motion.position(t))
    written = path_for(task.path, path_start=POSE, task_space="pose")
    target = written.sample(1.0 - motion.path_coordinate(t)).target
    assert_allclose(places, target[:, :3], atol=1e-8)
    assert_allclose(rotations.reshape(-1, 9), target[:, 3:], atol=1e-8)
    forwards = task.model_copy(update={"path_reversed": False})
    assert brachis.verify_trajectory(motion).passed
    assert not brachis.verify_trajectory(replace(motion, task=forwards)).passed
