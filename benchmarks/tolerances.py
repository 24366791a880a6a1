"""Random tasks whose tool may leave the path within ranges: how much faster they are, and whether they keep to these.

Usage: python benchmarks/tolerances.py [--seed 0] [--count 20] [--save]

Tasks are those of `mixed_cases` with poses. Each is planned as it is, and with a cone, a range of angles or a box.
An independent check takes the tool's place at 2,000 instants from the joints of the arm by Pinocchio, and compares it
with the path.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import brachis
import mixed_cases
from brachis.errors import BrachisError, BrachisWarning
from brachis.path import path_of
from brachis.robot import task_map_of
from brachis.task import Task, load_task
from committed import save

ROBOTS = ("iiwa14", "tx90l_rail", "ur10_rail", "panda", "xarm7")
RANGES = (
    {"orientation": {"tilt": 15.0}},
    {"orientation": {"lead": [-5.0, 10.0]}},
    {"orientation": {"roll": 30.0}},
    {"position": {"z": [-0.005, 0.002]}},
    {"position": {"sphere": 0.005}},
)
SETTINGS = {
    "spline.intervals": "auto",
    "spline.rest": "velocity",
    "search.least_motion": False,
    "search.time_limit": 60.0,
}


def largest_share(task: Task, trajectory: brachis.Trajectory) -> float:
    """Largest part of a range that is used, 1 at its ends, by Pinocchio on 2,000 instants."""
    robot = trajectory.robot
    count = len(robot.urdf_joints)
    t = np.linspace(0.0, trajectory.t_end, 2000)
    arm = brachis.Robot.from_settings(robot.settings, robot.source, robot.urdf)
    places, turns = arm.tool_placements(trajectory.position(t)[:, :count])
    s = trajectory.path_coordinate(t).clip(0.0, 1.0)
    target = path_of(task_map_of(robot, "pose"), task).sample(s).target
    back = target[:, 3:].reshape(-1, 3, 3).transpose(0, 2, 1)
    shift = np.einsum("kij,kj->ki", back, places - target[:, :3])
    turned = back @ turns
    tilt = np.degrees(np.arccos(turned[:, 2, 2].clip(-1.0, 1.0)))
    lead = np.degrees(np.arcsin(turned[:, 0, 2].clip(-1.0, 1.0)))
    roll = np.degrees(np.arctan2(-turned[:, 0, 1], turned[:, 0, 0]))
    asked = task.tolerances
    if asked.orientation.tilt is not None:
        return float(tilt.max() / asked.orientation.tilt)
    if asked.position.sphere is not None:
        return float(np.linalg.norm(shift, axis=1).max() / asked.position.sphere)
    pairs = (
        (lead, asked.orientation.lead),
        (roll, asked.orientation.roll),
        (shift[:, 2], asked.position.z),
    )
    values, (low, high) = next(pair for pair in pairs if pair[1] is not None)
    return float(np.abs(values - 0.5 * (low + high)).max() / (0.5 * (high - low)))


def plan_both(task: Task, number: int) -> tuple[str, ...]:
    """Plan a task without and with one of `RANGES`."""
    ranges = RANGES[number % len(RANGES)]
    times = []
    results = []
    for changes in ({}, {"tolerances": ranges}):
        began = time.perf_counter()
        try:
            results.append(brachis.plan(load_task(task, changes=changes), strict=False))
        except BrachisError as error:
            message = f"{type(error).__name__}: {str(error)[:150]}"
            return str(ranges), message, "", "", "", ""
        times.append(f"{time.perf_counter() - began:.1f} s")
    plain, ranged = results
    gain = 100.0 * (1.0 - ranged.t_end / plain.t_end)
    share = largest_share(ranged.task, ranged.trajectory)
    verdict = "" if plain.verified and ranged.verified else " NOT verified"
    verdict += " SLOWER" if gain < 0.0 else ""
    verdict += " OUTSIDE" if share > 1.0 + 2e-4 else ""
    return (
        str(ranges),
        f"{plain.t_end:.4f} s",
        f"{ranged.t_end:.4f} s{verdict}",
        f"{gain:.1f} %",
        f"{share:.5f}",
        ", ".join(times),
    )


def main() -> None:
    """Print a row for every task."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore", BrachisWarning)
    rows: list[tuple[str, ...]] = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(100):
            for robot in ROBOTS:
                made = mixed_cases.case(robot, given.seed, number, Path(folder))
                task = load_task(made.task, changes=SETTINGS)
                is_open = task.end == "free" and not task.boundary.periodic
                if task.task_space != "pose" or not is_open:
                    continue
                row = made.name, *plan_both(task, len(rows))
                rows.append(row)
                print(" | ".join(row), flush=True)
                if len(rows) == given.count:
                    columns = (
                        "task",
                        "ranges",
                        "without",
                        "with",
                        "gain",
                        "share",
                        "time",
                    )
                    note = "share: largest part of a range that is used."
                    save("Random tolerances", columns, rows, note)
                    return


if __name__ == "__main__":
    main()
