"""Newton's method: placement and Jacobian as Pinocchio has them, targets met to rounding, NaN where they cannot be."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brachis.ik.newton import Newton
from brachis.robot import bind
from support.chains import gantry_robot, planar_robot
from support.charts import jacobian
from support.screw_arms import panda, seven_joints
from support.spatial import rail_arm

ARMS = {
    "3R": (lambda: planar_robot("RRR"), ["x", "y"]),
    "RPRC, one row": (lambda: planar_robot("RPRC", "tilted"), ["z"]),
    "4R with yaw": (lambda: planar_robot("RRRR", "xz"), ["x", "z", "pitch"]),
    "3R with yaw, r = 0": (lambda: planar_robot("RRR"), ["y", "x", "yaw"]),
    "gantry": (
        lambda: gantry_robot([(1.0, 0.0, 0.0), (0.0, 1.0, 0.3), (0.2, 0.0, 1.0)]),
        ["x", "z"],
    ),
    "rail, pose": (rail_arm, "pose"),
    "rail, position": (rail_arm, "position"),
    "rail, free roll": (rail_arm, "pose_free_roll"),
    "7R, pose": (seven_joints, "pose"),
    "7R, position": (panda, "position"),
    "8R on a tilted rail, pose": (
        lambda: seven_joints(rail=np.array([0.6, 0.8, 0.0])),
        "pose",
    ),
}
COUNT = 40


@pytest.fixture(params=ARMS, ids=str, scope="module")
def arm(request):
    """Task map and postures at which yaw is away from its jump at pi."""
    make, rows = ARMS[request.param]
    robot, task_map = bind(make(), rows)
    return task_map, np.random.default_rng(3).uniform(-0.9, 0.9, (COUNT, robot.n))


def test_placed_is_what_pinocchio_says(arm):
    task_map, q = arm
    values, found = Newton(task_map).task_coordinates(q)
    assert_allclose(
        values, task_map.of_placements(*task_map.robot.tool_placements(q)), atol=1e-13
    )
    expected = jacobian(task_map, q)
    assert np.abs(expected).max() > 0.1
    assert_allclose(found, expected, atol=1e-13)


def regular_postures(task_map, q):
    """Rows of the null spaces, and the postures in which the Jacobian is far from singular."""
    _, sizes, right = np.linalg.svd(jacobian(task_map, q))
    return right[:, task_map.m :], sizes[:, -1] > 0.03


def test_targets_and_linear_conditions_are_met(arm):
    task_map, q = arm
    rows, good = regular_postures(task_map, q)
    assert good.sum() > COUNT // 5
    q, rows = q[good], rows[good]
    there = q + 0.02 * np.random.default_rng(5).uniform(-1.0, 1.0, q.shape)
    targets, levels = task_map.values(there), np.einsum("kij,kj->ki", rows, there)
    found = Newton(task_map).solve(targets, q, rows, levels)
    assert np.abs(task_map.difference(targets, task_map.values(found))).max() < 1e-12
    assert_allclose(np.einsum("kij,kj->ki", rows, found), levels, atol=1e-12)
    assert_allclose(found, there, atol=1e-10)


def test_no_answer_out_of_reach_nor_from_nowhere():
    _, task_map = bind(planar_robot("RRR"), ["x", "y"])
    q = np.tile([0.4, 1.0, 0.5], (4, 1))
    targets, rows = task_map.values(q), regular_postures(task_map, q)[0]
    levels = np.einsum("kij,kj->ki", rows, q)
    targets[0] = [9.0, 9.0]
    q[1] = np.nan
    levels[2] = np.nan
    found = Newton(task_map).solve(targets, q, rows, levels)
    assert np.isnan(found[:3]).all()
    assert_allclose(found[3], q[3], atol=1e-12)


def test_singular_matrices_do_not_raise_and_leave_the_others_alone():
    """Two slides along x beside a slide along y: rows that ask for what the path already says have no answer."""
    _, task_map = bind(
        gantry_robot([(1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]), ["x", "y"]
    )
    q = np.zeros((3, 3))
    targets = task_map.values(q) + 0.1
    rows = np.array([[[1.0, 1.0, 0.0]], [[1.0, -1.0, 0.0]], [[0.0, 0.0, 0.0]]])
    found = Newton(task_map).solve(targets, q, rows, np.zeros((3, 1)))
    assert np.isnan(found[[0, 2]]).all()
    assert_allclose(found[1], [0.05, 0.05, 0.1], atol=1e-14)
