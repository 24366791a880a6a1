"""Motions of any robot without planning them."""

import dataclasses

import numpy as np
import pytest

from brachis.robot import Robot
from support.shown import NO_VISUALS


@pytest.fixture(scope="session")
def motion_of(line_result):
    """Give a motion of a robot between two postures, one polynomial piece of 1.1 s."""

    def motion(robot, begin=0.1, end=0.5):
        q = np.array([np.full(robot.n, begin), np.full(robot.n, end)])
        return dataclasses.replace(
            line_result.trajectory,
            task=line_result.task.model_copy(update={"task_space": "joints"}),
            robot=robot,
            urdf=robot.urdf,
            redundant_joints=(),
            times=np.array([0.0, 1.1]),
            phase_ends=np.array([1.1]),
            q=q,
            qdot=np.zeros_like(q),
            qddot=np.zeros_like(q),
            qddot_before=np.zeros_like(q),
        )

    return motion


@pytest.fixture(scope="session")
def bare_robot():
    return Robot.from_urdf("bare.urdf", urdf_text=NO_VISUALS)
