"""The robots of the repository: made by their script, readable, and as their data sheets say."""

import math

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from lxml import etree
from numpy.testing import assert_allclose, assert_array_equal

from brachis import Robot
from brachis.apps.compose import Rail, on_rail
from brachis.robot import dynamics

from .conftest import ROOT

ROBOTS = ROOT / "robots"
URDFS = sorted(ROBOTS.glob("*/*.urdf"))
MADE = (
    "tx90l_rail/robot.urdf",
    "tx90l_rail/arm.urdf",
    "tx90l_positioner/robot.urdf",
    *(f"{name}/robot.urdf" for name in ("iiwa14", "gen3", "gen3_rails", "arm8")),
    "ur10_rail/robot.urdf",
)
TX90L_START = (0.0, 0.3, 0.2, 1.5, 0.2, 1.2, 0.1)


def gravity_torque(robot, q):
    still = np.zeros_like(q)
    return dynamics.torque(robot, q, still, still)


def anywhere(robot, count=2000):
    limits = robot.limits
    return np.random.default_rng(0).uniform(
        limits.position_lower, limits.position_upper, (count, robot.n)
    )


def turn(axis, angle):
    return pin.SE3(pin.exp3(angle * np.eye(3)["xyz".index(axis)]), np.zeros(3))


def shift(x, y, z):
    return pin.SE3(np.eye(3), np.array([x, y, z]))


@pytest.mark.parametrize("path", URDFS, ids=lambda path: "/".join(path.parts[-2:]))
def test_robot_is_read_by_brachis_and_yourdfpy(path):
    link = "workpiece" if path.parent.name == "tx90l_positioner" else None
    robot = Robot.from_urdf(path, workpiece_frame=link)
    assert robot.n >= 2
    assert np.all(np.isfinite(robot.limits.torque))
    urdf = yourdfpy.URDF.load(
        path
    )  # with its geometry: nothing is missing outside of the file
    assert urdf.validate()
    assert len(urdf.actuated_joint_names) == robot.n
    assert len(urdf.scene.geometry) >= 2
    assert etree.fromstring(path.read_bytes()).find(".//mesh") is None


@pytest.mark.parametrize("name", MADE)
def test_robot_is_what_the_script_makes_of_its_figures(maker, name):
    if name.startswith("ur10") and maker.example_robot_data() is None:
        pytest.skip("example-robot-data is not installed")
    assert {*maker.MAKERS} == {*MADE}
    assert maker.MAKERS[name]() == (ROBOTS / name).read_text(), (
        "run python robots/make_robots.py"
    )


@pytest.fixture(scope="module")
def tx90l():
    return Robot.from_urdf(ROBOTS / "tx90l_rail/robot.urdf")


def test_tx90l_figures(tx90l):
    assert tx90l.joint_names == ("rail", *(f"joint_{i}" for i in range(1, 7)))
    assert (tx90l.base_frame, tx90l.tool_frame) == ("world", "tool")
    degrees = [
        [-180, -130, -145, -270, -115, -270],
        [180, 147.5, 145, 270, 140, 270],
        [400, 390, 420, 540, 475, 760],
    ]
    lower, upper, speed = (np.radians(row) for row in degrees)
    assert_array_equal(tx90l.limits.position_lower, [-2.0, *lower])
    assert_array_equal(tx90l.limits.position_upper, [2.0, *upper])
    assert_array_equal(tx90l.limits.velocity, [2.0, *speed])
    assert_array_equal(
        tx90l.limits.torque, [1500.0, 318.0, 130.0, 65.0, 34.0, 29.0, 11.0]
    )


def test_tx90l_forward_kinematics_are_those_of_an_ortho_parallel_wrist_arm(tx90l):
    """Closed form of Brandstoetter, Angerer and Hofbaur (2014) with a1, a2, b, c1 .. c4 of the TX90L."""
    a1, b, c1, c2, c3, c4 = 0.05, 0.05, 0.478, 0.5, 0.55, 0.1
    for q in anywhere(tx90l, 50):
        rail, q1, q2, q3, q4, q5, q6 = q
        reach = a1 + c2 * math.sin(q2) + c3 * math.sin(q2 + q3)
        height = c1 + c2 * math.cos(q2) + c3 * math.cos(q2 + q3)
        wrist = turn("z", q1).act(np.array([reach, b, height]))
        forearm = turn("z", q1) * turn("y", q2 + q3)
        hand = (forearm * turn("z", q4) * turn("y", q5) * turn("z", q6)).rotation
        placement = tx90l.tool_placement(q)
        assert_allclose(placement.rotation, hand, atol=1e-14)
        expected = wrist + [0.0, rail, 0.0] + c4 * hand[:, 2]
        assert_allclose(placement.translation, expected, atol=1e-14)


def test_tx90l_gravity_asks_121_of_130_newton_metres(tx90l):
    stretched = np.array([[0.0, 0.0, math.pi / 2, 0.0, 0.0, 0.0, 0.0]])
    assert abs(gravity_torque(tx90l, stretched)[0, 2]) == pytest.approx(121.2, abs=0.05)
    worst = np.abs(gravity_torque(tx90l, anywhere(tx90l))).max(axis=0)
    assert np.all(worst < tx90l.limits.torque)


def test_tx90l_rail_moves_the_whole_arm_and_no_other_carriage(tx90l):
    q, still = np.array([TX90L_START]), np.zeros((1, 7))
    force = dynamics.torque(tx90l, q, still, np.eye(7)[:1])[0, 0]
    assert force == pytest.approx(
        10.733459 + 16.934564 + 14.350897 + 7.501506 + 6.420429 + 0.568760 + 0.030977
    )


def denavit_hartenberg(start, rows, q):
    """Placement by rows of d, a, alpha."""
    placement = start
    for angle, (d, a, alpha) in zip(q, rows, strict=True):
        placement = placement * turn("z", angle) * shift(a, 0.0, d) * turn("x", alpha)
    return placement.homogeneous


def test_iiwa14_is_the_published_arm():
    robot = Robot.from_urdf(ROBOTS / "iiwa14/robot.urdf")
    limits = robot.limits
    assert robot.joint_names == tuple(f"joint_{i}" for i in range(1, 8))
    assert (robot.base_frame, robot.tool_frame) == ("link_0", "tool")
    ranges = np.radians([170, 120, 170, 120, 170, 120, 175])
    assert_array_equal(limits.position_upper, ranges)
    assert_array_equal(limits.position_lower, -ranges)
    speeds = np.radians([85, 85, 100, 75, 130, 135, 135])
    assert_array_equal(limits.velocity, speeds)
    assert_array_equal(limits.torque, [320, 320, 176, 176, 110, 40, 40])
    assert np.all(np.abs(gravity_torque(robot, anywhere(robot))) < limits.torque)
    lengths = (0.36, 0.0, 0.42, 0.0, 0.40, 0.0, 0.126)
    twists = np.radians([-90, 90, 90, -90, -90, 90, 0])
    rows = [(d, 0.0, alpha) for d, alpha in zip(lengths, twists, strict=True)]
    for q in anywhere(robot, 50):
        expected = denavit_hartenberg(pin.SE3.Identity(), rows, q)
        assert_allclose(robot.tool_placement(q).homogeneous, expected, atol=1e-14)


def test_ur10_rail_is_the_published_arm():
    robot = Robot.from_urdf(ROBOTS / "ur10_rail/robot.urdf")
    assert (robot.base_frame, robot.tool_frame) == ("world", "tool0")
    assert robot.joint_names[0] == "rail"
    masses = [inertia.mass for inertia in robot.model.inertias]
    assert sum(masses) == pytest.approx(60.0 + 32.7)
    torques = [2000.0, 330.0, 330.0, 150.0, 54.0, 54.0, 54.0]
    assert_array_equal(robot.limits.torque, torques)
    # As the maker publishes it; its base frame is turned by 180 degrees about z.
    rows = (
        (0.1273, 0.0, math.pi / 2),
        (0.0, -0.612, 0.0),
        (0.0, -0.5723, 0.0),
        (0.163941, 0.0, math.pi / 2),
        (0.1157, 0.0, -math.pi / 2),
        (0.0922, 0.0, 0.0),
    )
    for q in anywhere(robot, 50):
        base = shift(0.0, q[0], 0.0) * turn("z", math.pi)
        expected = denavit_hartenberg(base, rows, q[1:])
        # The source writes right angles with twelve digits.
        assert_allclose(robot.tool_placement(q).homogeneous, expected, atol=1e-10)


PUBLIC = {
    "ur10": ("ur_description/urdf/ur10_robot.urdf", "tool0", 6),
    "panda": ("panda_description/urdf/panda.urdf", "panda_hand_tcp", 7),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", "link7", 7),
    "kinova": ("kinova_description/robots/kinova.urdf", "j2s6s200_end_effector", 6),
}


@pytest.mark.parametrize("name", PUBLIC)
def test_a_public_arm_on_a_rail_keeps_its_joints_and_meshes(maker, name, tmp_path):
    folder = maker.example_robot_data()
    if folder is None:
        pytest.skip("example-robot-data is not installed")
    path, tool, joints = PUBLIC[name]
    output = tmp_path / "composed.urdf"
    rail = Rail(range=(0, 3), velocity=1, force=3000, mass=50)
    on_rail(folder / path, rail, output=output)
    arm = Robot.from_urdf(folder / path, tool_frame=tool)
    robot = Robot.from_urdf(output, tool_frame=tool)
    assert robot.n == 1 + joints
    assert robot.joint_names == ("rail", *arm.joint_names)
    meshes = [*etree.parse(output).iter("mesh")]
    assert meshes
    assert all((tmp_path / mesh.get("filename")).is_file() for mesh in meshes)
