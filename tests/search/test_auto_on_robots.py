"""Everything left open on spatial arms, and on random postures and lines (all of them: `benchmarks/random_auto.py`)."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

import brachis
from brachis.kinematics import CHART

ROOT = Path(__file__).parents[2]
RAIL_LINE = ROOT / "examples/03_tx90l_rail_line.yaml"


@pytest.fixture(scope="module")
def bench():
    folder = str(ROOT / "benchmarks")
    sys.path.insert(0, folder)
    try:
        spec = importlib.util.spec_from_file_location(
            "random_auto", ROOT / "benchmarks/random_auto.py"
        )
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(folder)
    return module


def test_auto_is_never_slower_than_the_rail_alone():
    task = brachis.load_task(RAIL_LINE).to_dict()
    task["spline"]["intervals"] = 10
    rail = brachis.plan(task)
    auto = brachis.plan({**task, "redundant_joints": "auto"})
    assert rail.verified
    assert auto.verified
    assert auto.t_end <= rail.t_end * (1.0 + 1e-6)
    assert {candidate.branch for candidate in auto.candidates} == {CHART}, (
        "no closed form is needed"
    )


@pytest.mark.parametrize(
    ("name", "count"),
    [("scara3", 1), ("tx90l_rail", 1), ("ur10_rail", 1), ("iiwa14", 1)],
)
def test_random_postures_and_lines_with_everything_left_open(bench, name, count):
    robot = {"scara3": bench.planar_arm()}.get(name) or brachis.Robot.from_urdf(
        ROOT / f"robots/{name}/robot.urdf"
    )
    tasks = list(bench.tasks(name, robot, seed=1, count=count))
    assert len(tasks) == count
    for task in tasks:
        assert bench.has_course(robot, task)
        assert bench.random_poses.tried(robot, task) == ""
