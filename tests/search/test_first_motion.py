"""A first motion, where there is little time: near a joint path, and within all limits."""

import pytest
import yaml

import brachis
from brachis.common.deadline import NEVER, Deadline
from brachis.problem.problem import Problem, decompositions_of
from brachis.robot.from_task import robot_for
from brachis.search.first_motion import find_first_motion
from brachis.search.guesses import first_guess
from brachis.task import task_with

EXTRAS = yaml.safe_load("""
nothing else: {}
a process speed:
  tool_limits: {process_speed: {speed: 0.2, s: [0.3, 0.7]}}
a stop:
  path:
  - {line: {by: [0.0, 0.5]}, stop: true}
  - {line: {by: [0.0, 0.3]}}
""")


def guess_with(extras):
    keys = {"path": brachis.Line(by=[0.0, 0.8]), **extras}
    task = task_with(
        robot={"urdf": "scara3"},
        gravity=[0, 0, 0],
        limits={"torque": 10.0},
        start=[0.5236, -2.0944, 2.0944],
        task_space=["x", "y"],
        **keys,
    )
    problem = Problem.of(robot_for(None, task.robot), task)
    return first_guess(problem, decompositions_of(problem, ()))


@pytest.mark.parametrize("extras", EXTRAS.values(), ids=EXTRAS)
def test_a_first_motion_keeps_all_limits(extras):
    outcome = find_first_motion(guess_with(extras), NEVER)
    assert outcome.status == "verified"
    assert outcome.t_end < 20.0


def test_without_time_there_is_no_first_motion():
    guess = guess_with(EXTRAS["a process speed"])
    assert not find_first_motion(guess, Deadline(0.0)).verified
