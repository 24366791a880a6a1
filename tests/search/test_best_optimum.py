"""Two of the paper's lines with everything left open: at the best optimum that random restarts find."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.nlp.guess import starting_point
from brachis.problem import Problem, decompositions_of, program_of
from brachis.search.solving import MARGINS, continued
from brachis.solvers import SolverOptions, solver_named

ROOT = Path(__file__).parents[2]
RESTARTS = 12
LINES_DEG = (180, 270)
"""One with two optima, and the one whose plans with different redundant joints differ most."""
spec = importlib.util.spec_from_file_location("scara_table", ROOT / "examples/02_scara_table.py")
table = importlib.util.module_from_spec(spec)
spec.loader.exec_module(table)


def random_joint_path(rng: np.random.Generator, start: float) -> np.ndarray:
    """A smooth joint path of the redundant joint that may go anywhere, (S, 2)."""
    s = np.linspace(0.0, 1.0, 41)
    sizes = rng.normal(size=4) * [1.5, 0.8, 0.5, 0.3]
    waves = sum(size * np.sin(k * np.pi * s) for k, size in enumerate(sizes[1:], 1))
    return np.column_stack([s, start + sizes[0] * s + waves])


def restarts(problem: Problem) -> dict[str, np.ndarray]:
    """End times, s, of plans from random joint paths, for every choice of the redundant joint."""
    rng = np.random.default_rng(0)
    times = {}
    for decomposition in decompositions_of(problem):
        joint_map = decomposition.joint_map(problem.start, decomposition.branches[0])
        program = program_of(problem, joint_map, np.linspace(0.0, 1.0, 21))
        found = []
        for _ in range(4000):
            x = starting_point(program, [random_joint_path(rng, problem.start[decomposition.redundant[0]])])
            if x is None:
                continue
            _, reports = continued(program, x, solve, MARGINS)
            found.append(reports[-1].objective if reports[-1].status.usable else np.inf)
            if len(found) == RESTARTS:
                break
        times[decomposition.name] = np.array(found)
    return times


def solve(program, x):
    return solver_named("uno")[0].solve(program, x, SolverOptions(max_iterations=100, time_limit=5.0), None)


@pytest.mark.parametrize("angle", LINES_DEG)
def test_auto_is_at_the_best_optimum_of_random_restarts(angle):
    robot, task = table.robot_and_task(angle, "auto")
    result = brachis.plan(robot, task)
    assert result.verified
    times = restarts(Problem.of(robot, brachis.load_task(task)))
    assert set(times) == {"j1", "j2", "j3"}
    assert all(len(found) == RESTARTS for found in times.values())
    best = min(found.min() for found in times.values())
    # A motion in a chart is solved again with joints in place of the chart's rows, and the fastest one is refined.
    coarse = min(report.objective for report in result.attempt.reports if report.status.usable)
    assert coarse <= best * (1.0 + 1e-4)
    assert result.t_end <= best * (1.0 + 2e-3)  # the limits now hold between the points as well
    if angle == 180:
        assert result.t_end <= 2.10
        assert np.median(times["j1"]) > 2.3, "this line asks for the search"
