"""Robots of the mixed tasks, and the task spaces that they are given; see `mixed_cases`."""

from __future__ import annotations

from pathlib import Path

import random_poses

ROOT = Path(__file__).parents[1]
SPATIAL = ("pose", "pose_free_roll", "position", "position, a joint locked")
ROBOTS = {
    "scara3": (("x", "y"),),
    "planar4": (("x", "y"), ("x", "y", "yaw")),
    **dict.fromkeys(("panda", "iiwa14", "xarm7", "tx90l_rail", "ur10_rail"), SPATIAL),
}
"""Robots, and the task spaces that go round with the shapes of the path."""
STORED = {"panda": random_poses.PANDA, "xarm7": "xarm_description/urdf/xarm7.urdf"}
"""Those of the package example-robot-data."""
TOOLS = {"panda": "panda_hand_tcp"}
"""Tool frames of those that have several leaf links."""


def urdf_of(robot: str, folder: Path) -> Path:
    """URDF of a robot; that of planar4 is written into the folder."""
    if robot == "planar4":
        path = folder / "planar4.urdf"
        path.write_text(planar_chain((0.9, 0.8, 0.6, 0.4)), encoding="utf-8")
        return path.absolute()
    return (
        random_poses.stored_urdf(STORED[robot])
        if robot in STORED
        else ROOT / f"robots/{robot}/robot.urdf"
    )


def planar_chain(lengths: tuple[float, ...]) -> str:
    """URDF of a chain in the plane x, y: slender rods of 10 kg/m, drives of 10 Nm and 100 rad/s."""
    parts = ['<robot name="planar"><link name="link0"/>']
    for i, length in enumerate(lengths, 1):
        inertia = 10.0 * length**3 / 12.0
        parts.append(
            f'<link name="link{i}"><inertial><origin xyz="{0.5 * length} 0 0"/><mass value="{10.0 * length}"/>'
            f'<inertia ixx="0" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial>'
            f'<collision><origin xyz="{0.5 * length} 0 {0.1 * i:g}"/>'
            f'<geometry><box size="{length} 0.06 0.05"/></geometry></collision></link>'
            f'<joint name="j{i}" type="continuous"><parent link="link{i - 1}"/><child link="link{i}"/>'
            f'<origin xyz="{lengths[i - 2] if i > 1 else 0.0} 0 0"/><axis xyz="0 0 1"/>'
            '<limit effort="10" velocity="100"/></joint>'
        )
    parts.append(
        f'<link name="tool"/><joint name="mount" type="fixed"><parent link="link{len(lengths)}"/><child link="tool"/>'
        f'<origin xyz="{lengths[-1]} 0 0"/></joint></robot>'
    )
    return "\n".join(parts)
