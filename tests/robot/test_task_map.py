"""Task maps of rows: values, and the sense of yaw."""

import pickle

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import brachis
from brachis.errors import InputError
from brachis.robot import Robot, task_map_of
from support.chains import ZERO, Joint, chain_urdf, planar_robot


@pytest.fixture(scope="module")
def scara(scara_urdf):
    return Robot.from_urdf(scara_urdf)


@pytest.mark.parametrize(
    "rows",
    [["x"], ["z", "x"], ["x", "y", "z"], ["y", "z"]],
    ids=str,
)
def test_position_rows_are_world_coordinates_in_the_order_of_the_task(rows):
    robot = planar_robot("RRR", "tilted")
    space = task_map_of(robot, rows)
    assert space.rows == tuple(rows)
    assert space.m == len(rows)
    assert space.units == ("m",) * len(rows)
    q = np.array([0.3, -0.4, 0.5])
    named = dict(zip("xyz", robot.tool_placement(q).translation, strict=True))
    assert_array_equal(space.value(q), [named[row] for row in rows])


MOUNTS = {"roll": (0.0, np.pi / 2, 0.0), "pitch": (np.pi / 2, 0.0, 0.0), "yaw": ZERO}


@pytest.mark.parametrize("rows", [["x", "y"], ["z"], [], ["z", "x", "y"]], ids=str)
@pytest.mark.parametrize("angle", ["roll", "pitch", "yaw"])
def test_an_angle_turns_about_its_axis_by_the_right_hand_rule(angle, rows):
    mount = Joint("fixed", rpy=MOUNTS[angle], limit=None)
    joints = [Joint("revolute", xyz=(0.4, 0.0, 0.0)) for _ in range(3)]
    text = chain_urdf(joints, tool=(0.2, 0.0, 0.0), mount=mount)
    robot = Robot.from_urdf("chain", urdf_text=text)
    space = task_map_of(robot, [*rows, angle])
    upright = robot.tool_placement(np.zeros(3)).rotation
    assert space.units == ("m",) * len(rows) + ("rad",)
    rng = np.random.default_rng(1)
    for turn in rng.uniform(-3.0, 3.0, 5):
        about = pin.AngleAxis(turn, np.eye(3)[["roll", "pitch", "yaw"].index(angle)])
        first = rng.normal(size=3)
        value = space.of_placements(first[None], (about.matrix() @ upright)[None])[0]
        named = dict(zip("xyz", first, strict=True))
        assert_allclose(value[:-1], [named[row] for row in rows])
        base = space.of_placements(first[None], upright[None])[0]
        assert space.difference(value, base)[-1] == pytest.approx(turn)


def test_sizes_of_displacements_of_positions_and_angles_apart(scara):
    position, angle = task_map_of(scara, ["x", "y", "yaw"]).norms(
        np.array([[3.0, 4.0, -0.5], [0.0, 0.0, 2.0]])
    )
    assert_allclose(position, [5.0, 0.0])
    assert_allclose(angle, [0.5, 2.0])
    position, angle = task_map_of(scara, ["y"]).norms(np.array([[-3.0]]))
    assert_array_equal([position, angle], [[3.0], [0.0]])


def test_a_map_survives_pickling(scara):
    space = task_map_of(scara, ["x", "y", "yaw"])
    again = pickle.loads(pickle.dumps(space))  # noqa: S301
    q = np.array([[0.3, -0.4, 0.5]])
    assert (again.rows, again.tool_axis) == (space.rows, space.tool_axis)
    assert_allclose(again.twists(q), space.twists(q), atol=1e-14)


@pytest.mark.parametrize(
    "rows",
    [
        [],
        ["x", "x"],
        ["x", "w"],
        ["yaw", "x", "y"],
        ["x", "yaw", "y"],
        ["x", "yaw", "pitch"],
        ["x", "rx"],
    ],
    ids=str,
)
def test_rows_that_make_no_sense(scara, rows):
    with pytest.raises(InputError, match="task_space") as caught:
        task_map_of(scara, rows)
    assert caught.value.found == rows


@pytest.mark.parametrize(
    "rows, found, hint",
    [
        (["x", "z", "yaw"], "with j1, j2, j3 about other axes", "[x, z, pitch]"),
        (["roll"], "[roll], with j1, j2, j3", "task_space: [pitch]"),
    ],
)
def test_an_angle_about_another_axis_names_the_joints_and_the_right_one(
    rows, found, hint
):
    with pytest.raises(InputError, match="the world's") as caught:
        task_map_of(planar_robot("RRR", "xz"), rows)
    assert found in str(caught.value)
    assert hint in caught.value.hint


def test_the_angle_of_an_arm_with_a_wrist_is_refused_with_advice():
    with pytest.raises(InputError, match="yaw is the angle of tools") as caught:
        task_map_of(brachis.robots.iiwa14, ["x", "y", "z", "yaw"])
    assert "pose_free_roll" in caught.value.hint


def test_yaw_without_a_tool_axis_in_the_plane():
    # The tilted plane holds none of the tool's axes within the world's xy-plane.
    robot = planar_robot("RRR", "tilted")
    in_plane = np.linalg.norm(robot.tool_placement(np.zeros(3)).rotation[:2], axis=0)
    assert not np.any(in_plane > 1.0 - 1e-6)
    with pytest.raises(InputError, match="yaw"):
        task_map_of(robot, ["x", "y", "yaw"])
