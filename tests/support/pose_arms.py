"""Arms for poses whose axes are parallel or meet in all the places that closed forms are made for."""

from __future__ import annotations

import numpy as np

from brachis.robot import Robot, bind
from support.chains import Joint, chain_urdf
from support.published import published_urdf

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
    points = np.array([(0.0, 0.0, 0.0), *(joint[1] for joint in joints), tool])
    *steps, last = (tuple(step) for step in np.diff(points, axis=0).tolist())
    chain_joints = [
        Joint("prismatic", axis, step, limit=SLIDE)
        if slide
        else Joint("revolute", axis, step)
        for (axis, _, *slide), step in zip(joints, steps, strict=True)
    ]
    return Robot.from_urdf("chain", urdf_text=chain_urdf(chain_joints, tool=last))


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
    arm = [
        (Z, (0.0, 0.0, 0.4)),
        (Y, (0.05, 0.0, 0.4)),
        (Y, (0.07, 0.05, 0.9)),
        (Z, (0.09, 0.05, 1.0)),
        (Y, (0.09, 0.05, 1.4)),
        (Z, (0.09, 0.05, 1.4)),
    ]
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
    along_y = (0.0, 0.0, -0.21, 0.0, 0.2, 0.0, -0.05)
    along_z = (0.0, 0.36, 0.0, 0.21, 0.0, 0.2, 0.0)
    joints = [
        Joint("revolute", xyz=(0.0, y, z), rpy=(turn, 0.0, 0.0))
        for turn, y, z in zip(turns, along_y, along_z, strict=True)
    ]
    text = chain_urdf(joints, tool=(0.0, 0.0, 0.076))
    return Robot.from_urdf("by angles", urdf_text=text)


def panda():
    """The Panda's own URDF."""
    path = published_urdf("panda_description/urdf/panda.urdf")
    return Robot.from_urdf(path, tool_frame="panda_hand_tcp")
