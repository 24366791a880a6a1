"""Robots whose positioner carries the workpiece, against Pinocchio's model of the whole cell."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.errors import UnknownNameError, UrdfError
from brachis.robot import bind, dynamics
from brachis.verify import mechanics
from support.random_chains import random_cell

CELLS = [(1, 3), (2, 4), (3, 2), (4, 0), (0, 3)]
MOUNTING = {"xyz": [1.0, 2.0, 3.0], "rpy_deg": [30.0, -50.0, 70.0]}
PAYLOAD = {"mass": 3.0, "com": [0.1, 0.2, 0.3]}
FRICTION = {"armature": 0.3, "viscous": 1.0, "coulomb": 2.0}
POSITIONER = brachis.robots.tx90l_positioner


@cache
def cell(carriers, n, seed=0):
    model = random_cell(carriers, n, seed)
    robot = brachis.Robot.from_pinocchio(
        model,
        "tool",
        workpiece_frame="workpiece",
        limits={"torque": 1e6},
        mounting=MOUNTING,
        friction=FRICTION,
    )
    return model, robot


def states_of(robot):
    return np.random.default_rng(1).normal(size=(3, 12, robot.n))


def order_of(model, robot):
    """Number of each joint of the robot in the model."""
    return [model.joints[model.getJointId(name)].idx_v for name in robot.joint_names]


@pytest.mark.parametrize("carriers, n", CELLS, ids=str)
def test_the_tool_is_placed_as_seen_from_the_workpiece(carriers, n):
    model, robot = cell(carriers, n)
    assert robot.urdf_dynamics.carriers == carriers
    assert list(robot.joint_names[:carriers]) == list(model.names)[carriers:0:-1]
    data = model.createData()
    q, qdot, qddot = states_of(robot)
    frames = [model.getFrameId(name) for name in ("workpiece", "tool")]
    positions, rotations = robot.tool_placements(q)
    own = mechanics.tool_placements(robot, q, mechanics.joint_placements(robot, q))
    for k, posture in enumerate(q):
        full = np.empty(robot.n)
        full[order_of(model, robot)] = posture
        pin.framesForwardKinematics(model, data, full)
        workpiece, tool = (data.oMf[frame] for frame in frames)
        seen = workpiece.actInv(tool)
        assert_allclose(positions[k], seen.translation, atol=1e-12)
        assert_allclose(rotations[k], seen.rotation, atol=1e-12)
        assert_allclose(own[0][k], seen.translation, atol=1e-12)
        assert_allclose(own[1][k], seen.rotation, atol=1e-12)
    accelerations, _ = mechanics.tool_accelerations(robot, q, qdot, qddot)
    sizes = robot.chain.tool_sizes("acceleration", q, qdot, qddot)
    assert_allclose(np.linalg.norm(accelerations, axis=0), sizes, rtol=1e-10)


@pytest.mark.parametrize("carriers, n", CELLS, ids=str)
def test_torques_are_those_of_the_whole_tree_in_the_world(carriers, n):
    model, robot = cell(carriers, n)
    turned = pin.rpy.rpyToMatrix(*np.radians(MOUNTING["rpy_deg"]))
    gravity = model.gravity.linear.copy()
    mounted = pin.Model(model)
    mounted.gravity.linear = turned.T @ gravity
    data = mounted.createData()
    states = states_of(robot)
    order = order_of(model, robot)
    expected = []
    for moment in states.swapaxes(0, 1):
        full = np.empty((3, robot.n))
        full[:, order] = moment
        expected.append(pin.rnea(mounted, data, *full)[order])
    _, qdot, qddot = states
    expected += 0.3 * qddot + qdot + 2.0 * np.tanh(qdot / robot.friction.v_eps)
    scale = 1e-12 * np.abs(expected).max()
    assert_allclose(dynamics.torque(robot, *states), expected, atol=scale)
    assert_allclose(mechanics.torques(robot, *states), expected, atol=scale)


@pytest.mark.parametrize("carriers, n", CELLS, ids=str)
def test_derivatives_of_torques_are_exact(carriers, n):
    _, robot = cell(carriers, n)
    states = states_of(robot)
    exact = robot.dynamic_chain.torque_derivatives(*states)
    for number, slopes in enumerate(exact):
        for joint in range(robot.n):
            ends = []
            for step in (-1e-6, 1e-6):
                moved = states.copy()
                moved[number, :, joint] += step
                ends.append(dynamics.torque(robot, *moved))
            found = (ends[1] - ends[0]) / 2e-6
            assert_allclose(
                slopes[:, :, joint], found, atol=1e-7 * np.abs(exact.q).max()
            )
    matrices = robot.dynamic_chain.mass_matrices(states[0])
    assert_allclose(matrices, exact.qddot, atol=1e-12 * np.abs(matrices).max())
    assert not matrices[:, :carriers, carriers:].any()


def test_a_locked_carrier_stands_still():
    _, robot = cell(2, 4)
    held = brachis.Robot.from_settings(
        robot.settings.model_copy(update={"locked_joints": {"carrier 0": 0.7}}),
        robot.source,
        robot.urdf,
    )
    assert held.joint_names == ("carrier 1", *robot.joint_names[2:])
    states = states_of(held)
    full = np.insert(states, 1, np.array([0.7, 0.0, 0.0])[:, None], axis=2)
    for held_values, values in zip(
        held.tool_placements(states[0]), robot.tool_placements(full[0]), strict=True
    ):
        assert_allclose(held_values, values, atol=1e-12)
    others = [0, 2, 3, 4, 5]
    expected = dynamics.torque(robot, *full)[:, others]
    found = dynamics.torque(held, *states)
    assert_allclose(found, expected, atol=1e-10)
    assert_allclose(mechanics.torques(held, *states), expected, atol=1e-10)


def test_payload_and_virtual_joints():
    settings = POSITIONER.settings
    urdf = POSITIONER.urdf
    carrying = brachis.Robot.from_urdf(
        "r.urdf",
        urdf_text=urdf,
        workpiece_frame=settings.workpiece_frame,
        payload=PAYLOAD,
    )
    robot, _ = bind(carrying, "pose_free_roll")
    q, qdot, qddot = states_of(robot)
    torque = dynamics.torque(robot, q, qdot, qddot)
    assert_allclose(mechanics.torques(robot, q, qdot, qddot), torque, atol=1e-10)
    assert not torque[:, -1].any()
    bare, _ = bind(POSITIONER, "pose_free_roll")
    without = dynamics.torque(bare, q, qdot, qddot)
    assert_allclose(torque[:, :2], without[:, :2], atol=1e-12)
    assert np.abs(torque - without)[:, 2:5].min() > 1e-3


def test_without_a_workpiece_frame_the_positioner_stands_still():
    arm = brachis.Robot.from_urdf(
        "r.urdf", urdf_text=POSITIONER.urdf, tool_frame="tool"
    )
    assert arm.joint_names == POSITIONER.joint_names[2:]
    assert arm.chain is arm.dynamic_chain


def test_wrong_frames():
    options = {"urdf_text": POSITIONER.urdf, "workpiece_frame": "table"}
    with pytest.raises(UrdfError, match="a chain to a workpiece has no base frame"):
        brachis.Robot.from_urdf("r.urdf", base_frame="base_link", **options)
    options["workpiece_frame"] = "tabel"
    with pytest.raises(UnknownNameError, match=r"workpiece_frame.*table"):
        brachis.Robot.from_urdf("r.urdf", **options)
