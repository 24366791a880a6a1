"""Arms for poses whose axes are parallel or meet in all the places that closed forms are made for."""

from __future__ import annotations

import numpy as np

from brachis.robot import Robot, bind
from support.chains import Joint, chain_urdf
from support.published import published

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
BACK, DOWN = (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)
SLIDE = {"lower": -1.0, "upper": 1.0, "velocity": 1.0, "effort": 50.0}

IIWA = [(Z, (0.0, 0.0, height)) for height in (0.0, 0.36, 0.36, 0.78, 0.78, 1.18, 1.18)]
IIWA = [
    (axis, point)
    for axis, (_, point) in zip((Z, Y, Z, BACK, Z, Y, Z), IIWA, strict=True)
]
IIWA_TOOL = (0.0, 0.0, 1.306)


def chain(joints, tool):
    """Robot whose joints have these axes and positions at the zero posture; a slide says so in a third entry."""
    parts, before = [], np.zeros(3)
    for axis, position, *slide in joints:
        step = tuple((np.array(position) - before).tolist())
        parts.append(
            Joint("prismatic", axis=axis, xyz=step, limit=SLIDE)
            if slide
            else Joint("revolute", axis, step)
        )
        before = np.array(position)
    return Robot.from_urdf(
        "chain",
        urdf_text=chain_urdf(parts, tool=tuple((np.array(tool) - before).tolist())),
    )


def iiwa():
    """Lengths of the LBR iiwa 14."""
    return chain(IIWA, IIWA_TOOL)


def ur():
    """Lengths of the UR5e."""
    joints = [
        (Z, (0.0, 0.0, 0.0)),
        (Y, (0.0, 0.0, 0.1625)),
        (Y, (0.425, 0.0, 0.1625)),
        (Y, (0.8172, 0.0, 0.1625)),
        (DOWN, (0.8172, 0.1333, 0.1625)),
        (Y, (0.8172, 0.1333, 0.0628)),
    ]
    return chain(joints, (0.8172, 0.2329, 0.0628))


def panda_lengths():
    """Lengths of the Panda."""
    joints = [
        (Z, (0.0, 0.0, 0.333)),
        (Y, (0.0, 0.0, 0.333)),
        (Z, (0.0, 0.0, 0.649)),
        (BACK, (0.0825, 0.0, 0.649)),
        (Z, (0.0, 0.0, 1.033)),
        (BACK, (0.0, 0.0, 1.033)),
        (DOWN, (0.088, 0.0, 1.033)),
    ]
    return chain(joints, (0.088, 0.0, 0.926))


def rail_arm():
    """Spherical wrist on an ortho-parallel base, on a rail."""
    points = [
        (0.0, 0.0, 0.4),
        (0.05, 0.0, 0.4),
        (0.07, 0.05, 0.9),
        (0.09, 0.05, 1.0),
        (0.09, 0.05, 1.4),
    ]
    arm = list(zip((Z, Y, Y, Z, Y, Z), [*points, points[-1]], strict=True))
    return chain([(Y, (0.0, 0.0, 0.0), "slide"), *arm], (0.14, 0.03, 1.5))


def much_redundant():
    """A turntable and a rail below, a roll at the tool."""
    moved = [(axis, (x + 0.3, y + 0.1, z + 0.2)) for axis, (x, y, z) in IIWA]
    below = [(Z, (0.1, 0.4, 0.0)), (X, (0.2, 0.1, 0.1), "slide")]
    return bind(chain([*below, *moved], (0.37, 0.12, 1.5)), "pose_free_roll")[0]


def telescope():
    """The upper arm is a telescope: two joints between the six may be redundant."""
    return chain([*IIWA[:3], (Z, (0.0, 0.0, 0.5), "slide"), *IIWA[3:]], IIWA_TOOL)


def gen3():
    """Offsets of the Kinova Gen3: neither its shoulder nor its wrist is spherical."""
    heights = (0.28481, 0.28481, 0.49519, 0.70557, 0.914, 1.01993, 1.12586)
    offsets = (0.0, 0.005375, 0.01175, 0.018125, 0.0245, 0.024675, 0.02485)
    axes = (Z, Y, Z, Y, Z, Y, Z)
    return chain(
        [
            (axis, (0.0, y, z))
            for axis, y, z in zip(axes, offsets, heights, strict=True)
        ],
        (0.0, 0.02485, 1.3),
    )


def iiwa_by_angles(quarter):
    """The iiwa with every axis along its frame's z, as URDF exporters write it: turned by quarters to and fro."""
    turns = (0.0, -quarter, quarter, quarter, -quarter, -quarter, quarter)
    steps = [
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.36),
        (0.0, -0.21, 0.0),
        (0.0, 0.0, 0.21),
        (0.0, 0.2, 0.0),
        (0.0, 0.0, 0.2),
    ]
    steps.append((0.0, -0.05, 0.0))
    joints = [
        Joint("revolute", xyz=xyz, rpy=(turn, 0.0, 0.0))
        for turn, xyz in zip(turns, steps, strict=True)
    ]
    return Robot.from_urdf(
        "by angles", urdf_text=chain_urdf(joints, tool=(0.0, 0.0, 0.076))
    )


def panda():
    """The Panda's own URDF."""
    path = published("panda_description/urdf/panda.urdf")
    return Robot.from_urdf(path, tool_frame="panda_hand_tcp")
