"""First guesses of motions with stops, given speeds and moving ends, on a slide."""

import numpy as np
import pytest

import brachis
from brachis.optimise.transcription import program_of
from brachis.problem.problem import Problem
from brachis.robot.from_task import robot_for
from brachis.search.guesses import FAMILY, joint_space_guess
from brachis.search.phase_plane import initial_guess
from brachis.task import task_with


def guess(content, *, is_timed):
    task = task_with(
        robot={"urdf": "gantry2"},
        gravity=[0, 0, 0],
        limits={"torque": None, "velocity": None, "acceleration": 1.0},
        task_space="joints",
        start=[0.0, 0.0],
        path=brachis.Line(by=[0.2, 0.0], stop=True) + brachis.Line(by=[0.3, 0.0]),
        intervals=40,
        **content,
    )
    problem = Problem.of(robot_for(None, task.robot), task)
    initial = joint_space_guess(problem)
    if not is_timed:
        even = np.linspace(0.0, 1.0, 101)[:, None]
        initial = type(initial)(problem, initial.joint_map, even, np.inf, "", FAMILY)
    program = program_of(problem, initial.maps_by_leg())
    return problem, program, initial_guess(program, initial)


WITH_SPEED = {
    "tool_limits": {"process_speed": {"speed": 0.2, "s": [0.6, 0.8]}},
}


@pytest.mark.parametrize("is_timed", [True, False])
@pytest.mark.parametrize("content", [{}, WITH_SPEED])
def test_every_leg_is_passed_from_its_begin_to_its_end(content, is_timed):
    problem, program, x = guess(content, is_timed=is_timed)
    motions = program.motions(x)
    assert len(motions) == len(problem.legs) == (4 if content else 2)
    for motion, leg, rates in zip(
        motions, problem.legs, problem.leg_rates, strict=True
    ):
        s, s_dt = motion.at(np.array([0.0, motion.t_end]))[:2]
        np.testing.assert_allclose(s[:, 0], [leg.begin, leg.end], atol=1e-9)
        np.testing.assert_allclose(s_dt[:, 0], rates, atol=1e-9)
