"""Motions of any robot without planning them."""

import numpy as np
import pytest

from brachis.robot import Robot
from support.motions import motion_between
from support.shown import NO_VISUALS


@pytest.fixture(scope="session")
def motion_of(line_trajectory):
    """Give a motion of a robot between two postures, one polynomial piece of 1.1 s."""

    def motion(robot, begin=0.1, end=0.5):
        q = np.array([np.full(robot.n, begin), np.full(robot.n, end)])
        return motion_between(line_trajectory, robot, q)

    return motion


@pytest.fixture(scope="session")
def bare_robot():
    return Robot.from_urdf("bare.urdf", urdf_text=NO_VISUALS)
