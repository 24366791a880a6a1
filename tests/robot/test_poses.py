"""Task spaces of poses, and tools that roll freely."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.errors import InputError
from brachis.robot import Robot, bind, dynamics, task_map_of
from brachis.robot.task_map import Pose
from support.chains import chain_urdf
from support.spatial import START, rail_arm, rail_arm_joints


def test_a_pose_has_six_rows_and_twelve_coordinates():
    robot = rail_arm()
    space = task_map_of(robot, "pose")
    assert space.m == 6
    assert space.units == ("m", "m", "m", "rad", "rad", "rad")
    placement = robot.tool_placement(np.array(START))
    value = space.value(np.array(START))
    assert value.shape == (12,)
    assert_array_equal(value[:3], placement.translation)
    assert_array_equal(value[3:].reshape(3, 3), placement.rotation)
    assert isinstance(task_map_of(robot, space.rows), Pose)


def coordinates(placement):
    return np.concatenate([placement.translation, placement.rotation.ravel()])


def test_difference_of_poses_is_the_displacement_in_the_second_ones_frame():
    space = task_map_of(rail_arm(), "pose")
    rng = np.random.default_rng(2)
    pose = pin.SE3.Random()
    for size in (1e-9, 1e-3, 2.0):
        shift, turn = size * rng.normal(size=3), size * rng.normal(size=3) / 2.0
        moved = pose * pin.SE3(pin.exp3(turn), shift)
        found = space.difference(coordinates(moved), coordinates(pose))
        assert_allclose(
            found, np.append(shift, turn), atol=1e-14 if size < 1.0 else 1e-12
        )


def test_words_that_do_not_exist():
    with pytest.raises(InputError, match="pose_free_roll"):
        task_map_of(rail_arm(), "posse")
    with pytest.raises(InputError, match="does not roll freely"):
        task_map_of(rail_arm(), "pose_free_roll")


def test_the_virtual_joint_says_how_far_the_tool_is_turned_about_its_own_z_axis():
    fixed = rail_arm()
    robot, space = bind(fixed, "pose_free_roll")
    assert robot.joint_names == (*fixed.joint_names, "tool_roll")
    assert robot.n == fixed.n + 1
    assert space.m == 6
    assert bind(robot, "pose_free_roll")[0] is robot
    expected = fixed.tool_placement(np.array(START)) * pin.SE3(
        pin.exp3(np.array([0.0, 0.0, -0.7])), np.zeros(3)
    )
    assert robot.tool_placement(np.array([*START, 0.7])).isApprox(expected, 1e-14)


def test_the_virtual_joint_has_no_inertia_and_no_limits():
    fixed = rail_arm(friction={"viscous": 1.0, "coulomb": 2.0, "armature": 0.1})
    robot = bind(fixed, "pose_free_roll")[0]
    rng = np.random.default_rng(3)
    q, qdot, qddot = rng.normal(size=(3, 5, robot.n))
    tau = dynamics.torque(robot, q, qdot, qddot)
    assert_allclose(tau[:, -1], 0.0, atol=1e-12)
    assert_allclose(
        tau[:, :-1],
        dynamics.torque(fixed, q[:, :-1], qdot[:, :-1], qddot[:, :-1]),
        rtol=1e-12,
    )
    kinds = "torque velocity acceleration power rms_torque position_upper"
    for kind in kinds.split():
        assert np.isinf(getattr(robot.limits, kind)[-1])


def test_a_posture_may_leave_the_virtual_joint_out():
    robot = bind(rail_arm(), "pose_free_roll")[0]
    assert_array_equal(robot.posture(list(START), "start"), [*START, 0.0])
    named = dict(zip(robot.joint_names, START, strict=False))
    assert_array_equal(robot.posture(named, "start"), [*START, 0.0])
    assert_array_equal(robot.posture([*START, 0.4], "start"), [*START, 0.4])
    with pytest.raises(InputError):
        robot.posture(list(START[:-1]), "start")


def test_a_joint_of_the_virtual_ones_name_is_an_error():
    text = chain_urdf(rail_arm_joints()).replace("'j7'", "'tool_roll'")
    robot = Robot.from_urdf("named", urdf_text=text)
    with pytest.raises(InputError, match="name of a virtual joint"):
        bind(robot, "pose_free_roll")
