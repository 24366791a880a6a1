"""Bodies in frames: where they are, by Pinocchio, also after a sweep of the frame and with frames in frames."""

import jsonschema
import numpy as np
import pinocchio as pin
import pytest
import yaml
from numpy.testing import assert_allclose

import brachis
from brachis.errors import TaskError
from brachis.robot.from_task import robot_from_settings
from brachis.scene import scene_of
from brachis.scene.chain import Chain
from brachis.task import json_schema, load_task

TABLE = {"xyz": [0.5, -0.2, 0.3], "rpy_deg": [20.0, -35.0, 110.0]}
USER = {"xyz": [0.1, 0.05, -0.02], "rpy_deg": [0.0, 90.0, 30.0], "frame": "table"}
CLAMP = {"xyz": [0.03, 0.02, 0.01], "rpy_deg": [5.0, 6.0, 7.0]}
START = [-0.4, 0.7, 0.0, -1.2, 0.0, 1.0, 0.0]
CELL = """<robot name="cell"><link name="top"><collision><origin xyz="0 0 0.1"/><geometry><box size="1 1 0.02"/>
</geometry></collision></link></robot>"""


def transform(place):
    turn = pin.rpy.rpyToMatrix(*np.radians(place.get("rpy_deg", [0, 0, 0])))
    return pin.SE3(turn, np.array(place["xyz"], dtype=float))


def task(**keys):
    content = yaml.safe_load("""
    brachis: 1
    robot: {urdf: iiwa14}
    start: {joints: [-0.4, 0.7, 0.0, -1.2, 0.0, 1.0, 0.0]}
    task_space: pose
    collisions: {self_collision: false}
    path: [{line: {by: [0.0, 0.1, 0.0]}}]
    """)
    clamp = brachis.Box(
        [0.1, 0.05, 0.04],
        name="clamp",
        frame="user1",
        position=CLAMP["xyz"],
        rpy_deg=CLAMP["rpy_deg"],
    )
    content |= {"frames": {"table": TABLE, "user1": USER}, "scene": [clamp]}
    changes = keys.pop("changes", None)
    return load_task(content | keys, changes=changes)


def scene(of):
    found = scene_of(robot_from_settings(of.robot), of)
    assert found is not None
    return found


def clearance(of):
    chain = Chain.of(robot_from_settings(of.robot).model)
    closest = scene(of).find_closest(chain.place(np.array([START])))
    return float(closest.distance[0])


@pytest.mark.parametrize("x", [0.5, 0.72, -0.3])
def test_a_body_moves_with_its_frame(x):
    table = {**TABLE, "xyz": [x, -0.2, 0.3]}
    expected = transform(table) * transform(USER) * transform(CLAMP)
    for moved in (
        task(changes={"frames.table.xyz": table["xyz"]}),
        load_task(task(), changes={"frames.table.xyz": table["xyz"]}),
        load_task(task(frames={"table": table, "user1": USER}).to_dict()),
    ):
        placed = scene(moved).placements[-1]
        assert_allclose(placed, expected.homogeneous, atol=1e-12)


def test_the_plane_of_a_half_space_is_in_its_frame():
    plane = brachis.HalfSpace([0.0, 0.6, 0.8], offset=0.1, frame="user1")
    solid = scene(task(scene=[plane])).solids[-1]
    frame = transform(TABLE) * transform(USER)
    point = frame.act(0.1 * np.array([0.0, 0.6, 0.8]))
    normal = frame.rotation @ [0.0, 0.6, 0.8]
    assert_allclose(solid.geometry.n, normal, atol=1e-12)
    assert solid.geometry.d == pytest.approx(normal @ point, abs=1e-12)


def test_the_clearance_stays_where_robot_and_frame_move_together():
    """And changes where only one of them moves."""
    mounting = {"xyz": [0.3, -0.1, 0.2], "rpy_deg": [0.0, 0.0, 40.0]}
    table = transform(mounting) * transform(TABLE)
    robot = {"urdf": "iiwa14", "mounting": mounting}
    plain = clearance(task())
    both = task(robot=robot, frames={"table": table, "user1": USER})
    assert plain > 0.05
    assert clearance(both) == pytest.approx(plain, abs=1e-7)
    assert abs(clearance(task(robot=robot)) - plain) > 0.01


def test_a_cell_from_a_file_stands_in_a_frame(tmp_path):
    (tmp_path / "cell.urdf").write_text(CELL)
    (tmp_path / "cell.yaml").write_text(
        "brachis_scene: 1\nbodies:\n"
        "  - {name: cell, urdf: cell.urdf, position: [0.0, 0.0, 0.2]}\n"
        "  - {name: post, sphere: 0.05, frame: table}\n"
        "  - {name: torch, sphere: 0.02, link: tool}\n"
    )
    of = {"file": str(tmp_path / "cell.yaml"), "frame": "user1"}
    jsonschema.validate({**task().to_dict(), "scene": of}, json_schema())
    found = scene(task(scene=of))
    cell, post, _ = found.placements[found.robot_count :]
    user = transform(TABLE) * transform(USER)
    top = user * transform({"xyz": [0, 0, 0.3]})
    assert_allclose(cell, top.homogeneous, atol=1e-12)
    assert_allclose(post, transform(TABLE).homogeneous, atol=1e-12)
    assert found.solids[-1].link == "tool"


@pytest.mark.parametrize(
    "keys, message",
    [
        (
            "frames: {table: {xyz: [0.5, -0.2, 0.3], rpy_deg: [20.0, -35.0, 110.0]}}",
            r"scene\[0\]\.frame: this frame is not defined in frames; found 'user1' .*allowed: table",
        ),
        (
            "frames: {user1: {frame: tabel}, table: {xyz: [0.5, -0.2, 0.3], rpy_deg: [20.0, -35.0, 110.0]}}",
            r"frames\.user1\.frame: this frame is not defined .*'tabel' .*allowed: user1, table",
        ),
        (
            "frames: {a: {frame: user1}, user1: {frame: a}}",
            r"frames\.a\.frame: the frame is placed in itself; found 'a in user1 in a'",
        ),
        (
            "scene: [{sphere: 0.1, frame: user1, link: tool}]",
            r"scene\[0\]\.frame: .*frame of its link.*allowed: either link or frame",
        ),
        (
            "scene: {file: cell.yaml, frames: user1}",
            "scene: frames: unknown key; .*allowed: file, frame",
        ),
    ],
)
def test_the_error_names_what_is_wrong(keys, message):
    with pytest.raises(TaskError, match=message):
        task(**yaml.safe_load(keys))
