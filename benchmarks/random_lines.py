"""Random reachable lines from random start postures: how many end in a verified plan.

Usage: python benchmarks/random_lines.py [SEED] [COUNT]

Start postures of the planar 3R are uniform over a full turn of every joint, directions uniform, lengths uniform from
0.2 m to 1.5 m; a line counts as reachable if it stays within 2.9 m of the base. The redundant joint goes round.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from brachis import BrachisError, LimitSpec, Robot, plan

ROOT = Path(__file__).parents[1]


def random_tasks(robot: Robot, seed: int, count: int) -> Iterator[dict[str, object]]:
    """Yield task mappings."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        while True:
            q = rng.uniform(-np.pi, np.pi, 3)
            length, angle = rng.uniform(0.2, 1.5), rng.uniform(0.0, 2.0 * np.pi)
            end = robot.tool_placement(q).translation[:2] + length * np.array(
                [np.cos(angle), np.sin(angle)]
            )
            if np.linalg.norm(end) < 2.9:
                break
        yield {
            "brachis": 1,
            "start": {"joints": q},
            "task_space": ["x", "y"],
            "path": [{"line": {"to": list(end)}}],
            "redundant_joints": [f"j{number % 3 + 1}"],
            "spline": {"intervals": 20},
        }


def main() -> None:
    """Print every failure with its reason, then the count."""
    arguments = [int(argument) for argument in sys.argv[1:]]
    seed, count = (*arguments, *(0, 200)[len(arguments) :])
    robot = Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf",
        gravity=[0, 0, 0],
        limits=LimitSpec(torque=10.0, velocity=None),
    )
    verified, times = 0, []
    for number, task in enumerate(random_tasks(robot, seed, count)):
        began = time.perf_counter()
        try:
            passed = plan(robot, task).verified
            verified += passed
            if not passed:
                print(f"{number}: unverified")
        except BrachisError as error:
            print(f"{number}: {type(error).__name__}: {error}")
        times.append(time.perf_counter() - began)
    print(
        f"seed {seed}: {verified} of {count} verified; time a plan: median {np.median(times):.3f} s, "
        f"95 % {np.percentile(times, 95):.3f} s, longest {max(times):.3f} s"
    )


if __name__ == "__main__":
    main()
