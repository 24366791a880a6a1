"""The verification's own kinematics and torques, from the URDF's text, against Pinocchio's."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

from brachis.robot import Robot, bind, dynamics
from brachis.verify import mechanics
from support.chains import planar_robot

ROBOTS = Path(__file__).parents[2] / "robots"
OPTIONS = yaml.safe_load("""
payload:
  mass: 3
  com: [0.1, 0.2, 0.3]
  inertia: {ixx: 0.1, iyy: 0.2, izz: 0.25, iyz: 0.02}
tool_offset:
  xyz: [0.1, 0.2, 0.3]
  rpy_deg: [10, 20, 30]
mounting:
  xyz: [1, 2, 3]
  rpy_deg: [30, -50, 70]
friction: {armature: 0.3, viscous: 1.0, coulomb: 2.0}
gravity: [1.0, -2.0, -9.0]
""")


@pytest.mark.parametrize(
    "name", ["tx90l_rail", "ur10_rail", "iiwa14", "iiwa14, free roll", "RPCR"]
)
def test_own_mechanics_are_pinocchios(name):
    folder, *rolls = name.split(", ")
    path = ROBOTS / folder / "robot.urdf"
    robot = (
        Robot.from_urdf(path, **OPTIONS)
        if path.exists()
        else planar_robot(folder, "tilted", **OPTIONS)
    )
    if rolls:
        robot, _ = bind(robot, "pose_free_roll")
    rng = np.random.default_rng(0)
    q, qdot, qddot = (rng.normal(size=(50, robot.n)) for _ in range(3))
    expected = dynamics.torque(robot, q, qdot, qddot)
    assert_allclose(
        mechanics.torques(robot, q, qdot, qddot),
        expected,
        atol=1e-13 * np.abs(expected).max(),
    )
    joints = mechanics.joint_placements(robot, q)
    for mine, other in zip(
        mechanics.tool_placements(robot, q, joints),
        robot.tool_placements(q),
        strict=True,
    ):
        assert_allclose(mine, other, atol=1e-13)
    states = [robot.of_real_joints(each) for each in (q, qdot, qddot)]
    still = np.zeros_like(q)
    sizes = [
        np.linalg.norm(part, axis=0)
        for part in (
            *mechanics.tool_accelerations(robot, q, still, qdot),
            mechanics.tool_accelerations(robot, q, qdot, qddot)[0],
        )
    ]
    for quantity, mine in zip(
        ("speed", "angular speed", "acceleration"), sizes, strict=True
    ):
        other = robot.chain.tool_sizes(quantity, *states)
        assert_allclose(mine, other, atol=1e-12 * other.max())
