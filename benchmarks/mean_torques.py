"""Random tasks with root-mean-square limits on the torques, planned with `solver: auto`.

Usage: python benchmarks/mean_torques.py [--seed 0] [--count 6] [--save]

Tasks are those of `mixed_cases`. Each is planned without such limits first. The limits then allow the mean squares of
the static torques, and two thirds of what the motion adds.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from pathlib import Path

import numpy as np

import brachis
import mixed_cases
from brachis.errors import BrachisError, BrachisWarning
from brachis.robot import dynamics
from brachis.task import Task, load_task
from brachis.task.keywords import task_with
from committed import processor_time, save

ROBOTS = ("panda", "iiwa14", "tx90l_rail", "ur10_rail", "planar4", "scara3")
SETTINGS = {"search.least_motion": False, "search.jobs": 1}
SHARE = 2.0 / 3.0
LEAST_SHARE = 1e-3
"""Part of a torque limit: joints that need less on average get no such limit."""


def find_rms_limits(result: brachis.Result) -> dict[str, float]:
    """RMS torques, Nm or N, that make a motion slower."""
    robot = result.trajectory.robot
    t = np.linspace(0.0, result.t_end, 4001)
    motion = result.trajectory.at(t)
    still = np.zeros_like(motion.q)
    squares = [
        np.trapezoid(dynamics.torque(robot, motion.q, *rates) ** 2, t, axis=0)
        for rates in ((motion.qdot, motion.qddot), (still, still))
    ]
    total, static = np.array(squares) / result.t_end
    allowed = np.sqrt(static + SHARE * np.maximum(total - static, 0.0))
    is_loaded = allowed > LEAST_SHARE * robot.limits.torque_upper
    names = np.array(robot.joint_names)[is_loaded]
    return dict(zip(names.tolist(), allowed[is_loaded].tolist(), strict=True))


def measure_plan(task: Task) -> tuple[float, float, bool]:
    """Processor time, s, end time, s, and whether the plan is verified."""
    busy = processor_time()
    t_end = np.inf
    verified = False
    try:
        result = brachis.plan(task, strict=False)
        t_end = result.t_end
        verified = result.verified
    except BrachisError as error:
        print(f"  {error}")
    return processor_time() - busy, t_end, verified


def main() -> None:
    """Plan and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=6, help="tasks of each robot")
    parser.add_argument("--save", action="store_true")
    arguments = parser.parse_args()
    rows: list[tuple[str, ...]] = []
    count = 0
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", BrachisWarning)
        for number in range(arguments.count):
            for robot in ROBOTS:
                case = mixed_cases.case(robot, arguments.seed, number, Path(folder))
                task = load_task(case.task, changes=SETTINGS)
                free = brachis.plan(task, strict=False)
                task = task_with(task, limits={"rms_torque": find_rms_limits(free)})
                time, t_end, verified = measure_plan(task)
                count += verified
                row = (
                    case.name,
                    f"{free.t_end:.4f} s",
                    f"{t_end:.4f} s",
                    f"{time:.1f} s",
                    "yes" if verified else "no",
                )
                rows.append(row)
                print(" | ".join(row), flush=True)
    about = f"{count} of {len(rows)} are verified."
    print(about)
    columns = ("task", "without", "auto", "processor time, auto", "verified")
    save("Root-mean-square torques", columns, rows, about)


if __name__ == "__main__":
    main()
