"""The best of many restarts of the plain transcription in all joints, beside what `plan` finds.

Usage: python benchmarks/restarts.py ROBOT [--seed 0] [--number 0] [--restarts 30] [--points 10] [--folder DIR]

The task is one of `mixed_tasks`, whose joint path is known; `full_space` says what IPOPT solves. Restarts begin
along joint paths that follow the prescribed path by damped least squares and lean towards random ones: the known one
with smooth bumps of up to 1.5 rad or m, or, with `start: free`, every other time a random motion that has nothing to do
with it. Both end times are of the same knots. That of the transcription is a little too good: limits hold at its
collocation points, and the path between its equations, to what is printed beside it.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import mixed_cases
from brachis import plan
from brachis.errors import BrachisError, BrachisWarning
from brachis.optimise.backends import SolverOptions, solvers_for
from brachis.problem.problem import Problem
from brachis.robot.from_task import robot_for
from brachis.task import load_task
from full_space import FullSpace
from mixed_robots import ROBOTS

BUMP = 1.5  # rad and m


def random_wish(
    rng: np.random.Generator, problem: Problem, known: np.ndarray
) -> np.ndarray:
    """Joint path, (K, n), towards which a restart leans; it begins at a given start posture."""
    if problem.start is None and rng.random() < 0.5:
        return mixed_cases.random_motion(rng, problem.robot)
    s = np.linspace(0.0, 1.0, len(known))[:, None]
    sizes = rng.uniform(-1.0, 1.0, (3, problem.robot.n)) * rng.uniform(0.0, BUMP)
    bumps = (
        sizes[0] * s
        + sizes[1] * np.sin(np.pi * s)
        + 0.5 * sizes[2] * np.sin(2.0 * np.pi * s)
    )
    return (
        known
        + bumps
        + (rng.uniform(-BUMP, BUMP, problem.robot.n) if problem.start is None else 0.0)
    )


def random_joint_path(
    rng: np.random.Generator, problem: Problem, known: np.ndarray
) -> np.ndarray:
    """Joint path, (K, n), near the prescribed path, from which a restart begins; it ends at a given end posture."""
    wish, limits = random_wish(rng, problem, known), problem.robot.limits
    targets = problem.path.sample(np.linspace(0.0, 1.0, len(known))).target
    q, joint_path = wish[0], []
    for target, wanted in zip(targets, wish, strict=True):
        q, _ = mixed_cases.corrected(problem.task_map, q, target, wanted)
        q = np.clip(q, limits.position_lower, limits.position_upper)
        joint_path.append(q)
    postures = np.array(joint_path)
    if problem.end is not None:
        postures += np.linspace(0.0, 1.0, len(postures))[:, None] * (
            problem.end - postures[-1]
        )
    return postures


def main() -> None:
    """Print every restart, then the best beside what `plan` finds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot", choices=ROBOTS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--number", type=int, default=0)
    parser.add_argument("--restarts", type=int, default=30)
    parser.add_argument(
        "--points", type=int, default=10, help="collocation points per knot interval"
    )
    parser.add_argument("--folder", type=Path, help="where task files go, or are")
    given = parser.parse_args()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="mixed-tasks-"))
    case = mixed_cases.case(given.robot, given.seed, given.number, folder)
    print(f"{case.name} ({case.kind}): {case.task}", flush=True)
    warnings.simplefilter("ignore", BrachisWarning)
    task = load_task(case.task)
    problem = Problem.of(robot_for(None, task.robot), task)
    program, rng = (
        FullSpace(problem, given.points),
        np.random.default_rng([given.seed, given.number]),
    )
    began, found = time.perf_counter(), []
    for restart in range(given.restarts):
        joint_path = (
            case.joint_path
            if restart == 0
            else random_joint_path(rng, problem, case.joint_path)
        )
        x = program.starting_point(joint_path, rng.uniform(1.0, 3.0))
        report = solvers_for("ipopt")[0].solve(
            program, x, SolverOptions(max_iterations=1000, time_limit=60.0), None
        )
        status = report.status.name.lower()
        print(
            f"  {restart}: {report.objective:.4f} s, {status}, {report.iterations} iterations",
            flush=True,
        )
        if report.feasible:
            found.append((report.objective, restart, report.x))
    print(
        f"{len(found)} of {given.restarts} restarts ended in a motion, {time.perf_counter() - began:.0f} s"
    )
    if found:
        best, restart, x = min(found, key=lambda each: each[0])
        beyond, off = program.in_between(x)
        print(
            f"best of all joints: {best:.4f} s (restart {restart}); limits {beyond:+.1e}, path {off:.1e} in between"
        )
    began = time.perf_counter()
    try:
        result = plan(task)
    except BrachisError as error:
        print(f"plan: {type(error).__name__}: {error}")
        return
    verified = "verified" if result.verified else "not verified"
    ratio = f", {result.t_end / best:.4f} times the best of all joints" if found else ""
    print(
        f"plan: {result.t_end:.4f} s, {verified}, in {time.perf_counter() - began:.1f} s{ratio}"
    )


if __name__ == "__main__":
    main()
