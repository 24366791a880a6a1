"""The paper's lines with everything left open, beside random restarts of every choice of the redundant joint.

Usage: python studies/scara_restarts.py [--restarts 12]
"""

from __future__ import annotations

import argparse
import importlib.util
from pathlib import Path

import numpy as np

from brachis import load_task, plan
from brachis.optimise.backends import SolverOptions, solvers_for
from brachis.optimise.guess import starting_point
from brachis.optimise.transcription import program_of
from brachis.problem.problem import Problem, decompositions_of

ROOT = Path(__file__).parents[1]
spec = importlib.util.spec_from_file_location(
    "scara_table", ROOT / "examples/02_scara_table.py"
)
table = importlib.util.module_from_spec(spec)
spec.loader.exec_module(table)


def random_joint_path(rng: np.random.Generator, start: float) -> np.ndarray:
    """A smooth joint path of the redundant joint that may go anywhere, (S, 2)."""
    s = np.linspace(0.0, 1.0, 41)
    sizes = rng.normal(size=4) * [1.5, 0.8, 0.5, 0.3]
    waves = sum(size * np.sin(k * np.pi * s) for k, size in enumerate(sizes[1:], 1))
    return np.column_stack([s, start + sizes[0] * s + waves])


def restarts(problem: Problem, count: int) -> dict[str, np.ndarray]:
    """End times, s, of so many plans from random joint paths, for every choice of the redundant joint."""
    rng = np.random.default_rng(0)
    times = {}
    for decomposition in decompositions_of(problem):
        joint_map = decomposition.joint_map(problem.start, decomposition.branches[0])
        program = program_of(problem, [joint_map])
        found = []
        for _ in range(4000):
            begin = problem.start[decomposition.redundant[0]]
            x = starting_point(program, [random_joint_path(rng, begin)], [None])
            if x is None:
                continue
            report = solve(program, x)
            found.append(report.objective if report.status.usable else np.inf)
            if len(found) == count:
                break
        times[decomposition.name] = np.array(found)
    return times


def solve(program, x):
    return solvers_for("uno")[0].solve(
        program, x, SolverOptions(max_iterations=100, time_limit=5.0), None
    )


def main() -> None:
    """Print a line for every angle."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--restarts", type=int, default=12)
    count = parser.parse_args().restarts
    for angle in table.ANGLES_DEG:
        robot, task = table.robot_and_task(angle, "auto")
        result = plan(robot, task)
        coarse = min(
            report.objective
            for report in result.candidate.reports
            if report.status.usable
        )
        times = restarts(Problem.of(robot, load_task(task)), count)
        best = min(found.min() for found in times.values())
        medians = ", ".join(
            f"{name} {np.median(found):.4f} s" for name, found in times.items()
        )
        print(
            f"{angle} deg: auto {coarse:.4f} s, best restart {best:.4f} s; medians: {medians}",
            flush=True,
        )


if __name__ == "__main__":
    main()
