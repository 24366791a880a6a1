"""URDF texts of serial chains, written without brachis, and the robots that brachis makes of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from brachis.optimise.program import Program
from brachis.planner import transcribe
from brachis.robot import Robot
from brachis.task import load_task

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)

PLANES: dict[str, Vector] = {
    "xy": ZERO,
    "xz": (np.pi / 2, 0.0, 0.0),
    "tilted": (0.5, -0.35, 0.7),
}
"""Roll, pitch and yaw by which the xy-plane becomes each plane."""

KINDS = {"R": "revolute", "C": "continuous", "P": "prismatic"}
LIMIT_KEYS = ("lower", "upper", "velocity", "effort")
INERTIAL = """
    <inertial>
      <origin xyz="0.21 0.02 0.01" rpy="0.1 0.2 0.3"/>
      <mass value="{mass}"/>
      <inertia ixx="0.011" ixy="0.002" ixz="-0.001" iyy="0.05" iyz="0.003" izz="0.055"/>
    </inertial>"""


@dataclass(frozen=True)
class Joint:
    """One joint: ``revolute``, ``continuous``, ``prismatic`` or any other type that a URDF knows."""

    kind: str
    axis: Vector = (0.0, 0.0, 1.0)
    xyz: Vector = ZERO
    rpy: Vector = ZERO
    limit: Mapping[str, float] | None = field(
        default_factory=lambda: {
            "lower": -3.1,
            "upper": 3.1,
            "velocity": 3.0,
            "effort": 60.0,
        }
    )
    extra: str = ""
    inertial: str = INERTIAL.format(mass=2.0)


def chain_urdf(
    joints: Sequence[Joint],
    *,
    tool: Vector = ZERO,
    mount: Joint | None = None,
    elements: str = "",
) -> str:
    """Joints j1, j2, ... that move link1, link2, ..., from the link ``base`` to the link ``tool``.

    ``base`` hangs fixed below ``world`` as `mount` says; `elements` is put in before the end of the URDF.
    """
    parts = ["<robot name='chain'>"]
    parts += [f"<link name='{name}'/>" for name in ("world", "base", "tool")]
    parts.append(_joint("mount", mount or Joint("fixed", limit=None), "world", "base"))
    for i, joint in enumerate(joints, start=1):
        parts.append(f"<link name='link{i}'>{joint.inertial}</link>")
        parent = f"link{i - 1}" if i > 1 else "base"
        parts.append(_joint(f"j{i}", joint, parent, f"link{i}"))
    tool_joint = Joint("fixed", xyz=tool, limit=None)
    parts.append(_joint("tool_mount", tool_joint, f"link{len(joints)}", "tool"))
    return "\n".join([*parts, elements, "</robot>"])


def _joint(name: str, joint: Joint, parent: str, child: str) -> str:
    text = f"<joint name='{name}' type='{joint.kind}'><parent link='{parent}'/><child link='{child}'/>"
    text += f"<origin xyz='{_numbers(joint.xyz)}' rpy='{_numbers(joint.rpy)}'/>"
    if joint.kind != "fixed":
        text += f"<axis xyz='{_numbers(joint.axis)}'/>"
    if joint.limit is not None:
        figures = " ".join(f"{key}='{value!r}'" for key, value in joint.limit.items())
        text += f"<limit {figures}/>"
    return f"{text}{joint.extra}</joint>"


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def planar_urdf(pattern: str, plane: str = "xy") -> str:
    """Text of a chain whose joints move in one plane: R revolute, C continuous, P prismatic in the plane.

    Lengths, offsets, senses and slide directions are all different, so that nothing cancels by chance.
    """
    joints = []
    for i, letter in enumerate(pattern):
        common: dict[str, Any] = {
            "xyz": (0.45 - 0.06 * i if i else 0.0, 0.05 * (-1) ** i, 0.02 * i),
            "rpy": (0.0, 0.0, 0.15 * i),
            "inertial": INERTIAL.format(mass=3.0 - 0.4 * i),
        }
        angle = 0.4 + 0.9 * i
        if letter == "P":
            axis = (np.cos(angle), np.sin(angle), 0.0)
            figures = (-1.1, 1.3, 1.5 + 0.1 * i, 150.0 - 10.0 * i)
        else:
            axis = (0.0, 0.0, -1.0 if i == 1 else 1.0)
            figures = (-3.0, 2.9, 3.0 + 0.1 * i, 80.0 - 10.0 * i)
        limit = dict(zip(LIMIT_KEYS, figures, strict=True))
        joints.append(Joint(KINDS[letter], axis, limit=limit, **common))
    mount = Joint("fixed", xyz=(0.1, -0.2, 0.3), rpy=PLANES[plane], limit=None)
    return chain_urdf(joints, tool=(0.33, 0.04, 0.01), mount=mount)


def planar_robot(pattern: str, plane: str = "xy", **options: Any) -> Robot:
    """Robot of `planar_urdf`; options are those of `Robot.from_urdf`."""
    return Robot.from_urdf(
        f"{pattern} {plane}", urdf_text=planar_urdf(pattern, plane), **options
    )


def gantry_robot(axes: Sequence[Vector], **options: Any) -> Robot:
    """Prismatic joints along `axes`, which need not be perpendicular."""
    limit = {"lower": -5.0, "upper": 5.0, "velocity": 100.0, "effort": 50.0}
    joints = [Joint("prismatic", axis, limit=limit) for axis in axes]
    text = chain_urdf(joints, tool=(0.1, 0.2, 0.3))
    return Robot.from_urdf("gantry", urdf_text=text, **options)


def program_of(
    robot: Robot,
    rows: Sequence[str],
    path: Sequence[Mapping[str, Any]],
    start: Sequence[float],
    redundant: Sequence[str],
    *,
    end: Sequence[float] | None = None,
    tool_limits: Mapping[str, Any] | None = None,
    **spline: Any,
) -> Program:
    """Program of a task for a given robot; `spline` is the task's ``spline`` part."""
    task = load_task(
        {
            "brachis": 1,
            "start": {"joints": list(start)},
            "end": "free" if end is None else {"joints": list(end)},
            "task_space": list(rows),
            "path": list(path),
            "redundant_joints": list(redundant),
            "spline": spline,
            "tool_limits": dict(tool_limits or {}),
        }
    )
    return transcribe(robot, task)[0]
