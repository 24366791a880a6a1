"""The joint map of a path of all joints: exact derivatives, and limits that bind with them and not without."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.kinematics import JointSpaceMap
from brachis.limits.safeguards import build_branch_margins
from brachis.path import build_path
from brachis.robot.task_map import task_map_of
from brachis.robot.task_map.protocol import joint_rows
from brachis.task.segments import SplineSegment, SplineThrough
from support.chains import planar_robot

H = 1e-5


@pytest.fixture(scope="module")
def along():
    robot = planar_robot("RRP")
    waypoints = SplineThrough(
        through=((0.5, 0.8, -0.3), (1.0, -0.2, 0.2), (0.2, 0.1, 0.5))
    )
    path = build_path(
        [SplineSegment(spline=waypoints)],
        [0.1, 0.2, 0.3],
        joint_rows(robot.joint_names),
    )
    return JointSpaceMap(robot, path)


@pytest.fixture(scope="module")
def states():
    rng = np.random.default_rng(1)
    return rng.uniform(0.05, 0.95, (6, 1)), *(rng.normal(size=(6, 1)) for _ in range(3))


def test_the_motion_is_that_of_the_path(along, states):
    y, ydot, yddot, ydddot = states
    state = along.state(*states)

    def moved(t):
        return along.postures(y + t * ydot + t**2 * yddot / 2.0 + t**3 * ydddot / 6.0)

    def accelerated(t):
        return along.state(
            y + t * ydot + t**2 * yddot / 2.0 + t**3 * ydddot / 6.0,
            ydot + t * yddot + t**2 * ydddot / 2.0,
            yddot + t * ydddot,
            ydddot,
        ).qddot

    assert_allclose(state.q, along.postures(y), atol=1e-12)
    assert_allclose(state.qdot, (moved(H) - moved(-H)) / (2.0 * H), atol=1e-8)
    assert_allclose(
        state.qddot, (moved(1e-3) - 2.0 * moved(0) + moved(-1e-3)) / 1e-6, atol=1e-4
    )
    jerk = (accelerated(H) - accelerated(-H)) / (2.0 * H)
    assert_allclose(state.qdddot, jerk, atol=1e-5 * np.abs(jerk).max())


def test_derivatives_equal_differences(along, states):
    y, ydot, yddot, ydddot = states
    exact = along.derivatives(along.state(*states))

    def difference(part, *, of_y, of_ydot):
        ahead, behind = (
            getattr(
                along.state(
                    y + sign * H * of_y, ydot + sign * H * of_ydot, yddot, ydddot
                ),
                part,
            )
            for sign in (1.0, -1.0)
        )
        return (ahead - behind) / (2.0 * H)

    for found, part, by in (
        (exact.qdot_y, "qdot", (1.0, 0.0)),
        (exact.qddot_y, "qddot", (1.0, 0.0)),
        (exact.qddot_ydot, "qddot", (0.0, 1.0)),
    ):
        expected = difference(part, of_y=by[0], of_ydot=by[1])
        assert np.abs(expected).max() > 0.1
        assert_allclose(found[:, :, 0], expected, atol=1e-6 * np.abs(expected).max())


def test_nothing_is_chosen_and_nothing_guards_it(along, states):
    state = along.state(*states)
    assert along.r == 0
    assert along.redundant_joints == ()
    assert build_branch_margins(along) == ()
    by_q, by_s = along.margin_gradient(state)
    assert by_q.shape == (6, 0, 3)
    assert by_s is None
    assert_allclose(along.start, [0.1, 0.2, 0.3], atol=1e-14)
    assert_array_equal(along.coordinates(0.3, np.full(3, np.nan)), [0.3])


def test_the_task_map_is_the_identity():
    robot = planar_robot("RRP")
    space, q = task_map_of(robot, "joints"), np.array([[7.0, -8.0, 0.3]])
    assert_array_equal(space.values(q), q)
    assert_array_equal(space.difference(q, np.zeros((1, 3))), q)
    assert_array_equal(space.jacobian(space.twists(q)), np.eye(3)[None])
    assert space.rows == ("joint j1", "joint j2", "joint j3")
    assert space.units == ("rad", "rad", "m")
    assert space.axes == ()
