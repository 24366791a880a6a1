"""Gradients of the end time by the pose of a workpiece, beside planning again with the workpiece moved.

Usage: python benchmarks/placement.py [--seed 0] [--count 20] [--step 0.003] [--intervals 30] [--cycle] [--save]

Random lines in a random frame, on three of the included robots. Every task is planned; `result.gradients`
has the derivatives by x, y and z of the frame. Then the frame is moved by the step to both sides along each axis, and
the task is planned again from the first motion, so that the same local optimum is found. The knots are given:
with ``intervals: auto`` two plans of a task may differ by the spline tolerance, as much as such a step gains.
The deviation is the length of the difference of both gradients, relative to that of the second one.

With --cycle, the fixture of a cycle of two seams is moved to a faster place instead: a TX90L, whose rail stands still,
begins and ends at home.
"""

from __future__ import annotations

import argparse
import warnings
from typing import Any

import numpy as np

import brachis
from brachis.apps.place.placing import write_change
from brachis.errors import BrachisError, BrachisWarning
from committed import save

ROBOTS = {"iiwa14": "pose", "tx90l_rail": "pose", "scara3": ["x", "y"]}
REQUIRED = 0.05
FRAME = "workpiece"
SMALL_CHANGE = 0.005
"""Largest fraction of the end time that a step may change."""


def task_of(seed: int) -> dict[str, Any]:
    """Draw a line in a frame at a random posture."""
    rng = np.random.default_rng([61, seed])
    name = list(ROBOTS)[seed % len(ROBOTS)]
    robot = getattr(brachis.robots, name)
    ends = robot.limits.both_ways("position")
    low, high = np.where(np.isfinite(ends), ends, [[-2.0], [2.0]])
    place = robot.tool_placement(low + rng.uniform(0.3, 0.7, robot.n) * (high - low))
    direction = rng.normal(size=3)
    length = rng.uniform(0.2, 0.6)
    task: dict[str, Any] = {
        "brachis": 1,
        "robot": {"urdf": name},
        "start": "free",
        "task_space": ROBOTS[name],
        "search": {"least_motion": False, "time_limit": 600.0},
        "refinement": {"tolerance": 1e-5},
        "solver": {"tolerance": 1e-8},
    }
    if name == "scara3":
        direction = direction[:2]
        task["path_start"] = [0.0, 0.0]
        task["frames"] = {
            FRAME: {
                "xyz": [*place.translation[:2].tolist(), 0.0],
                "rpy_deg": [0.0, 0.0, rng.uniform(-180.0, 180.0)],
            }
        }
    else:
        task["path_start"] = {"position": [0.0, 0.0, 0.0], "rpy_deg": [0.0, 0.0, 0.0]}
        task["frames"] = {
            FRAME: brachis.task.Placement.model_validate(place).model_dump()
        }
    by = length * direction / np.linalg.norm(direction)
    task["path"] = {"frame": FRAME, "segments": [{"line": {"by": by.tolist()}}]}
    return task


def moved(task: dict[str, Any], axis: int, distance: float) -> dict[str, Any]:
    """Return the task with its frame moved along an axis of the world, m."""
    frame = dict(task["frames"][FRAME])
    xyz = list(frame["xyz"])
    xyz[axis] += distance
    return {**task, "frames": {FRAME: {**frame, "xyz": xyz}}}


def gradient_of(result: brachis.Result) -> np.ndarray:
    """Return the derivatives by x, y and z of the frame, (3,), s/m."""
    found = {
        entry.figure: entry.derivative
        for entry in result.gradients
        if entry.subject == FRAME
    }
    return np.array([found[axis] for axis in "xyz"], dtype=float)


def planned_again(
    task: dict[str, Any], result: brachis.Result, step: float
) -> np.ndarray:
    """Return the same derivatives, (3,), from plans of the moved task."""
    derivatives = []
    for axis in range(3):
        times = [
            brachis.plan(moved(task, axis, side * step), start_from=result).t_end
            for side in (1.0, -1.0)
        ]
        derivatives.append((times[0] - times[1]) / (2.0 * step))
    return np.array(derivatives)


def seam(name: str, first: list[float], last: list[float]) -> dict[str, Any]:
    """Return a part of the cycle, with the tool pointing down."""
    return {
        "name": name,
        "path": {"frame": FRAME, "segments": [{"line": {"to": last}}]},
        "path_start": {"position": first, "rpy_deg": [180.0, 0.0, 0.0]},
    }


CYCLE: dict[str, Any] = {
    "brachis": 1,
    "robot": {"urdf": "tx90l_rail", "locked_joints": {"rail": 0.0}},
    "postures": {"home": [0.0, 0.3, 1.6, 0.0, 1.2, 0.0]},
    "start": "home",
    "end": "start",
    "task_space": "pose_free_roll",
    "frames": {FRAME: {"xyz": [0.75, 0.25, 0.1]}},
    "search": {"time_limit": 300.0},
    "program": [
        {"move": "next"},
        {"approach": 0.08},
        seam("seam 1", [0.1, -0.25, 0.0], [0.1, 0.25, 0.0]),
        {"retract": 0.08},
        {"move": "next"},
        {"approach": 0.08},
        seam("seam 2", [-0.1, 0.25, 0.1], [-0.1, -0.25, 0.1]),
        {"retract": 0.08},
        {"move": "home"},
    ],
}
"""A cycle with a fixture that stands low and aside."""


def move_fixture() -> None:
    """Move the fixture of the cycle to a faster place."""
    ranges = {"x": (-0.25, 0.15), "y": (-0.5, 0.1), "z": (-0.1, 0.3)}
    placing = brachis.place(CYCLE, ranges=ranges, starts=3, steps=4, listener=print)
    row = (
        "TX90L, two seams",
        f"{placing.before.t_end:.4f} s",
        f"{placing.after.t_end:.4f} s",
        f"{100.0 * placing.gain:.1f} %",
        write_change(placing.change),
        str(len(placing.trials)),
    )
    print(" | ".join(row))
    columns = ("cycle", "before", "after", "gain", "moved by", "places tried")
    about = f"A fixture moved by `brachis.place`: {row[3]} faster."
    save("A faster place", columns, [row], about, name="placement_cycle")


def main() -> None:
    """Plan, move, plan again, compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--step", type=float, default=0.003)
    parser.add_argument("--intervals", type=int, default=30)
    parser.add_argument("--cycle", action="store_true")
    parser.add_argument("--save", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore", BrachisWarning)
    if options.cycle:
        move_fixture()
        return
    rows: list[tuple[str, ...]] = []
    within = 0
    seed = options.seed
    while len(rows) < options.count:
        task = task_of(seed)
        task["spline"] = {"intervals": options.intervals}
        seed += 1
        try:
            result = brachis.plan(task, check_advice=False)
        except BrachisError:
            continue  # the draw has no plan
        predicted = gradient_of(result)
        # Near the end of its reach an arm is much slower a few millimetres farther on.
        limit = SMALL_CHANGE * result.t_end / float(np.linalg.norm(predicted))
        step = min(options.step, limit)
        try:
            found = planned_again(task, result, step)
        except BrachisError:
            continue  # a step farther, the line is out of reach
        off = float(np.linalg.norm(predicted - found) / np.linalg.norm(found))
        within += off <= REQUIRED
        rows.append(
            (
                f"{task['robot']['urdf']}, seed {seed - 1}",
                f"{result.t_end:.4f} s",
                ", ".join(f"{value:.4f}" for value in predicted),
                ", ".join(f"{value:.4f}" for value in found),
                f"{100.0 * off:.2f} %",
            )
        )
        print(" | ".join(rows[-1]), flush=True)
    about = (
        f"{within} of {len(rows)} within {100.0 * REQUIRED:g} %. Derivatives of the end time by x, y and z of the "
        f"workpiece, s/m; planned again at up to +-{1e3 * options.step:g} mm, {options.intervals} knot intervals."
    )
    print(about)
    columns = ("case", "t_E", "from the multipliers", "planned again", "off by")
    save("Gradients by the pose of a workpiece", columns, rows, about)


if __name__ == "__main__":
    main()
