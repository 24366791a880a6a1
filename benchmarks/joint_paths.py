"""Seeded paths of a seven-joint arm, timed by brachis and by toppra under the same limits, side by side.

Usage: python benchmarks/joint_paths.py [--count 100] [--first 0] [--save]

Natural quintic splines through random waypoints of the KUKA iiwa 14, with limits on velocity, acceleration and torque.
brachis plans cubic splines s(t) (continuous torque), from rest to rest, and its motion is refined and verified; toppra
gets what its users give it, a `SplineInterpolator` through points of the same path (401 of them).
"""

from __future__ import annotations

import argparse
import importlib.util
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import brachis
from brachis.path import path_of
from brachis.robot import bind
from committed import processor_time, save

ROOT = Path(__file__).parents[1]
URDF = ROOT / "robots/iiwa14/robot.urdf"
OURS = ("auto", 150)
"""Values of spline.intervals."""
THEIRS = (1000, 2000)
"""Intervals of toppra's grid."""
ACTIVE, HELD = 0.999, 0.9
"""Parts of a limit: from the first one on it is active; gravity alone takes at most the second one of torques."""


def case(seed: int, intervals: int | str) -> brachis.Task:
    """Return the task with this number: the first drawn path that stays in range and can be held up at rest."""
    rng = np.random.default_rng(seed)
    while True:
        content = _drawn(rng, intervals)
        task = brachis.load_task(content)
        robot, task_map = bind(
            brachis.Robot.from_urdf(URDF, limits=task.robot.limits), task.task_space
        )
        q = path_of(task_map, task).sample(np.linspace(0.0, 1.0, 200)).target
        data = robot.model.createData()
        held = np.array(
            [pin.computeGeneralizedGravity(robot.model, data, each) for each in q]
        )
        within = (q >= robot.limits.position_lower) & (q <= robot.limits.position_upper)
        if within.all() and (np.abs(held) < HELD * robot.limits.torque).all():
            return task


def _drawn(rng: np.random.Generator, intervals: int | str) -> dict[str, Any]:
    """Draw waypoints and limits."""
    limits = brachis.Robot.from_urdf(URDF).limits
    count = len(limits.torque)
    waypoints = rng.uniform(
        0.6 * limits.position_lower,
        0.6 * limits.position_upper,
        (rng.integers(3, 8), count),
    )
    return {
        "brachis": 1,
        "robot": {
            "urdf": str(URDF),
            "limits": {
                "acceleration": rng.uniform(10.0, 25.0, count).round(2).tolist(),
                "scale": {
                    "torque": round(float(rng.uniform(0.3, 0.45)), 2),
                    "velocity": 1.5,
                },
            },
        },
        "start": {"joints": waypoints[0].tolist()},
        "task_space": "joints",
        "path": [{"spline": {"through": waypoints[1:].tolist()}}],
        "spline": {"intervals": intervals, "rest": "velocity"},
        "search": {
            "least_motion": False,
            "time_limit": 600.0,
        },  # no busy machine ends a search early
    }


def main() -> None:
    """Print a line a case, then a summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--save", action="store_true", help="into benchmarks/results")
    given = parser.parse_args()
    spec = importlib.util.spec_from_file_location(
        "example", ROOT / "examples/11_from_toppra.py"
    )
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    example.by_toppra(*_points(example, case(0, 20)), intervals=100)  # imports toppra
    active = Counter[str]()
    cases = []
    print("end times, s, and processor times, s")
    for seed in range(given.first, given.first + given.count):
        row = {}
        for intervals in OURS:
            began = processor_time()
            result = brachis.plan(case(seed, intervals))
            row[f"brachis, {intervals}"] = (
                result.t_end if result.verified else np.inf,
                processor_time() - began,
            )
        active.update(
            c.name for c in result.verification.checks if c.limit and c.value > ACTIVE
        )
        robot, *points = _points(example, result.task)
        for intervals in THEIRS:
            began = processor_time()
            t_end = example.by_toppra(robot, *points, intervals=intervals)
            row[f"toppra, {intervals}"] = (t_end, processor_time() - began)
        cases.append(list(row.values()))
        cells = (
            f"{name}: {t_end:.4f} in {took:.3f}" for name, (t_end, took) in row.items()
        )
        print(f"{seed:4d}", *cells, sep="   ", flush=True)
    summarise(tuple(row), np.array(cases), active)


def _points(
    example: Any, task: brachis.Task
) -> tuple[brachis.Robot, np.ndarray, np.ndarray]:
    """Return what toppra's users have: the robot with its limits, and points of the joint path."""
    robot = brachis.Robot.from_urdf(URDF, limits=task.robot.limits)
    return robot, *example.joint_points(robot, task)


def summarise(names: tuple[str, ...], cases: np.ndarray, active: Counter[str]) -> None:
    """Print, and keep if asked, what came of all cases: end times and processor times, (cases, names, 2), s."""
    gaps = cases[:, :, 0] / cases[:, -1:, 0] - 1.0
    rows = []
    for name, gap, seconds in zip(names, gaps.T, cases[:, :, 1].T, strict=True):
        held = gap[np.isfinite(gap)]
        span = f"{100.0 * held.min():+.3f} % to {100.0 * held.max():+.3f} %, median {100.0 * np.median(held):+.3f} %"
        rows.append((name, f"{len(held)}", span, f"{1e3 * np.median(seconds):.0f} ms"))
    columns = (
        "",
        "planned",
        "end time compared with toppra's on 2000 intervals",
        "processor time, median",
    )
    for row in (columns, *rows):
        print(" | ".join(row))
    limits = ", ".join(
        f"{name.removesuffix(' ratio')} limit active in {count}"
        for name, count in active.items()
    )
    about = (
        f"{len(cases)} paths of the KUKA iiwa 14 through three to seven random waypoints; {limits}. The plans of "
        "brachis are refined and verified; toppra meets limits at its grid points."
    )
    print(about)
    save("Paths of joints, beside toppra", columns, rows, about)


if __name__ == "__main__":
    main()
