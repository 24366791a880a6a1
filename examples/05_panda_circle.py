"""The Panda, from the package example-robot-data, draws a circle without turning its hand.

Needs the URDFs: pip install ".[robots]" in a clone of brachis.
"""

from __future__ import annotations

import sys
from pathlib import Path

import brachis

URDF = "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
START = (0.3, -0.5, 0.2, -2.2, 0.3, 1.9, 0.8)  # rad
RADIUS = 0.1  # m
JOINTS = ("panda_joint4", "panda_joint5", "panda_joint6", "panda_joint7")


def panda() -> brachis.Robot:
    """Find the URDF, which the package installs next to the Python packages, and return the robot."""
    for folder in map(Path, sys.path):
        if (folder / URDF).is_file():
            return brachis.Robot.from_urdf(folder / URDF, tool_frame="panda_hand_tcp")
    raise SystemExit(
        "the URDFs are not installed: pip install '.[robots]' in a clone of brachis"
    )


def main() -> dict[str, brachis.Result]:
    """Plan the circle with every redundant joint that has a closed form, and print the results."""
    robot = panda()
    x, y, z = robot.tool_placement(robot.posture(START, "START")).translation
    results = {}
    for joint in JOINTS:
        task = {
            "brachis": 1,
            "start": {"joints": START},
            "task_space": "pose",
            "path": [{"circle": {"center": [x - RADIUS, y, z], "normal": [0, 0, 1]}}],
            "redundant_joints": [joint],
            "spline": {"intervals": 20},
        }
        result = results[joint] = brachis.plan(robot, task)
        print(
            f"{joint}: {result.t_end:.3f} s, verified: {result.verified}, branch {result.trajectory.branch}"
        )
    return results


if __name__ == "__main__":
    main()
