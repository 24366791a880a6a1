"""What every joint path of a search owes."""

from __future__ import annotations

import numpy as np

from brachis.problem.problem import Problem
from brachis.robot import dynamics
from brachis.search.joint_path import PosturePath


def check_joint_path(
    problem: Problem, joint_path: PosturePath, *, miss: float, step: float
) -> None:
    """Check that it is on the path, continuous, within the ranges, and of postures that the torques hold."""
    q, limits = joint_path.q, problem.robot.limits
    targets = problem.path.sample(joint_path.s).target
    values = problem.task_map.values(q)
    assert np.abs(problem.task_map.difference(values, targets)).max() < miss
    assert np.abs(np.diff(q, axis=0)).max() <= step
    assert np.all(q >= limits.position_lower - 1e-9)
    assert np.all(q <= limits.position_upper + 1e-9)
    still = np.zeros_like(q)
    load = dynamics.torque(problem.robot, q, still, still)
    assert np.all(np.abs(load) <= limits.torque)
