"""Random postures and lines with everything left open: of those with a joint path on a lattice, how many are planned.

Usage: python benchmarks/random_auto.py [ROBOT|all] [SEED] [COUNT]

The tasks are those of random_lines.py (the planar arm) and random_poses.py (the spatial ones) with
``redundant_joints: auto`` at effort fast. A lattice joint path exists if the lattice of any closed form has one; it is
looked for apart from the plan.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator

import numpy as np

import random_lines
import random_poses
from brachis import LimitSpec, Robot, load_task
from brachis.errors import BrachisError
from brachis.problem.problem import Problem, decompositions_of
from brachis.search.guesses import SEARCH_LEVELS, lattice_guesses
from brachis.search.joint_path import DeadEnd


def planar_arm() -> Robot:
    """Return the planar arm with the paper's limits."""
    urdf = random_lines.ROOT / "robots/scara3/robot.urdf"
    return Robot.from_urdf(
        urdf, gravity=[0, 0, 0], limits=LimitSpec(torque=10.0, velocity=None)
    )


def tasks(
    name: str, robot: Robot, seed: int, count: int
) -> Iterator[dict[str, object]]:
    """Yield task mappings with everything left open."""
    if name == "scara3":
        yield from (
            {**task, "redundant_joints": "auto"}
            for task in random_lines.random_tasks(robot, seed, count)
        )
    else:
        found = random_poses.random_tasks(
            robot, seed, count, random_poses.closed_forms(robot)
        )
        yield from ({**task, "redundant_joints": "auto"} for task in found)


def has_course(robot: Robot, task: dict[str, object]) -> bool:
    """Tell whether the lattice of any choice of redundant joints has a joint path."""
    try:
        found = decompositions_of(Problem.of(robot, load_task(task)))
    except BrachisError:
        return False
    return any(
        not isinstance(
            lattice_guesses(decomposition, SEARCH_LEVELS["fast"][0]), DeadEnd
        )
        for decomposition in found
    )


def main() -> None:
    """Print every failure with its reason, then the counts."""
    chosen = sys.argv[1] if len(sys.argv) > 1 else "all"
    seed, count = (
        int(value) for value in (*sys.argv[2:4], *("0", "100")[len(sys.argv[2:4]) :])
    )
    for name, robot in {"scara3": planar_arm(), **random_poses.robots()}.items():
        if chosen not in ("all", name):
            continue
        joint_paths, planned, times = 0, 0, []
        for number, task in enumerate(tasks(name, robot, seed, count)):
            exists = has_course(robot, task)
            began = time.perf_counter()
            reason = random_poses.tried(robot, task)
            times.append(time.perf_counter() - began)
            joint_paths += exists
            planned += exists and not reason
            if reason:
                print(
                    f"{name} {number}, {'a' if exists else 'no'} lattice joint path: {reason}",
                    flush=True,
                )
        print(
            f"{name}: {joint_paths} of {count} have a lattice joint path, {planned} of these are planned and verified; "
            f"median {np.median(times):.2f} s, longest {max(times):.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
