"""Timings of the TX90L on its rail and of the closed forms for poses.

Goals: 0.15 s a plan of the third example (N = 20), 2.5 ms for the Jacobian at 61 collocation points, 5 us a pose for
the spherical wrist in batches of 2000, 15 us for EAIK.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brachis import Robot, ik, load_task, plan, transcribe
from brachis.ik.eaik import eaik
from brachis.optimise.backends import SolverOptions, solvers_for
from brachis.optimise.guess import starting_point
from brachis.robot import task_map_of
from brachis.search.differential_ik import differential_ik_paths

ROOT = Path(__file__).parents[1]
POSES = 2000


def first_point(program):
    """Start from the first joint path of numeric inverse kinematics."""
    joint_path = next(differential_ik_paths(program.phases[0].joint_map))
    return starting_point(program, [joint_path], [None])


@pytest.fixture(scope="module")
def task():
    return load_task(ROOT / "examples/03_tx90l_rail_line.yaml")


@pytest.fixture(scope="module")
def tx90l():
    return Robot.from_urdf(ROOT / "robots/tx90l_rail/robot.urdf")


def test_plan_solved_once(benchmark, tx90l, task):
    """Transcribe, guess and solve at N = 20: no refinement, no verification."""

    def solve():
        program, _ = transcribe(tx90l, task)
        return solvers_for("uno")[0].solve(
            program, first_point(program), SolverOptions(), None
        )

    assert benchmark(solve).status.usable


@pytest.mark.parametrize("effort", ["single", "fast"])
@pytest.mark.parametrize("joint", ["rail", "auto"])
def test_plan_refined_and_verified(benchmark, tx90l, task, joint, effort):
    """The library call at N = 20."""
    search = {"effort": effort}
    given = {
        **task.to_dict(),
        "redundant_joints": "auto" if joint == "auto" else [joint],
        "search": search,
    }
    assert benchmark.pedantic(plan, (tx90l, given), rounds=5, warmup_rounds=1).verified


@pytest.mark.parametrize("part", ["rows", "Jacobian"])
def test_evaluation(benchmark, tx90l, task, part):
    """Rows, or the whole Jacobian once the rows are known, at K = 61."""
    program, _ = transcribe(tx90l, task)
    assert program.collocation_points == 61
    x = first_point(program)

    def another():
        x[0] += 1e-9  # another x every time, so that nothing is reused
        if part == "Jacobian":
            program.rows(x)

    benchmark.pedantic(
        lambda: program.rows(x) if part == "rows" else program.jacobian(x),
        setup=another,
        rounds=200,
    )


def poses(robot, task_map):
    """Random postures, and the poses that they reach."""
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (POSES, robot.n))
    return q, task_map.values(q)


@pytest.mark.parametrize("joint", ["rail", "joint_1", "joint_2", "joint_3"])
def test_spherical_wrist(benchmark, tx90l, joint):
    """A batch of 2000 poses, all branches."""
    space = task_map_of(tx90l, "pose")
    match = ik.find(tx90l, space, [joint])
    q, targets = poses(tx90l, space)
    benchmark(match.solver.solve, targets, q[:, [tx90l.joint_names.index(joint)]])


def test_eaik(benchmark, tx90l):
    """The same with EAIK, rail redundant: constant geometry."""
    space = task_map_of(tx90l, "pose")
    solver = eaik.build(ik.ChainGeometry.of(tx90l), space, (0,))
    q, targets = poses(tx90l, space)
    benchmark(solver.solve, targets, q[:, [0]])
