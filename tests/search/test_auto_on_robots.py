"""Everything left open on spatial arms, and on random postures and lines (all of them: `benchmarks/random_auto.py`)."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import brachis
from brachis.common.deadline import NEVER
from brachis.kinematics import CHART
from brachis.problem.problem import Problem, decompositions_of
from brachis.robot.from_task import robot_from_settings
from brachis.search.guesses import SEARCH_LEVELS
from brachis.search.schedule import batches

ROOT = Path(__file__).parents[2]
COARSE = {"cells_per_turn": 24, "nodes": 40}
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


def test_closed_forms_are_left_for_the_last(
    monkeypatch,
):
    monkeypatch.setattr(
        "brachis.search.schedule.numeric_guesses", lambda *_given: []
    )  # come after the lattices
    for (
        effort,
        levels,
    ) in (
        SEARCH_LEVELS.items()
    ):  # which choices are looked at does not depend on how closely
        monkeypatch.setitem(
            SEARCH_LEVELS, effort, tuple(replace(each, **COARSE) for each in levels)
        )
    task = brachis.load_task(
        {**brachis.load_task(RAIL_LINE).to_dict(), "redundant_joints": "auto"}
    )
    names: dict[str, set[str]] = {}
    for level in ("fast", "thorough"):
        asked = task.model_copy(
            update={"search": task.search.model_copy(update={"effort": level})}
        )
        problem = Problem.of(robot_from_settings(task.robot), asked)
        planned = list(
            batches(
                problem,
                decompositions_of(problem),
                NEVER,
                lambda _text: None,
            )
        )
        first = [
            guess for batch in planned if not batch.fallback for guess in batch.guesses
        ]
        last = [guess for batch in planned if batch.fallback for guess in batch.guesses]
        assert first
        assert {guess.joint_map.branch_label for guess in first} == {CHART}
        names[level] = {
            *(
                name
                for guess in last
                if guess.origin.startswith("lattice")
                for name in guess.joint_map.redundant_joints
            )
        }
    assert names["fast"] == {"rail", "joint_1", "joint_2", "joint_3"}
    assert names["thorough"] == names["fast"]


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
