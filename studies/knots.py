"""What knots are worth: end times with even, free and refined ones, for the paper's arm at 90 degrees."""

from __future__ import annotations

import math
import os
import sys
from pathlib import Path
from typing import Any

from brachis import LimitSpec, Robot, plan

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "benchmarks"))

from committed import save  # noqa: E402

JOINTS = ("j1", "j2", "j3")
SPLINES: dict[str, dict[str, Any]] = {
    **{f"{n} even intervals": {"intervals": n} for n in (8, 12, 16, 50, 100, 200)},
    **{f"{n} free intervals": {"intervals": n, "knots": "free"} for n in (8, 12, 16)},
    "auto": {"intervals": "auto"},
    "auto, rest: velocity": {"intervals": "auto", "rest": "velocity"},
    "100 even intervals, rest: velocity": {"intervals": 100, "rest": "velocity"},
}


def cell(robot: Robot, joint: str, spline: dict[str, Any]) -> str:
    """End time, number of intervals and processor time of a plan."""
    task = {
        "brachis": 1,
        "start": {"joints": [math.pi / 6, -2 * math.pi / 3, 2 * math.pi / 3]},
        "task_space": ["x", "y"],
        "path": [{"line": {"length": 1.0, "angle_deg": 90}}],
        "redundant_joints": [joint],
        "spline": spline,
        "search": {"time_limit": 600.0},  # no busy machine ends a mesh early
    }
    began = sum(os.times()[:4])
    result = plan(robot, task)
    elapsed = (
        sum(os.times()[:4]) - began
    )  # of other processes too: large programs are solved in one
    intervals = len(set(result.trajectory.knots.tolist())) - 1
    note = "" if result.verified else ", not verified"
    return f"{result.t_end:.4f} s ({intervals}; {elapsed:.1f} s{note})"


def main() -> None:
    """Print one line for every kind of knots: end time (intervals; processor time) for every redundant joint."""
    limits = LimitSpec(torque=10.0, velocity=None)
    robot = Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf", gravity=[0, 0, 0], limits=limits
    )
    print(f"| knots | {' | '.join(JOINTS)} |\n|---|{'---|' * len(JOINTS)}")
    rows = []
    for name, spline in SPLINES.items():
        rows.append((name, *(cell(robot, joint, spline) for joint in JOINTS)))
        print(f"| {' | '.join(rows[-1])} |", flush=True)
    about = "The paper's line at 90 degrees. In brackets: knot intervals at the end, and processor time of the plan."
    save(
        "What knots are worth",
        ("knots", *(f"q_r = {joint}" for joint in JOINTS)),
        rows,
        about,
    )


if __name__ == "__main__":
    main()
