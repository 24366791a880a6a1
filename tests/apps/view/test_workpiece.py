"""The viewer of a cell with a positioner: the world stands still, and the path moves with the workpiece."""

import numpy as np
import pytest

import brachis
from brachis.apps.plots.postures import skeleton, tool_in_world
from brachis.apps.view import Viewer
from brachis.apps.view.bodies import bodies_of, placements

pytest.importorskip("viser", reason="viser is not installed")


@pytest.fixture
def motion(motion_of):
    return motion_of(brachis.robots.tx90l_positioner)


def test_what_stands_still_is_fixed_to_the_world(motion):
    robot = motion.robot
    q = motion.position(np.linspace(0.0, motion.t_end, 9))
    positions, quaternions = placements(robot, q)
    world, _ = robot.world
    assert np.ptp(positions[:, world], axis=0).max() < 1e-12
    assert np.ptp(quaternions[:, world], axis=0).max() < 1e-12
    assert np.ptp(positions[:, 0], axis=0).max() > 0.01
    # The table turns about the tilt axis, 0.3 m above the floor.
    assert np.hypot(positions[:, 0, 1], positions[:, 0, 2] - 0.3) == pytest.approx(0.15)
    bones = skeleton(robot, q)
    np.testing.assert_allclose(bones[:, -1], positions[:, -1], atol=1e-12)
    samples = motion.at(np.linspace(0.0, motion.t_end, 9))
    trace = tool_in_world(robot, samples)
    np.testing.assert_allclose(trace, positions[:, -1], atol=1e-12)


def test_the_pedestal_is_in_the_box_but_does_not_move(motion):
    bodies = bodies_of(motion)
    assert bodies.box[0][2] == pytest.approx(-0.03)  # the arm's base plate
    assert bodies.moving_box[0][2] > bodies.box[0][2] + 0.05


def test_the_path_is_drawn_on_the_workpiece(motion):
    with Viewer(motion, port=0) as viewer:
        scene = viewer._scene
        names = [handle.name for handle in scene.layers["path"]]
        assert all(name.startswith("/joint 0/") for name in names)
        before = np.array(scene._frames[0].position)
        viewer.playback.go_to(0.9 * motion.t_end)
        viewer.show()
        assert np.abs(np.array(scene._frames[0].position) - before).max() > 0.01
