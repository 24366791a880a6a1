"""Seeded paths of a seven-joint arm, timed by brachis and by toppra under the same limits, side by side.

Usage: python benchmarks/joint_paths.py [--count 100] [--first 0] [--intervals 150] [--save]

Natural quintic splines through random waypoints of the KUKA iiwa 14, with limits on velocity, acceleration and torque.
brachis plans cubic splines s(t) (continuous torque), from rest to rest, and its motion is refined and verified; toppra
takes the very same path on a fine grid, on which limits hold at grid points alone.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import brachis
from brachis.path import path_of
from brachis.robot import bind
from committed import save

ROOT = Path(__file__).parents[1]
URDF = ROOT / "robots/iiwa14/robot.urdf"
ACTIVE, HELD = 0.999, 0.9
"""Parts of a limit: from the first one on it is active; gravity alone takes at most the second one of torques."""


def case(seed: int, intervals: int) -> brachis.Task:
    """Return the task with this number: the first drawn path that stays in range and can be held up at rest."""
    rng = np.random.default_rng(seed)
    while True:
        content = _drawn(rng, intervals)
        task = brachis.load_task(content)
        robot, task_map = bind(brachis.Robot.from_urdf(URDF, limits=task.robot.limits), task.task_space)
        q = path_of(task_map, task).sample(np.linspace(0.0, 1.0, 200)).target
        data = robot.model.createData()
        held = np.array([pin.computeGeneralizedGravity(robot.model, data, each) for each in q])
        within = (q >= robot.limits.position_lower) & (q <= robot.limits.position_upper)
        if within.all() and (np.abs(held) < HELD * robot.limits.torque).all():
            return task


def _drawn(rng: np.random.Generator, intervals: int) -> dict[str, Any]:
    """Draw waypoints and limits."""
    limits = brachis.Robot.from_urdf(URDF).limits
    count = len(limits.torque)
    waypoints = rng.uniform(0.6 * limits.position_lower, 0.6 * limits.position_upper, (rng.integers(3, 8), count))
    return {
        "brachis": 1,
        "robot": {
            "urdf": str(URDF),
            "limits": {
                "acceleration": rng.uniform(10.0, 25.0, count).round(2).tolist(),
                "scale": {"torque": round(float(rng.uniform(0.3, 0.45)), 2), "velocity": 1.5},
            },
        },
        "start": {"joints": waypoints[0].tolist()},
        "task_space": "joints",
        "path": [{"spline": {"through": waypoints[1:].tolist()}}],
        "spline": {"intervals": intervals, "rest": "velocity"},
        "search": {"least_motion": False, "time_limit": 600.0},  # no busy machine ends a search early
    }


def main() -> None:
    """Print a line a case, then a summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--intervals", type=int, default=150)
    parser.add_argument("--save", action="store_true", help="into benchmarks/results")
    given = parser.parse_args()
    spec = importlib.util.spec_from_file_location("example", ROOT / "examples/11_from_toppra.py")
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    rows, active = [], Counter[str]()
    print("case   brachis t_E   toppra t_E   difference   brachis   toppra (processor time)")
    for seed in range(given.first, given.first + given.count):
        task = case(seed, given.intervals)
        robot, began = brachis.Robot.from_urdf(URDF, limits=task.robot.limits), time.process_time()
        least = example.by_toppra(robot, task)
        theirs = time.process_time() - began
        began = time.process_time()
        try:
            result = brachis.plan(task)
            t_end = result.t_end if result.verified else np.inf
            used = {check.name: check.value for check in result.verification.checks if check.of_limit}
            active.update(name for name, ratio in used.items() if ratio > ACTIVE)
        except brachis.BrachisError as error:
            print(error)
            t_end = np.inf
        ours = time.process_time() - began
        rows.append((t_end / least - 1.0, ours, theirs))
        print(f"{seed:4d} {t_end:11.4f} s {least:10.4f} s {100.0 * rows[-1][0]:10.3f} % {ours:7.2f} s {theirs:6.2f} s")
    summarise(np.array(rows), active)


def summarise(rows: np.ndarray, active: Counter[str]) -> None:
    """Print, and keep if asked, what came of all cases: rows of relative difference and both processor times, s."""
    gaps, ours_all, theirs_all = rows.T
    print(
        f"{len(rows)} cases, {int(np.isinf(gaps).sum())} failed; difference {100.0 * gaps.min():.3f} to "
        f"{100.0 * gaps.max():.3f} %, median {100.0 * np.median(gaps):.3f} %; processor time, median: brachis "
        f"{np.median(ours_all):.2f} s (refined and verified), toppra {np.median(theirs_all):.2f} s (2000 intervals)"
    )
    limits = ", ".join(f"{name.removesuffix(' ratio')} limit active in {count}" for name, count in active.items())
    print(limits)
    about = f"Paths of the KUKA iiwa 14 through three to seven random waypoints; {limits}."
    cells = [
        ("planned and verified", str(len(rows) - int(np.isinf(gaps).sum())), str(len(rows))),
        (
            "end time beside toppra's",
            f"{100.0 * gaps.min():+.3f} % to {100.0 * gaps.max():+.3f} %, median {100.0 * np.median(gaps):+.3f} %",
            "grid of 2000 intervals",
        ),
        (
            "processor time, median",
            f"{np.median(ours_all):.2f} s, refined and verified",
            f"{np.median(theirs_all):.2f} s",
        ),
    ]
    save("Paths of joints, beside toppra", (f"{len(rows)} paths", "brachis", "toppra"), cells, about)


if __name__ == "__main__":
    main()
