"""The planar arm of the paper, and tasks of its tool: 10 Nm a joint, no velocity limits, no gravity."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import brachis
from brachis.problem.problem import Problem

SCARA = Path(__file__).parents[2] / "robots/scara3/robot.urdf"
START = [math.pi / 6, -2.0 * math.pi / 3.0, 2.0 * math.pi / 3.0]
"""The tool is at (sqrt(3), 0) m."""
RANGES = {"position": {"j1": [-0.5, 1.5], "j2": [-3.0, 0.0], "j3": [0.0, 3.5]}}
"""Limits within which the arm keeps its elbow as it is in the start posture."""


def scara(limits: dict[str, Any] | None = None, **options: Any) -> brachis.Robot:
    """Return the arm; options are those of `Robot.from_urdf`."""
    spec = brachis.LimitSpec(**({"torque": 10.0, "velocity": None} | (limits or {})))
    return brachis.Robot.from_urdf(
        SCARA, **({"gravity": [0, 0, 0], "limits": spec} | options)
    )


def problem(robot: brachis.Robot, rows: Any = ("x", "y"), **task: Any) -> Problem:
    """Return the problem of a robot and the keys of a task."""
    rows = rows if isinstance(rows, str) else list(rows)
    content = {"brachis": 1, "task_space": rows} | task
    return Problem.of(robot, brachis.load_task(content))
