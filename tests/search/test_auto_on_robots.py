"""Everything left open on spatial arms, and on random postures and lines (all of them: `benchmarks/random_auto.py`)."""

import pytest

import brachis
from brachis.kinematics import CHART


def test_auto_is_never_slower_than_the_rail_alone():
    line = brachis.examples.tx90l_rail_line
    rail = brachis.plan(line, intervals=10)
    auto = brachis.plan(line, intervals=10, redundant_joints="auto")
    assert rail.verified
    assert auto.verified
    assert auto.t_end <= rail.t_end * (1.0 + 1e-6)
    # No closed form is needed.
    assert {candidate.branch for candidate in auto.candidates} == {CHART}


@pytest.mark.parametrize("name", ["scara3", "tx90l_rail", "ur10_rail", "iiwa14"])
def test_random_postures_and_lines_with_everything_left_open(bench, name):
    module = bench("random_auto")
    robot = module.planar_arm() if name == "scara3" else getattr(brachis.robots, name)
    (task,) = module.tasks(name, robot, seed=1, count=1)
    assert module.has_course(robot, task)
    assert module.random_poses.tried(robot, task) == ""
