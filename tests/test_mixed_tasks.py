"""Random tasks of mixed kinds have the solution that they are made from; so does the plain transcription beside them.

The full counts are `benchmarks/mixed_tasks.py` and `benchmarks/restarts.py`.
"""

import numpy as np
import pytest

from brachis.problem.problem import Problem
from brachis.robot.from_task import robot_for
from brachis.task import load_task

CASES = [
    *(("tx90l_rail", number) for number in range(6)),
    ("planar4", 1),
    ("scara3", 2),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tasks")


def problem_of(case):
    task = load_task(case.task)
    return Problem.of(robot_for(None, task.robot), task)


@pytest.mark.parametrize("robot, number", CASES)
def test_the_known_joint_path_is_on_the_path_within_ranges_from_start_to_end(
    bench, robot, number, folder
):
    case = bench("mixed_cases").case(robot, 0, number, folder)
    problem, joint_path = problem_of(case), case.joint_path
    targets = problem.path.sample(np.linspace(0.0, 1.0, len(joint_path))).target
    assert (
        np.abs(
            problem.task_map.difference(targets, problem.task_map.values(joint_path))
        ).max()
        < 1e-8
    )
    limits = problem.robot.limits
    assert np.all(
        (joint_path >= limits.position_lower) & (joint_path <= limits.position_upper)
    )
    for given, own in ((problem.start, joint_path[0]), (problem.end, joint_path[-1])):
        assert given is None or np.allclose(given, own, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("robot, number", [("tx90l_rail", 1), ("planar4", 1)])
def test_derivatives_of_the_plain_transcription(bench, robot, number, folder):
    case = bench("mixed_cases").case(robot, 0, number, folder)
    program = bench("full_space").FullSpace(problem_of(case), 3)
    x, rng = program.starting_point(case.joint_path, 2.0), np.random.default_rng(0)
    x[1:] += 1e-3 * rng.normal(size=len(x) - 1)
    step = rng.normal(size=len(x))
    slope = (program.rows(x + 1e-6 * step) - program.rows(x - 1e-6 * step)) / 2e-6
    entries = program.jacobian(x) * step[program.jacobian_columns]
    exact = np.bincount(
        program.jacobian_rows, weights=entries, minlength=len(program.lower)
    )
    assert np.abs(slope - exact).max() < 1e-6 * np.abs(exact).max()
    ahead, behind = (program.objective(x + sign * 1e-6 * step) for sign in (1.0, -1.0))
    assert program.gradient(x) @ step == pytest.approx(
        (ahead - behind) / 2e-6, rel=1e-6
    )
