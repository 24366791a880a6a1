"""What a search says of bodies in the way of all joint paths that it knows."""

import numpy as np
import pytest

import brachis
from brachis.errors import PathError
from brachis.kinematics import JointSpaceMap
from brachis.problem.problem import Problem
from brachis.search.holding import explain_postures
from brachis.search.stages import InitialGuess
from brachis.task import task_with

FIRST = [0.5, -1.5, 0.5]
LAST = [1.1, -1.5, 0.5]


def guess(*posts):
    """Make a guess that turns the first joint, past posts at some of its angles."""
    robot = brachis.robots.scara3
    scene = [
        brachis.Cylinder(
            0.05,
            1.0,
            name=f"post {number}",
            position=robot.tool_placement([angle, *FIRST[1:]]).translation,
        )
        for number, angle in enumerate(posts)
    ]
    task = task_with(
        start=FIRST,
        task_space="joints",
        path=brachis.Spline(through=[LAST]),
        scene=scene,
        collisions={"self_collision": False},
    )
    problem = Problem.of(robot, task)
    s = np.linspace(0.0, 1.0, 11)[:, None]
    joint_map = JointSpaceMap(problem.robot, problem.path)
    return InitialGuess(problem, joint_map, s, np.inf, "path of joints", "")


def test_the_nearest_of_joint_paths_that_all_hit_something_is_the_reason():
    failure = explain_postures([guess(0.8, 0.95), guess(0.8)])
    first, last = failure.s_interval
    assert "post 0" in failure.problem
    assert 0.3 < first < 0.5 < last < 0.7
    assert " m at s = 0." in failure.found
    with pytest.raises(PathError, match="post 0"):
        raise failure


def test_nothing_is_explained_where_one_joint_path_is_free():
    beside = guess(2.5)
    assert explain_postures([guess(0.8), beside]) is None
    assert explain_postures([]) is None
