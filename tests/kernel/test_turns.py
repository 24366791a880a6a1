"""Turns of angles along a motion against NumPy's `unwrap`, and answers that go on with it."""

import numpy as np
import pytest

from brachis.kernel import follow_turns, pick_nearest, set_turns

TURN = 2.0 * np.pi


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def test_angles_follow_their_turns(rng):
    smooth = np.cumsum(rng.uniform(-2.0, 2.0, (50, 3)), axis=0)
    turning = np.array([1.0, 0.0, 1.0])
    wrapped = np.remainder(smooth, TURN)
    found = wrapped.copy()
    start = smooth[0] + 3.0 * TURN
    follow_turns(found, turning, start)
    known = np.unwrap(np.vstack([start, wrapped]), axis=0)[1:]
    np.testing.assert_allclose(found[:, [0, 2]], known[:, [0, 2]], atol=1e-12)
    np.testing.assert_array_equal(found[:, 1], wrapped[:, 1])


def test_nothing_is_done_where_an_answer_is_missing():
    angles = np.array([[0.0, 7.0], [np.nan, 7.0]])
    found = angles.copy()
    follow_turns(found, np.ones(2), np.zeros(2))
    np.testing.assert_array_equal(found, angles)


def fast_motion(steps: int) -> tuple[np.ndarray, ...]:
    """Time, angle, velocity and acceleration of two joints; the first turns several times."""
    t = np.linspace(0.0, 1.0, steps)[:, None]
    q = np.hstack([40.0 * t**2 + 1.0, np.sin(3.0 * t)])
    qdot = np.hstack([80.0 * t, 3.0 * np.cos(3.0 * t)])
    qddot = np.hstack([0.0 * t + 80.0, -9.0 * np.sin(3.0 * t)])
    return t[:, 0], q, qdot, qddot


def test_turns_are_counted_by_velocities():
    t, q, qdot, qddot = fast_motion(9)  # up to 9.4 rad a step
    found = np.remainder(q, TURN)
    assert set_turns(found, (qdot, qddot), t, q[0], np.ones(2), np.ones(2))
    np.testing.assert_allclose(found, q, atol=1e-12)


@pytest.mark.parametrize(("ranged", "is_possible"), [(1.0, False), (0.0, True)])
def test_turns_that_are_not_certain(ranged, is_possible):
    t, q, qdot, qddot = fast_motion(9)
    q[4:, 0] += 0.4 * TURN
    mask = np.array([ranged, 0.0])
    assert set_turns(q, (qdot, qddot), t, q[0], np.ones(2), mask) is is_possible


def test_the_nearest_answer_is_taken(rng):
    answers = rng.uniform(-np.pi, np.pi, (20, 5, 2))
    answers[3, 1] = np.nan
    answers[7] = np.nan
    near = rng.uniform(-np.pi, np.pi, (20, 2))
    turning = np.array([1.0, 0.0])
    gap = answers - near[:, None]
    gap[..., 0] = np.remainder(gap[..., 0] + np.pi, TURN) - np.pi
    distance = np.nan_to_num(np.linalg.norm(gap, axis=2), nan=np.inf)
    known = answers[np.arange(20), distance.argmin(axis=1)]
    found = pick_nearest(answers, turning, near, follows=False)
    np.testing.assert_array_equal(found, known)


def test_each_answer_follows_the_one_before(rng):
    path = np.cumsum(rng.uniform(-0.1, 0.1, (30, 2)), axis=0)
    away = path[:, None] + np.array([0.0, 2.0, -2.5])[None, :, None]
    answers = np.take(away, [2, 0, 1], axis=1)
    answers[12] = np.nan  # one is missing
    found = pick_nearest(answers, np.zeros(2), path[:1], follows=True)
    kept = np.arange(30) != 12
    np.testing.assert_array_equal(found[kept], path[kept])
    assert np.isnan(found[12]).all()


def test_only_arrays_that_can_be_written_to_are_taken():
    rows = np.zeros((4, 5))
    for angles in (rows[:, :3], rows.astype(int), np.broadcast_to(0.0, (4, 5))):
        columns = np.ones(angles.shape[1])
        with pytest.raises(ValueError, match="contiguous"):
            follow_turns(angles, columns, columns)


def test_there_must_be_an_answer():
    with pytest.raises(ValueError, match="no answers"):
        pick_nearest(np.empty((3, 0, 2)), np.ones(2), np.zeros((3, 2)), follows=False)
