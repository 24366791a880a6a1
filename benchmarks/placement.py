"""Gradients of the end time by the pose of a workpiece, beside planning again with the workpiece moved.

Usage: python benchmarks/placement.py [--seed 0] [--count 20] [--step 0.003] [--intervals 30] [--save]

Random lines in a random frame, on three of the included robots. Every task is planned; `result.sensitivities.gradients`
has the derivatives by x, y and z of the frame. Then the frame is moved by the step to both sides along each axis, and
the task is planned again from the first motion, so that the same local optimum is found. The knots are given:
with ``intervals: auto`` two plans of a task may differ by the spline tolerance, as much as such a step gains.
The deviation is the length of the difference of both gradients, relative to that of the second one.
"""

from __future__ import annotations

import argparse
import warnings
from typing import Any

import numpy as np

import brachis
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
        for entry in result.sensitivities.gradients
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


def main() -> None:
    """Plan, move, plan again, compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--step", type=float, default=0.003)
    parser.add_argument("--intervals", type=int, default=30)
    parser.add_argument("--save", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore", BrachisWarning)
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
