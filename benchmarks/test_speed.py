"""Timings of one plan and its parts: ``python3 tasks.py bench``.

Goals (planar 3R, N = 20): 40 ms a plan without refinement, 80 ms with refinement and verification, 1.5 ms for the rows
and the whole Jacobian at 61 collocation points. ``--benchmark-save`` and ``--benchmark-compare`` compare two runs.
"""

from __future__ import annotations

import numpy as np
import pytest

from brachis import plan, transcribe
from brachis.optimise.backends import SolverOptions, solvers_for
from brachis.optimise.guess import starting_point
from brachis.search.differential_ik import differential_ik_paths


def first_point(program):
    """Start from the first joint path of numeric inverse kinematics."""
    joint_path = next(differential_ik_paths(program.phases[0].joint_map))
    return starting_point(program, [joint_path], [None])


@pytest.mark.parametrize("joint", ["j1", "j2", "j3"])
def test_plan_solved_once(benchmark, robot, make_task, joint):
    """Transcribe, guess and solve at N = 20: no refinement, no verification."""
    task = make_task(joint)

    def solve():
        program, _ = transcribe(robot, task)
        return solvers_for("uno")[0].solve(
            program, first_point(program), SolverOptions(), None
        )

    report = benchmark(solve)
    assert report.status.usable


@pytest.mark.parametrize("effort", ["single", "fast"])
@pytest.mark.parametrize("joint", ["j1", "j2", "j3", "auto"])
def test_plan_refined_and_verified(benchmark, robot, make_task, joint, effort):
    """The library call at N = 20."""
    result = benchmark(plan, robot, make_task(joint, search={"effort": effort}))
    assert result.verified


@pytest.mark.parametrize("angle", range(0, 360, 45))
@pytest.mark.parametrize("jobs", [1, 2])
def test_fastest_motion(benchmark, robot, make_task, angle, jobs):
    """The paper's eight lines with everything left open; the goal is 3 s on two cores."""
    task = make_task("auto", angle=angle, search={"jobs": jobs})
    assert benchmark.pedantic(plan, (robot, task), rounds=3, warmup_rounds=1).verified


def test_plan_from_urdf(benchmark, robot, make_task):
    """The library call with reading the URDF."""
    result = benchmark(
        plan,
        robot.source,
        {**make_task("j1").to_dict(), "robot": {"gravity": [0, 0, 0]}},
    )
    assert result.verified


@pytest.mark.parametrize("part", ["rows", "rows and Jacobian"])
def test_evaluation(benchmark, robot, make_task, part):
    """Rows, or rows and the whole Jacobian, at K = 61."""
    program, _ = transcribe(robot, make_task("j1"))
    assert program.collocation_points == 61
    x = first_point(program)
    step = np.zeros_like(x)
    step[0] = 1e-9  # another x every time, so that nothing is reused

    def evaluate():
        nonlocal x
        x = x + step
        program.rows(x)
        if part != "rows":
            program.jacobian(x)

    benchmark(evaluate)
