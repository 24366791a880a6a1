import numpy as np
import pytest

from brachis.robot import Robot
from support import motions

SPATIAL_JOINTS = {
    "rail": ("prismatic", "0 1 0", "0 0 0.2"),
    "shoulder_pan": ("revolute", "0 0 1", "0 0 0.4"),
    "shoulder_lift": ("revolute", "0 1 0", "0.1 0 0"),
    "elbow": ("revolute", "0 1 0", "0 0 0.6"),
    "wrist_1": ("revolute", "0 0 1", "0 0 0.3"),
    "wrist_2": ("revolute", "0 1 0", "0 0 0.3"),
    "wrist_3": ("revolute", "0 0 1", "0 0 0.1"),
}


def build_robot(joints):
    """A chain of (kind, axis, origin); the tool is 0.15 m along x of the last link."""
    links, parent = ['<link name="world"/>'], "world"
    for i, (name, (kind, axis, origin)) in enumerate(joints.items()):
        links.append(
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="link{i}"/>'
            f'<origin xyz="{origin}"/><axis xyz="{axis}"/>'
            f'<limit lower="-3" upper="3" effort="{50 + 10 * i}" velocity="{1.0 + 0.2 * i}"/></joint>'
            f'<link name="link{i}"><inertial><mass value="1"/>'
            '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
        parent = f"link{i}"
    flange = f'<parent link="{parent}"/><child link="tool"/><origin xyz="0.15 0 0"/>'
    links.append(
        f'<link name="tool"/><joint name="flange" type="fixed">{flange}</joint>'
    )
    return Robot.from_urdf(
        "chain.urdf", urdf_text=f'<robot name="chain">{"".join(links)}</robot>'
    )


@pytest.fixture(scope="session")
def chain():
    return build_robot


@pytest.fixture(scope="session")
def spatial_trajectory(line_trajectory):
    """Seven joints, one of them prismatic, from one posture to another within one polynomial piece."""
    q = np.array(
        [[0.0, 0.3, 0.4, 0.8, 0.2, 0.9, 0.0], [0.9, -0.6, 0.6, 0.5, 0.2, 0.9, 1.0]]
    )
    return motions.motion_between(
        line_trajectory,
        build_robot(SPATIAL_JOINTS),
        q,
        task_space=("x", "y", "z"),
        redundant_joints=("rail",),
    )


@pytest.fixture(scope="session")
def with_limits():
    """A trajectory's copy whose robot has other limits."""
    return motions.with_limits
