import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import brachis
from brachis.apps.view.bodies import bodies_of, placements
from brachis.robot import Robot
from support.shown import ROBOTS


def placed(bodies, found):
    """Vertices in the world at the first posture, by joint."""
    return {
        joint: found[0][0, joint]
        + Rotation.from_quat(found[1][0, joint], scalar_first=True).apply(
            np.vstack([m.vertices for m in meshes])
        )
        for joint, meshes in bodies.items()
    }


def test_placements_are_those_of_the_model(motion_of):
    robot = Robot.from_urdf(
        ROBOTS[-1], mounting={"xyz": [0.1, 0.2, 0.3], "rpy_deg": [10, 20, 30]}
    )
    q = motion_of(robot).position(np.linspace(0.1, 0.9, 5))
    positions, quaternions = placements(robot, q)
    tool, rotations = robot.tool_placements(q)
    assert_allclose(positions[:, -1], tool, atol=1e-12)
    turned = Rotation.from_quat(quaternions[:, -1], scalar_first=True).as_matrix()
    assert_allclose(turned, rotations, atol=1e-12)


def test_a_rail_is_part_of_what_stands_still_and_the_arm_is_not(motion_of):
    tx90l = next(path for path in ROBOTS if path.parent.name == "tx90l_rail")
    bodies = bodies_of(motion_of(Robot.from_urdf(tx90l)))
    assert bodies.shows_links
    assert set(bodies.links) == set(range(8))
    assert bodies.box[1][1] - bodies.box[0][1] > 4.0
    assert bodies.moving_box[1][1] - bodies.moving_box[0][1] < 2.0


def test_a_robot_without_shapes_gets_a_skeleton_from_base_to_tool(
    bare_robot, motion_of
):
    motion = motion_of(bare_robot)
    bodies = bodies_of(motion)
    assert not bodies.shows_links
    assert bodies.links == {}
    found = placements(bare_robot, motion.q[:1])
    vertices = placed(bodies.skeleton, found)
    assert np.linalg.norm(vertices[2] - found[0][0, -1], axis=1).min() < 0.05
    assert_allclose(
        [vertices[0][:, 1].min(), vertices[0][:, 1].max()], [-1.0, 2.0], atol=0.02
    )  # the rail
    assert np.linalg.norm(vertices[1] - found[0][0, 2], axis=1).min() < 0.05


@pytest.mark.parametrize("urdf", ROBOTS, ids=lambda path: path.parent.name)
def test_the_box_holds_every_robot(urdf, motion_of):
    motion = motion_of(getattr(brachis.robots, urdf.parent.name))
    bodies = bodies_of(motion)
    assert bodies.shows_links
    vertices = np.vstack(
        list(placed(bodies.links, placements(motion.robot, motion.q[:1])).values())
    )
    assert (vertices >= bodies.box[0] - 1e-9).all()
    assert (vertices <= bodies.box[1] + 1e-9).all()
