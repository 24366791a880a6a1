"""Random plans under limits of all kinds, third-order ones of every size among them: none is unverified by rounding.

    python benchmarks/third_order_plans.py                     # 300 plans of the planar arm; exit code 1 on a fault
    python benchmarks/third_order_plans.py --first 20 --count 5 --seconds 600

A motion that is refused although the refinement found every limit kept is a fault, and printed with the check that
failed. Where the refinement did not get there in time, nothing is said of rounding.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

import brachis

ROBOT = Path(__file__).parents[1] / "robots/scara3/robot.urdf"


def task_of(number: int) -> dict[str, Any]:
    """Make a task of a number."""
    rng = random.Random(f"third order {number}")  # noqa: S311  (not for secrets)

    def size(low: float, high: float) -> float:
        return float(low * (high / low) ** rng.random())

    limits: dict[str, Any] = {
        "torque": size(3.0, 30.0),
        "velocity": rng.choice((None, size(0.5, 8.0))),
    }
    for kind, low, high in (
        ("torque_rate", 10.0, 5000.0),
        ("jerk", 5.0, 5000.0),
        ("acceleration", 2.0, 50.0),
    ):
        if rng.random() < 0.5:
            limits[kind] = size(low, high)
    tool = {
        kind: size(low, high)
        for kind, low, high in (
            ("speed", 0.1, 2.0),
            ("acceleration", 0.5, 10.0),
            ("angular_speed", 0.3, 3.0),
        )
        if rng.random() < 0.15
    }
    degree = rng.choice((3, 3, 4, 5))
    return {
        "brachis": 1,
        "robot": {"urdf": str(ROBOT), "gravity": [0, 0, 0], "limits": limits},
        "start": {
            "joints": [
                rng.uniform(-1.5, 1.5),
                rng.choice((-1, 1)) * rng.uniform(1.0, 2.0),
                rng.uniform(0.5, 2.0),
            ]
        },
        "task_space": ["x", "y"],
        "path": [
            {"line": {"length": size(0.05, 0.6), "angle_deg": rng.uniform(0.0, 360.0)}}
        ],
        "redundant_joints": [rng.choice(("j1", "j3"))],
        "tool_limits": tool,
        "spline": {
            "degree": degree,
            "intervals": rng.choice(("auto", rng.randrange(8, 30))),
            "rest": "jerk" if degree > 3 and rng.random() < 0.5 else "full",
        },
        "search": {"effort": "single", "least_motion": False, "time_limit": 120.0},
    }


def run(number: int) -> tuple[str, str]:
    """Plan a task; return what came out, and of a motion that was refused why."""
    try:
        result = brachis.plan(task_of(number))
    except brachis.BrachisError as error:
        return type(error).__name__, ""
    if result.verified:
        return "verified", ""
    best = result.candidates[0]
    if best.violation > result.trajectory.task.refinement.tolerance:
        return "not refined in time", ""
    failed = [check for check in result.verification.checks if not check.passed]
    return "not verified", "; ".join(
        f"{check.name}: {check.in_words()}" for check in failed
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Plan under third-order limits of every size."
    )
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument(
        "--seconds", type=float, default=np.inf, help="after which no plan is begun"
    )
    given = parser.parse_args()
    began, counts, refused = time.perf_counter(), Counter(), 0
    for number in range(given.first, given.first + given.count):
        if time.perf_counter() - began > given.seconds:
            break
        outcome, reason = run(number)
        counts[
            outcome,
            "auto" if task_of(number)["spline"]["intervals"] == "auto" else "fixed",
        ] += 1
        if reason:
            refused += 1
            print(f"{number}: {reason}", flush=True)
        if sum(counts.values()) % 10 == 0:
            print(dict(counts), f"{time.perf_counter() - began:.0f} s", flush=True)
    for (outcome, intervals), count in sorted(counts.items()):
        print(f"{outcome:20} intervals {intervals:6} {count:4}")
    return 1 if refused else 0


if __name__ == "__main__":
    sys.exit(main())
