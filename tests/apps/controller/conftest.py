"""Motions of an arm on a rail, planned once."""

import numpy as np
import pytest

import brachis
from support.controllers import RAIL_START, SEVEN_START
from support.effort import QUICK


def joint_motion(robot, start, by):
    """Plan a straight line of all joints."""
    return brachis.plan(
        robot,
        path=brachis.Line(by=by),
        start=start,
        task_space="joints",
        search=QUICK,
        intervals=12,
    ).trajectory


@pytest.fixture(scope="package")
def turn():
    """The rail moves by 250 mm, joints 1 and 2 turn by 90 and 30 degrees."""
    by = [0.25, np.pi / 2, np.pi / 6, 0.0, 0.0, 0.0, 0.0]
    return joint_motion("tx90l_rail", RAIL_START, by)


@pytest.fixture(scope="package")
def seven():
    """A line of seven revolute joints."""
    return joint_motion("iiwa14", SEVEN_START, [0.3, -0.2, 0.1, 0.2, -0.1, 0.1, 0.2])


@pytest.fixture(scope="package")
def seam():
    """A line of the tool of an arm on a rail; half of it at a process speed."""
    return brachis.plan(
        "tx90l_rail",
        path=[
            {"line": {"by": [0.0, 0.2, 0.0]}},
            {"line": {"by": [0.0, 0.2, 0.0]}, "speed": 0.5},
        ],
        start=RAIL_START,
        task_space="pose",
        search=QUICK,
    ).trajectory
