"""Task maps of rows: values, and the sense of yaw."""

from __future__ import annotations

import pickle

import numpy as np
import pinocchio as pin
import pytest

from brachis.errors import InputError
from brachis.robot import Robot, task_map_of
from support.chains import planar_robot


@pytest.fixture(scope="module")
def scara(scara_urdf):
    return Robot.from_urdf(scara_urdf)


@pytest.mark.parametrize(
    "rows",
    [["x"], ["z", "x"], ["x", "y", "z"], ["y", "z"]],
    ids=str,
)
def test_position_rows_are_world_coordinates_in_the_order_asked(rows):
    robot = planar_robot("RRR", "tilted")
    space = task_map_of(robot, rows)
    assert space.rows == tuple(rows)
    assert space.m == len(rows)
    assert space.units == ("m",) * len(rows)
    q = np.array([0.3, -0.4, 0.5])
    named = dict(zip("xyz", robot.tool_placement(q).translation, strict=True))
    np.testing.assert_array_equal(space.value(q), [named[row] for row in rows])


def test_yaw_of_the_scara_is_the_sum_of_its_angles(scara):
    space = task_map_of(scara, ["x", "y", "yaw"])
    assert space.units == ("m", "m", "rad")
    assert (space.sign, space.world_axis) == (1.0, 2)
    for q in np.random.default_rng(1).uniform(-1.0, 1.0, (10, 3)):
        assert space.value(q)[2] == pytest.approx(q.sum())


@pytest.mark.parametrize(
    ("plane", "rows", "sign", "axis"),
    [
        ("xy", ["x", "y", "yaw"], 1.0, 2),
        ("xy", ["y", "x", "yaw"], -1.0, 2),
        ("xz", ["x", "z", "yaw"], -1.0, 1),
        ("xz", ["z", "x", "yaw"], 1.0, 1),
    ],
)
def test_yaw_turns_from_the_first_row_towards_the_second(plane, rows, sign, axis):
    robot = planar_robot("RRR", plane)
    space = task_map_of(robot, rows)
    assert (space.sign, space.world_axis) == (sign, axis)
    q = np.array([0.2, 0.3, -0.4])
    placement = robot.tool_placement(q)
    first, second = np.eye(3)["xyz".index(rows[0])], np.eye(3)["xyz".index(rows[1])]
    turn = 0.1
    # A rotation by `turn` that carries the first axis towards the second.
    rotation = pin.AngleAxis(turn, np.cross(first, second)).matrix()
    np.testing.assert_allclose(
        rotation @ first, np.cos(turn) * first + np.sin(turn) * second, atol=1e-15
    )
    turned = space.of_placements(
        placement.translation[None], (rotation @ placement.rotation)[None]
    )[0]
    assert turned[2] - space.value(q)[2] == pytest.approx(turn)
    # The sign is that of an angular velocity about the positive world axis.
    spin = pin.AngleAxis(turn, np.eye(3)[axis]).matrix()
    spun = space.of_placements(
        placement.translation[None], (spin @ placement.rotation)[None]
    )[0]
    assert spun[2] - space.value(q)[2] == pytest.approx(sign * turn)


def test_yaw_is_the_direction_of_a_tool_axis(scara):
    space = task_map_of(scara, ["x", "y", "yaw"])
    tool_x = scara.tool_placement(np.array([0.5, 0.6, 0.7])).rotation[
        :, space.tool_axis
    ]
    np.testing.assert_allclose(tool_x, [np.cos(1.8), np.sin(1.8), 0.0], atol=1e-14)


def test_batch_equals_single_values(scara):
    space = task_map_of(scara, ["x", "y", "yaw"])
    q = np.random.default_rng(1).uniform(-3.0, 3.0, (7, 3))
    np.testing.assert_allclose(
        space.values(q), [space.value(posture) for posture in q], atol=1e-14
    )


def test_sizes_of_displacements_of_positions_and_angles_apart(scara):
    position, angle = task_map_of(scara, ["x", "y", "yaw"]).norms(
        np.array([[3.0, 4.0, -0.5], [0.0, 0.0, 2.0]])
    )
    np.testing.assert_allclose(position, [5.0, 0.0])
    np.testing.assert_allclose(angle, [0.5, 2.0])
    position, angle = task_map_of(scara, ["y"]).norms(np.array([[-3.0]]))
    np.testing.assert_array_equal([position, angle], [[3.0], [0.0]])


def test_a_map_survives_pickling(scara):
    space = task_map_of(scara, ["x", "y", "yaw"])
    again = pickle.loads(pickle.dumps(space))  # noqa: S301
    q = np.array([[0.3, -0.4, 0.5]])
    assert (again.rows, again.tool_axis) == (space.rows, space.tool_axis)
    np.testing.assert_allclose(again.twists(q), space.twists(q), atol=1e-14)


@pytest.mark.parametrize(
    "rows",
    [
        [],
        ["x", "x"],
        ["yaw"],
        ["x", "w"],
        ["x", "yaw"],
        ["yaw", "x", "y"],
        ["x", "yaw", "y"],
        ["x", "y", "z", "yaw"],
    ],
    ids=str,
)
def test_rows_that_make_no_sense(scara, rows):
    with pytest.raises(InputError, match="task_space") as caught:
        task_map_of(scara, rows)
    assert caught.value.found == rows


def test_yaw_without_a_tool_axis_in_the_plane():
    # The tilted plane holds none of the tool's axes within the world's xy-plane.
    robot = planar_robot("RRR", "tilted")
    in_plane = np.linalg.norm(robot.tool_placement(np.zeros(3)).rotation[:2], axis=0)
    assert not np.any(in_plane > 1.0 - 1e-6)
    with pytest.raises(InputError, match="yaw"):
        task_map_of(robot, ["x", "y", "yaw"])
