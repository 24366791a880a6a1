"""Smooth curves through poses."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from support.poses import START, TURNED, pose_path, rotations

RANDOM = np.random.default_rng(8)
POINTS = START + np.cumsum(RANDOM.uniform(0.1, 0.4, (6, 3)), axis=0)
STEPS = Rotation.from_rotvec(RANDOM.uniform(-1.2, 1.2, (6, 3)))
ATTITUDES = [TURNED]
for one_step in STEPS:
    ATTITUDES.append(ATTITUDES[-1] * one_step)


FORMS = (
    lambda turn: {"quaternion_wxyz": -np.roll(turn.as_quat(), 1)},
    lambda turn: {"rotation_vector": turn.as_rotvec()},
    lambda turn: {"rpy_deg": turn.as_euler("xyz", degrees=True)},
)
written = FORMS[0]
S = np.linspace(0, 1, 20)


def through(count, **keys):
    turns = ATTITUDES[1 : count + 1]
    orientations = [FORMS[i % 3](turn) for i, turn in enumerate(turns)]
    return spline(POINTS[:count], orientations, **keys)


def spline(points, orientations, **keys):
    keys |= {"through": points, "orientations": orientations}
    return pose_path([{"spline": keys}])


def assert_whole(path):
    """Compare with the path through all waypoints."""
    assert_allclose(path.sample(S).target, through(6).sample(S).target, atol=1e-12)


def matrices(turns):
    return np.stack([turn.as_matrix().ravel() for turn in turns])


def at_waypoints(path):
    curve = path.spans[0].curve
    return path.sample(curve.knots / curve.length).target


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_a_spline_passes_its_waypoints(count):
    target = at_waypoints(through(count))
    assert_allclose(target[-count:, :3], POINTS[:count], atol=1e-12)
    assert_allclose(target[:, 3:], matrices(ATTITUDES[: count + 1]), atol=1e-12)


def test_one_waypoint_is_a_line_with_a_uniform_turn():
    xi = through(1).sample(np.linspace(0, 1, 9)).xi
    assert_allclose(xi[:, 3:], [STEPS[0].as_rotvec()] * 9, atol=1e-12)
    distance = np.linalg.norm(POINTS[0] - START)
    assert_allclose(np.linalg.norm(xi[:, :3], axis=1), distance)


@pytest.mark.parametrize("count", [3, 6])
def test_the_twist_and_two_derivatives_continue_at_waypoints(count):
    path = through(count)
    curve = path.spans[0].curve
    inner, h = curve.knots[1:-1] / curve.length, 1e-9
    before, after = path.sample(inner - h), path.sample(inner + h)
    fine = path.sample(np.linspace(0, 1, 2001))
    steepest = np.abs(np.diff(fine.xi_dds, axis=0)).max() * 2000
    for name in ("xi", "xi_ds", "xi_dds"):
        jump = np.abs(getattr(after, name) - getattr(before, name)).max()
        assert jump < 1e-7 * np.abs(getattr(fine, name)).max() + 4 * h * steepest, name


def test_orientations_on_a_circle_are_close_to_it():
    """Waypoints of a tool that turns uniformly along an arc give nearly the motion of the arc."""
    angles = np.linspace(0, 1.5 * np.pi, 13)
    points = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    turns = [{"rotation_vector": [0, 0, angle]} for angle in angles[1:]]
    spline = {"spline": {"through": points[1:], "orientations": turns}}
    path = pose_path([spline], points[0], Rotation.identity())
    sample = path.sample(np.linspace(0, 1, 100))
    assert_allclose(
        sample.xi, [[0, 1.5 * np.pi, 0, 0, 0, 1.5 * np.pi]] * 100, atol=0.15
    )
    x, y, _ = sample.target[:, :3].T
    heading = np.unwrap(rotations(sample.target).as_rotvec()[:, 2])
    assert_allclose(np.unwrap(np.arctan2(y, x)), heading, atol=2e-3)


def test_relative_waypoints():
    turned = [written(TURNED.inv() * turn) for turn in ATTITUDES[1:]]
    assert_whole(spline(POINTS - START, turned, relative=True))


def test_waypoints_relative_to_a_stated_start():
    """The same waypoints, recorded from another start pose, are moved to the actual one."""
    elsewhere, turn = np.array([1.0, 2.0, 3.0]), Rotation.from_rotvec([0.5, 1.0, 0.2])
    moved = spline(
        POINTS - START + elsewhere,
        [written(turn * TURNED.inv() * turned) for turned in ATTITUDES[1:]],
        starts_at=elsewhere,
        starts_oriented=written(turn),
        relative=True,
    )
    assert_whole(moved)


def test_a_stated_start_may_be_off_by_rounding():
    nearly = written(TURNED * Rotation.from_rotvec([0, 9e-5, 0]))
    assert_whole(through(6, starts_at=START + 5e-5, starts_oriented=nearly))


def test_a_spline_on_the_spot():
    orientations = [written(turn) for turn in ATTITUDES[1:]]
    path = spline([START] * 6, orientations)
    target = at_waypoints(path)
    assert_allclose(target[:, 3:], matrices(ATTITUDES), atol=1e-12)
    assert_allclose(target[:, :3], [START] * 7, atol=1e-12)
    curve = path.spans[0].curve
    assert_allclose(np.diff(curve.knots), STEPS.magnitude(), atol=1e-12)
    once = spline([START], orientations[:1]).sample([0.0, 1.0])
    assert_allclose(once.xi, [[0, 0, 0, *STEPS[0].as_rotvec()]] * 2, atol=1e-12)
