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


def written(attitude, form=0):
    """An orientation in one of the forms of a task."""
    if form == 0:
        return {"quaternion_wxyz": -np.roll(attitude.as_quat(), 1)}
    return (
        {"rotation_vector": attitude.as_rotvec()}
        if form == 1
        else {"rpy_deg": attitude.as_euler("xyz", degrees=True)}
    )


def through(count, **keys):
    orientations = [
        written(one, i % 3) for i, one in enumerate(ATTITUDES[1 : count + 1])
    ]
    return pose_path(
        [{"spline": {"through": POINTS[:count], "orientations": orientations} | keys}]
    )


def at_waypoints(path):
    curve = path.spans[0].curve
    return path.sample(curve.knots / curve.length).target


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_a_spline_passes_its_waypoints(count):
    target = at_waypoints(through(count))
    assert_allclose(target[-count:, :3], POINTS[:count], atol=1e-12)
    expected = np.stack([one.as_matrix().ravel() for one in ATTITUDES[: count + 1]])
    assert_allclose(target[:, 3:], expected, atol=1e-12)


def test_one_waypoint_is_a_line_with_a_uniform_turn():
    sample = through(1).sample(np.linspace(0, 1, 9))
    assert_allclose(
        sample.xi[:, 3:], np.broadcast_to(STEPS[0].as_rotvec(), (9, 3)), atol=1e-12
    )
    assert_allclose(
        np.linalg.norm(sample.xi[:, :3], axis=1), np.linalg.norm(POINTS[0] - START)
    )


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
    points = [[np.cos(angle), np.sin(angle), 0] for angle in angles]
    orientations = [{"rotation_vector": [0, 0, angle]} for angle in angles]
    spline = {"spline": {"through": points[1:], "orientations": orientations[1:]}}
    sample = pose_path([spline], points[0], Rotation.identity()).sample(
        np.linspace(0, 1, 100)
    )
    expected = np.broadcast_to([0, 1.5 * np.pi, 0, 0, 0, 1.5 * np.pi], (100, 6))
    assert_allclose(sample.xi, expected, atol=0.15)
    heading = np.unwrap(rotations(sample.target).as_rotvec()[:, 2])
    assert_allclose(
        np.unwrap(np.arctan2(sample.target[:, 1], sample.target[:, 0])),
        heading,
        atol=2e-3,
    )


def test_relative_waypoints():
    shifts = POINTS - START
    turned = [written(TURNED.inv() * one) for one in ATTITUDES[1:]]
    relative = pose_path(
        [{"spline": {"through": shifts, "orientations": turned, "relative": True}}]
    )
    s = np.linspace(0, 1, 20)
    assert_allclose(relative.sample(s).target, through(6).sample(s).target, atol=1e-12)


def test_waypoints_relative_to_a_stated_start():
    """The same waypoints, recorded from another start pose, are moved to the actual one."""
    elsewhere, turn = np.array([1.0, 2.0, 3.0]), Rotation.from_rotvec([0.5, 1.0, 0.2])
    spline = {
        "through": POINTS - START + elsewhere,
        "orientations": [written(turn * TURNED.inv() * one) for one in ATTITUDES[1:]],
        "starts_at": elsewhere,
        "starts_oriented": written(turn),
        "relative": True,
    }
    s = np.linspace(0, 1, 20)
    moved = pose_path([{"spline": spline}]).sample(s).target
    assert_allclose(moved, through(6).sample(s).target, atol=1e-12)


def test_a_stated_start_may_be_off_by_rounding():
    stated = through(
        6,
        starts_at=START + 5e-5,
        starts_oriented=written(TURNED * Rotation.from_rotvec([0, 9e-5, 0])),
    )
    s = np.linspace(0, 1, 20)
    assert_allclose(stated.sample(s).target, through(6).sample(s).target, atol=1e-12)


def test_a_spline_on_the_spot():
    orientations = [written(one) for one in ATTITUDES[1:]]
    path = pose_path(
        [{"spline": {"through": [START] * 6, "orientations": orientations}}]
    )
    target = at_waypoints(path)
    assert_allclose(
        target[:, 3:],
        np.stack([one.as_matrix().ravel() for one in ATTITUDES]),
        atol=1e-12,
    )
    assert_allclose(target[:, :3], np.broadcast_to(START, (7, 3)), atol=1e-12)
    curve = path.spans[0].curve
    assert_allclose(np.diff(curve.knots), STEPS.magnitude(), atol=1e-12)
    once = pose_path(
        [{"spline": {"through": [START], "orientations": orientations[:1]}}]
    ).sample([0.0, 1.0])
    assert_allclose(
        once.xi, np.broadcast_to([0, 0, 0, *STEPS[0].as_rotvec()], (2, 6)), atol=1e-12
    )
