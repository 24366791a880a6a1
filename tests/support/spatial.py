"""An arm with a spherical wrist on a rail, with the geometry of the TX90L and masses of no robot in particular."""

from __future__ import annotations

from typing import Any

from brachis.robot import Robot
from support.arms import TX90L_STEPS
from support.chains import INERTIAL, Joint, Vector, chain_urdf

Y: Vector = (0.0, 1.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)
START = (0.0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1)


def rail_arm_joints(rail: Vector = Y) -> list[Joint]:
    """Rail j1 and arm joints j2 to j7."""
    slide = {"lower": -2.0, "upper": 2.0, "velocity": 2.0, "effort": 1500.0}
    turn = {"lower": -4.0, "upper": 4.0, "velocity": 7.0, "effort": 300.0}
    masses = (8.0, 6.0, 4.0, 2.0, 1.0, 0.5)
    axes = (Z, Y, Y, Z, Y, Z)
    arm = [
        Joint(
            "revolute",
            axis=axis,
            xyz=xyz,
            limit=turn,
            inertial=INERTIAL.format(mass=mass),
        )
        for axis, xyz, mass in zip(axes, TX90L_STEPS, masses, strict=True)
    ]
    return [Joint("prismatic", axis=rail, limit=slide), *arm]


def rail_arm(
    rail: Vector = Y, *, tool: Vector = (0.05, -0.02, 0.12), **options: Any
) -> Robot:
    """Robot of `rail_arm_joints`; options are those of `Robot.from_urdf`."""
    return Robot.from_urdf(
        "rail arm", urdf_text=chain_urdf(rail_arm_joints(rail), tool=tool), **options
    )
