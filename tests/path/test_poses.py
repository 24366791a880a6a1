"""Paths of poses: the body twist against finite differences, known twists, joins and blends."""

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from brachis.path import build_path
from brachis.robot.task_map.protocol import POSE_ROWS
from brachis.task import LineBy, LineSegment
from support.poses import (
    START,
    TURNED,
    central_difference,
    pose,
    pose_path,
    rotations,
    smooth_places,
    twist_by_difference,
)

ALONG = {"line": {"by": [0.6, 0, 0.3]}}

SEGMENTS = yaml.safe_load("""
fixed:
- line:
    by: [0.6, 0, 0.3]
rotate:
- line:
    by: [0.6, 0, 0.3]
  orientation:
    rotate:
      axis: [1, 2, -2]
      angle_deg: 140
rotate smoothly:
- line:
    by: [0.6, 0, 0.3]
  orientation:
    rotate:
      axis: [1, 2, -2]
      angle_deg: 140
      frame: tool
      profile: smooth
rotate along an arc:
- arc:
    via: [0.7, 0.3, 0.3]
    to: [0.9, 0.2, 0.5]
  orientation:
    rotate:
      axis: [1, 2, -2]
      angle_deg: 140
rotate along a spline:
- spline:
    through:
    - [0.6, 0.3, 0.2]
    - [0.9, 0.4, 0.4]
    - [1.1, 0.8, 0.3]
  orientation:
    rotate:
      axis: [1, 2, -2]
      angle_deg: 140
      frame: tool
      profile: smooth
to:
- line:
    by: [0.6, 0, 0.3]
  orientation:
    to:
      rpy_deg: [10, -80, 20]
to, smoothly:
- line:
    by: [0.6, 0, 0.3]
  orientation:
    to:
      rotation_vector: [2, 0, 1]
      profile: smooth
tangent of a circle:
- circle:
    center: [0.2, 0.1, 0.3]
    normal: [0, 1, 1]
    turns: -1.25
  orientation: tangent
tangent of an arc, other up:
- arc:
    via: [0.7, 0.3, 0.3]
    to: [0.9, 0.2, 0.5]
  orientation:
    tangent:
      up: [1, 1, 1]
tangent of a spline:
- spline:
    through:
    - [0.6, 0.3, 0.2]
    - [0.9, 0.4, 0.4]
    - [1.1, 0.8, 0.3]
  orientation: tangent
orientations:
- spline:
    through:
    - [0.6, 0.3, 0.2]
    - [0.9, 0.4, 0.4]
    - [1.1, 0.8, 0.3]
    orientations:
    - rpy_deg: [20, 40, 60]
    - rotation_vector: [0.2, 0.9, 1.5]
    - quaternion_wxyz: [-0.5, 0.5, -0.5, -0.5]
two orientations:
- spline:
    through:
    - [0.8, 0.1, 0.5]
    - [1, 0.4, 0.3]
    orientations:
    - rpy_deg: [20, 40, 60]
    - rotation_vector: [0.2, 0.9, 1.5]
one orientation:
- spline:
    through:
    - [0.8, 0.1, 0.5]
    orientations:
    - rpy_deg: [20, 40, 60]
orientations on the spot:
- spline:
    through:
    - [0.5, 0.1, 0.3]
    - [0.5, 0.1, 0.3]
    - [0.5, 0.1, 0.3]
    orientations:
    - rpy_deg: [20, 40, 60]
    - rotation_vector: [0.2, 0.9, 1.5]
    - quaternion_wxyz: [-0.5, 0.5, -0.5, -0.5]
turn:
- turn:
    rotate:
      axis: [1, 2, -2]
      angle_deg: 140
turn to:
- turn:
    to:
      rpy_deg: [10, -80, 20]
      profile: smooth
two turns:
- turn:
    rotate:
      axis: [1, 2, -2]
      angle_deg: 140
      frame: tool
      profile: smooth
- turn:
    to:
      rpy_deg: [10, -80, 20]
      profile: smooth
blends:
- line:
    by: [0.6, 0, 0.3]
  orientation:
    rotate:
      axis: [1, 2, -2]
      angle_deg: 140
  blend: 0.2
- line:
    by: [0, 0.8, 0.1]
  blend: 0.2
- line:
    by: [0, 0, 0.7]
  orientation:
    to:
      rpy_deg: [10, 80, 20]
  blend: 0.2
- spline:
    through:
    - [0.4, 0.2, 0.4]
    - [0.9, 0, 0.5]
    relative: true
  orientation: tangent
""")


@pytest.fixture(params=SEGMENTS)
def path(request):
    return pose_path(SEGMENTS[request.param])


def size(values):
    return max(float(np.abs(values).max()), 1.0)


def test_the_twist_is_that_of_the_poses(path):
    h = 2e-4
    s = smooth_places(path, 3 * h)
    assert s.size > 20
    exact = path.sample(s)
    assert exact.target.shape == (s.size, 12)
    assert exact.xi.shape == exact.xi_ds.shape == exact.xi_dds.shape == (s.size, 6)
    assert_allclose(
        twist_by_difference(path, s, h), exact.xi, atol=1e-8 * size(exact.xi)
    )


def test_derivatives_of_the_twist(path):
    h = 2e-4
    s = smooth_places(path, 3 * h)
    for lower, upper in (("xi", "xi_ds"), ("xi_ds", "xi_dds")):
        exact = getattr(path.sample(s), upper)
        difference = central_difference(
            lambda s, name=lower: getattr(path.sample(s), name), s, h
        )
        assert_allclose(difference, exact, atol=1e-7 * size(exact), err_msg=upper)


def test_targets_are_poses(path):
    matrices = path.sample(np.linspace(0, 1, 50)).target[:, 3:].reshape(-1, 3, 3)
    assert_allclose(
        matrices @ np.swapaxes(matrices, 1, 2),
        np.broadcast_to(np.eye(3), (50, 3, 3)),
        atol=1e-12,
    )
    assert_allclose(np.linalg.det(matrices), 1.0)
    assert_allclose(path.sample([0.0]).target[0], pose(START, TURNED), atol=1e-12)


@pytest.mark.parametrize("name, breaks", [("blends", 8), ("two turns", 3)])
def test_the_twist_and_two_derivatives_continue_across_joins(name, breaks):
    path = pose_path(SEGMENTS[name])
    assert path.breaks.size == breaks
    inner = path.breaks[1:-1]
    before, after = (path.sample(inner + side) for side in (-1e-10, 1e-10))
    everywhere = path.sample(np.linspace(0, 1, 2000))
    for what in ("target", "xi", "xi_ds", "xi_dds"):
        jump = np.abs(getattr(after, what) - getattr(before, what)).max()
        assert jump < 1e-6 * np.abs(getattr(everywhere, what)).max(), what


def test_a_smooth_turn_joins_a_constant_orientation():
    segments = """
    - line: {by: [0.3, 0, 0]}
    - line: {by: [0.4, 0, 0]}
      orientation: {rotate: {axis: [1, 2, -2], angle_deg: 140, frame: tool, profile: smooth}}
    - line: {by: [0.2, 0, 0]}
    """
    path = pose_path(yaml.safe_load(segments))
    assert len(path.spans) == 3
    sample = path.sample(path.breaks)
    for what in (sample.xi, sample.xi_ds, sample.xi_dds):
        assert_allclose(what[:, 3:], 0.0, atol=1e-9)
    turned = (TURNED.inv() * rotations(sample.target)).magnitude()
    assert_allclose(turned, np.deg2rad([0, 0, 140, 140]), atol=1e-12)


def test_the_same_uniform_turn_may_go_on():
    segments = """
    - {line: {by: [0.3, 0, 0]}, orientation: {rotate: {axis: [0, 0, 1], angle_deg: 30}}}
    - {line: {by: [0.6, 0, 0]}, orientation: {rotate: {axis: [0, 0, 2], angle_deg: 60}}}
    """
    assert len(pose_path(yaml.safe_load(segments)).spans) == 2


@pytest.mark.parametrize("frame", ["path", "tool"])
def test_a_rotation_has_a_constant_angular_velocity(frame):
    axis = np.array([1.0, 2.0, -2.0]) / 3
    rotate = {"axis": 5 * axis, "angle_deg": -400, "frame": frame}
    path = pose_path([ALONG | {"orientation": {"rotate": rotate}}])
    sample = path.sample(np.linspace(0, 1, 30))
    turn = -np.deg2rad(400) * axis
    in_tool = TURNED.inv().apply(turn) if frame == "path" else turn
    assert_allclose(sample.xi[:, 3:], [in_tool] * 30, atol=1e-12)
    turned = Rotation.from_rotvec(turn)
    expected = turned * TURNED if frame == "path" else TURNED * turned
    assert_allclose(sample.target[-1, 3:], expected.as_matrix().ravel(), atol=1e-12)


@pytest.mark.parametrize("profile", ["uniform", "smooth"])
def test_to_ends_there_by_the_shortest_way(profile):
    target = Rotation.from_euler("xyz", [10, -80, 20], degrees=True)
    to = {"rpy_deg": [10, -80, 20], "profile": profile}
    path = pose_path([ALONG | {"orientation": {"to": to}}])
    s = np.linspace(0, 1, 11)
    turned = (TURNED.inv() * rotations(path.sample(s).target)).as_rotvec()
    whole = (TURNED.inv() * target).as_rotvec()
    assert np.linalg.norm(whole) < np.pi
    share = s if profile == "uniform" else 35 * s**4 - 84 * s**5 + 70 * s**6 - 20 * s**7
    assert_allclose(turned, share[:, None] * whole, atol=1e-12)


def test_along_the_tangent_the_tool_keeps_to_the_velocity_and_has_no_roll():
    """What is level and square to the tangent at the start stays level and square to it."""
    sample = pose_path(SEGMENTS["tangent of a spline"]).sample(np.linspace(0, 1, 50))
    turning = rotations(sample.target)
    tangent = turning.apply(sample.xi[:, :3])
    level = turning.inv().apply(np.cross([0, 0, 1], tangent))
    for in_tool in (sample.xi[:, :3], level):
        direction = in_tool / np.linalg.norm(in_tool, axis=1)[:, None]
        same = np.broadcast_to(direction[0], (50, 3))
        assert_allclose(direction, same, atol=1e-12)
    assert np.ptp(tangent[:, 2]) > 0.1


@pytest.mark.parametrize(
    "orientation", ["tangent", {"to": {"rotation_vector": [0.3, -0.5, 0.8]}}], ids=str
)
def test_a_line_along_its_tangent_or_to_the_same_orientation_does_not_turn(orientation):
    sample = pose_path([ALONG | {"orientation": orientation}]).sample([0.0, 0.5, 1.0])
    assert_allclose(sample.xi[:, 3:], 0.0, atol=1e-12)


def test_a_blend_of_a_turn_that_goes_on_keeps_close_to_it():
    """The polynomial of quaternions turns as the segments do, also by more than half a turn within the blend."""
    turning = {"rotate": {"axis": [0, 0, 1], "angle_deg": 500}}
    line = {"line": {"by": [1, 0, 0]}, "orientation": turning}
    path = pose_path([line | {"blend": 0.3}, line])
    s = np.linspace(0, 1, 200)
    turned = np.unwrap(
        (rotations(path.sample(s).target) * TURNED.inv()).as_rotvec()[:, 2]
    )
    assert_allclose(turned, np.deg2rad(1000) * s, atol=0.1)


def path_in_frames(world, shift, tool):
    """A blend and a spline as another world frame and another tool frame have them."""
    steps = world.apply([[0.6, 0, 0.3], [0.4, 0.2, 0.4], [0.9, 0, 0.5]])
    axis = tool.inv().apply([0, 1, 1])
    turns = [Rotation.from_rotvec(turn) for turn in ([0.2, 0.9, 1.5], [0.4, 1.2, 2.0])]
    attitudes = [
        {"rotation_vector": (tool.inv() * turn * tool).as_rotvec()} for turn in turns
    ]
    rotate = {"axis": axis, "angle_deg": 100, "frame": "tool"}
    spline = {"through": steps[1:], "relative": True, "orientations": attitudes}
    segments = [
        {"line": {"by": steps[0]}, "orientation": {"rotate": rotate}, "blend": 0.1},
        {"spline": spline},
    ]
    return pose_path(segments, world.apply(START) + shift, world * TURNED * tool)


@pytest.mark.parametrize("seed", range(3))
def test_blends_and_splines_do_not_depend_on_the_frames(seed):
    world, tool = Rotation.random(2, rng=seed)
    shift = np.array([1.0, -2.0, 0.5])
    s = np.linspace(0, 1, 20)
    same = Rotation.identity()
    here = path_in_frames(same, np.zeros(3), same).sample(s).target
    there = path_in_frames(world, shift, tool).sample(s).target
    expected = world.apply(here[:, :3]) + shift
    assert_allclose(there[:, :3], expected, atol=1e-9)
    turned = (world * rotations(here) * tool).as_matrix()
    assert_allclose(there[:, 3:], turned.reshape(-1, 9), atol=1e-9)


def test_the_start_is_freed_of_rounding():
    segments = [LineSegment(line=LineBy(by=(1.0, 0.0, 0.0)))]
    rounded = np.round(pose(START, TURNED), 7)
    path = build_path(segments, rounded, POSE_ROWS)
    target = path.sample([0.0]).target[0]
    matrix = target[3:].reshape(3, 3)
    assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-15)
    assert_allclose(target, rounded, atol=1e-6)


def test_nan_stays_nan_and_the_path_continues_beyond_its_ends(path):
    sample = path.sample([0.5, np.nan])
    assert np.all(np.isnan(sample.target[1, :3]))
    assert not np.any(np.isnan(sample.xi_dds[0]))
    outside = path.sample([-1e-7, 0.0, 1.0, 1.0 + 1e-7])
    assert_allclose(
        np.diff(outside.xi, axis=0)[[0, 2]], 0.0, atol=1e-4 * size(outside.xi)
    )
