"""Numbers that messages advise: following them gives a verified plan, and 5 % beyond them there is none.

Usage: python benchmarks/advice.py [--seed 20] [--cases 20]

Tasks that ask for too much are drawn at random: process speeds, speeds at the ends, payloads, torque limits and
root-mean-square torque limits. Each is planned, the number that the error advises is put into the task, and the task is
planned again; then once more with a number that is 5 % less of a change.
"""

from __future__ import annotations

import argparse
import re
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import brachis
from brachis.task import with_keys

ROBOTS = Path(__file__).resolve().parents[1] / "robots"
BEYOND = 1.05
ADVICE = re.compile(
    r"(?i)(lower|raise) (\S+) to ([\d.e+-]+)[^(]*\(a plan with it was verified(; there was none)?"
)

Draw = Callable[[float, float], float]


def gantry(limits: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Slide 0.5 m along x."""
    robot = {
        "urdf": str(ROBOTS / "gantry2/robot.urdf"),
        "gravity": [0, 0, 0],
        "limits": limits,
    }
    path = [{"line": {"by": [0.5, 0.0]}}]
    return {
        "robot": robot,
        "start": {"joints": [0.0, 0.0]},
        "task_space": ["x", "y"],
        "path": path,
        **more,
    }


def scara(**more: Any) -> dict[str, Any]:
    """Draw the line of the first example."""
    robot = {
        "urdf": str(ROBOTS / "scara3/robot.urdf"),
        "tool_frame": "tool",
        "gravity": [0, 0, 0],
        "limits": {"torque": 10.0, "velocity": None},
    }
    start, path = (
        {"joints": [0.5236, -2.0944, 2.0944]},
        [{"line": {"length": 1.0, "angle_deg": 90}}],
    )
    return {
        "robot": robot,
        "start": start,
        "task_space": ["x", "y"],
        "path": path,
        **more,
    }


def rail(limits: dict[str, Any], payload: float = 0.0, **more: Any) -> dict[str, Any]:
    """Lead the UR10 on its rail half a metre along it."""
    robot: dict[str, Any] = {
        "urdf": str(ROBOTS / "ur10_rail/robot.urdf"),
        "limits": limits,
    }
    if payload:
        robot["payload"] = {"mass": payload, "com": [0, 0, 0.1]}
    start, path = (
        {"joints": [0, 0.4, -1.3, 1.9, -2.1, -1.4, 0.3]},
        [{"line": {"by": [0.1, 0.5, 0]}}],
    )
    return {"robot": robot, "start": start, "task_space": "pose", "path": path, **more}


def joints(limits: dict[str, Any], payload: float = 0.0, **more: Any) -> dict[str, Any]:
    """Lead the iiwa along a path of joints."""
    robot: dict[str, Any] = {
        "urdf": str(ROBOTS / "iiwa14/robot.urdf"),
        "limits": limits,
    }
    if payload:
        robot["payload"] = {"mass": payload, "com": [0, 0, 0.1]}
    through = [
        [0.6, 0.5, -0.3, -0.9, 0.4, 0.6, 0.5],
        [1.0, 0.2, 0.2, -1.5, -0.2, 1.0, -0.4],
    ]
    start, path = (
        {"joints": [0.0, 0.3, 0.0, -1.2, 0.0, 0.8, 0.0]},
        [{"spline": {"through": through}}],
    )
    return {
        "robot": robot,
        "start": start,
        "task_space": "joints",
        "path": path,
        **more,
    }


def process(speed: float, *part: float) -> dict[str, Any]:
    """Ask for a process speed on a part of the path."""
    return {"process_speed": [{"speed": round(speed, 3), "s": list(part)}]}


SLOW = {"acceleration": 1.0, "velocity": None}
KINDS: dict[str, Callable[[Draw], dict[str, Any]]] = {
    "process speed, velocity": lambda u: gantry(
        {"velocity": u(0.2, 0.4)}, tool_limits=process(u(0.5, 0.9), 0.3, 0.6)
    ),
    "process speed, run-up": lambda u: gantry(
        SLOW, tool_limits=process(u(0.4, 0.7), u(0.05, 0.12), 0.5)
    ),
    "process speed, run-down": lambda u: gantry(
        SLOW, tool_limits=process(u(0.4, 0.7), 0.5, u(0.88, 0.95))
    ),
    "process speed, jerk": lambda u: gantry(
        {**SLOW, "jerk": u(2, 4)}, tool_limits=process(u(0.45, 0.6), 0.2, 0.6)
    ),
    "process speed, arm": lambda u: scara(tool_limits=process(u(1.0, 2.5), 0.2, 0.8)),
    "process speed, rail": lambda u: rail(
        {"scale": {"velocity": u(0.2, 0.4)}}, tool_limits=process(u(1.2, 1.6), 0.2, 0.8)
    ),
    "end speed, velocity": lambda u: gantry(
        {"velocity": u(0.2, 0.4)}, boundary={"end_speed": u(0.5, 0.8)}
    ),
    "end speed, way": lambda u: gantry(
        {**SLOW, "acceleration": u(0.5, 1.0)}, boundary={"end_speed": u(1.1, 1.6)}
    ),
    "start speed, jerk": lambda u: gantry(
        {**SLOW, "jerk": u(1, 2)}, boundary={"start_speed": u(0.85, 0.95)}
    ),
    "start speed, power": lambda u: gantry(
        {"velocity": None, "power": 20.0}, boundary={"start_speed": u(1.2, 1.6)}
    ),
    "payload, rail": lambda u: rail({}, payload=u(25, 60)),
    "payload, joints": lambda u: joints({}, payload=u(30, 60)),
    "torque, rail": lambda u: rail({"torque": {"shoulder_lift_joint": u(30, 50)}}),
    "torque, joints": lambda u: joints({"torque": {"joint_2": u(20, 38)}}),
    "mean torque, joints": lambda u: joints({"rms_torque": {"joint_2": u(5, 25)}}),
    "mean torque, rail": lambda u: rail(
        {"rms_torque": {"shoulder_lift_joint": u(25, 50)}}
    ),
}


def plan(
    task: dict[str, Any], changes: dict[str, float] | None = None
) -> brachis.Result | brachis.BrachisError:
    """Plan a task with some numbers changed; return the error where there is no plan."""
    whole = {
        "brachis": 1,
        "spline": {"intervals": 20},
        "search": {"effort": "single", "least_motion": False},
        **task,
    }
    try:
        return brachis.plan(with_keys(whole, changes or {}))
    except brachis.BrachisError as error:
        return error


def is_verified(outcome: brachis.Result | brachis.BrachisError) -> bool:
    """Tell whether there is a plan that passed the verification."""
    return isinstance(outcome, brachis.Result) and outcome.verified


def main() -> None:
    """Print a line for each case, and how many numbers were right."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--cases", type=int, default=20)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    rng = np.random.default_rng(arguments.seed)
    names = list(KINDS)
    advised = followed = claimed = kept = 0
    for number in range(arguments.cases):
        name = names[number % len(names)]
        task = KINDS[name](lambda low, high: round(float(rng.uniform(low, high)), 3))
        began = time.process_time()
        outcome = plan(task)
        busy = time.process_time() - began
        found = (
            []
            if is_verified(outcome)
            else ADVICE.findall(str(getattr(outcome, "hint", "")))
        )
        if not found:
            print(f"{name:26} no number: {outcome}")
            continue
        for verb, key, value, is_largest in found:
            advised += 1
            works = is_verified(plan(task, {key: float(value)}))
            followed += works
            beyond = ""
            if is_largest:
                claimed += 1
                further = float(value) * (
                    BEYOND if verb.lower() == "lower" else 1.0 / BEYOND
                )
                fails = not is_verified(plan(task, {key: further}))
                kept += fails
                beyond = f"; {further:.4g}: {'no plan' if fails else 'A PLAN'}"
            works_too = "a plan" if works else "NO PLAN"
            print(
                f"{name:26} {verb.lower()} {key} to {value}: {works_too}{beyond} ({busy:.1f} s)",
                flush=True,
            )
    print(
        f"{followed} of {advised} numbers lead to a plan; 5 % beyond, {kept} of {claimed} lead to none"
    )


if __name__ == "__main__":
    main()
