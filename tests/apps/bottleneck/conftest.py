"""Slides pushed by limited forces, and the paper's lines."""

import math
from pathlib import Path

import pytest

import brachis
from support.chains import INERTIAL, Joint, chain_urdf
from support.effort import QUICK

ROOT = Path(__file__).parents[3]
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
MASS, FORCE, LENGTH = 2.0, 50.0, 1.2


@pytest.fixture(scope="session")
def slide():
    """Plan a straight motion of two slides, the lower of which carries both masses."""

    def plan(
        axes=(X, Y),
        rows=("x", "y"),
        by=(LENGTH, 0.0),
        *,
        intervals=20,
        rest="velocity",
        degree=3,
        **extra,
    ):
        limit = {"lower": -5.0, "upper": 5.0, "velocity": 100.0, "effort": FORCE}
        joints = [
            Joint(
                "prismatic", axis=axis, limit=limit, inertial=INERTIAL.format(mass=MASS)
            )
            for axis in axes
        ]
        task = {
            "brachis": 1,
            "robot": {"gravity": [0, 0, 0], **extra.pop("robot", {})},
            "start": {"joints": [0.0] * len(axes)},
            "task_space": list(rows),
            "path": [{"line": {"by": list(by)}}],
            "redundant_joints": extra.pop("redundant", []),
            "spline": {"degree": degree, "intervals": intervals, "rest": rest},
            "solver": {"name": extra.pop("solver", "auto")},
            "search": QUICK,
        }
        settings = task["robot"]
        limits = brachis.LimitSpec(**settings.get("limits", {}))
        text = chain_urdf(joints, tool=(0.1, 0.2, 0.3))
        robot = brachis.Robot.from_urdf(
            "slides", urdf_text=text, gravity=settings["gravity"], limits=limits
        )
        return brachis.plan(robot, task)

    return plan


@pytest.fixture(scope="session")
def scara():
    """Plan the paper's line at 90 degrees with one joint redundant; every plan is made once."""
    limits = brachis.LimitSpec(torque=10.0, velocity=None)
    robot = brachis.Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf", gravity=[0, 0, 0], limits=limits
    )
    made = {}

    def plan(joint, solver="auto"):
        if (joint, solver) not in made:
            task = {
                "brachis": 1,
                "start": {"joints": [math.pi / 6, -2 * math.pi / 3, 2 * math.pi / 3]},
                "task_space": ["x", "y"],
                "path": [{"line": {"length": 1.0, "angle_deg": 90}}],
                "redundant_joints": [joint],
                "spline": {"degree": 3, "intervals": 20, "rest": "full"},
                "solver": {"name": solver},
                "search": QUICK,
            }
            made[joint, solver] = brachis.plan(robot, task)
        return made[joint, solver]

    return plan
