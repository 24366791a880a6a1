"""Slides pushed by limited forces, whose shortest times are known by hand, and their plans along a line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import brachis
from support.chains import INERTIAL, Joint, Vector, chain_urdf

X: Vector = (1.0, 0.0, 0.0)
Y: Vector = (0.0, 1.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)


def slides(
    axes: Sequence[Vector],
    forces: Sequence[float],
    mass: float = 2.0,
    extra: str = "",
    **options: Any,
) -> brachis.Robot:
    """Slides j1, j2, ... that carry each other, with a mass and a largest force each; options of `Robot.from_urdf`."""
    joints = []
    for axis, force in zip(axes, forces, strict=True):
        limit = {"lower": -5.0, "upper": 5.0, "velocity": 100.0, "effort": force}
        inertial = INERTIAL.format(mass=mass)
        joints.append(
            Joint("prismatic", axis, limit=limit, extra=extra, inertial=inertial)
        )
    text = chain_urdf(joints, tool=(0.1, 0.2, 0.3))
    return brachis.Robot.from_urdf(
        "slides", urdf_text=text, tool_frame="tool", **options
    )


def plan_slides(
    robot: brachis.Robot,
    rows: Sequence[str],
    by: Sequence[float],
    *,
    settings: Mapping[str, Any] | None = None,
    spline: Mapping[str, Any] | None = None,
    **task: Any,
) -> brachis.Result:
    """Plan from rest to rest; without gravity, unless the settings of the robot say so."""
    content = {
        "brachis": 1,
        "robot": {"gravity": [0, 0, 0], "tool_frame": "tool", **(settings or {})},
        "start": {"joints": [0.0] * robot.n},
        "task_space": list(rows),
        "path": [{"line": {"by": list(by)}}],
        "spline": {"rest": "velocity", **(spline or {})},
        **task,
    }
    return brachis.plan(robot, content)
