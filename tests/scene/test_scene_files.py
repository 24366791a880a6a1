"""Scenes from files and from Python, meshes, SRDF; what inspect and the viewer show of them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose

import brachis
from brachis.errors import InputError, TaskError
from brachis.problem.task_plausibility import of_task
from brachis.robot.from_task import robot_for
from brachis.scene import scene_of
from support.command_line import code_of, interrupts_kept
from support.motions import motion_between

IIWA = Path(__file__).parents[2] / "robots/iiwa14/robot.urdf"
TASK = {
    "brachis": 1,
    "robot": {"urdf": str(IIWA)},
    "start": {"joints": [-0.4, 0.7, 0.0, -1.2, 0.0, 1.0, 0.0]},
    "task_space": "pose",
    "path": [{"line": {"by": [0, 0.2, 0]}}],
}
TETRAHEDRON = """solid t
facet normal 0 0 -1
outer loop
vertex 0 0 0
vertex 0 100 0
vertex 100 0 0
endloop
endfacet
facet normal 0 -1 0
outer loop
vertex 0 0 0
vertex 100 0 0
vertex 0 0 100
endloop
endfacet
facet normal -1 0 0
outer loop
vertex 0 0 0
vertex 0 0 100
vertex 0 100 0
endloop
endfacet
facet normal 1 1 1
outer loop
vertex 100 0 0
vertex 0 100 0
vertex 0 0 100
endloop
endfacet
endsolid t
"""


CELL = """<robot name="cell">
<link name="world"/>
<link name="table"><collision><origin xyz="0 0 -0.05"/><geometry><box size="1 0.6 0.1"/></geometry></collision></link>
<link name="post"><collision><geometry><cylinder radius="0.05" length="1.2"/></geometry></collision></link>
<joint name="a" type="fixed"><parent link="world"/><child link="table"/><origin xyz="0.5 0 0.4"/></joint>
<joint name="b" type="fixed"><parent link="table"/><child link="post"/><origin xyz="0 0.25 0.6" rpy="0 1.57079633 0"/>
</joint>
</robot>
"""


def scene_of_task(task):
    return scene_of(robot_for(None, task.robot), task)


def write(folder, name, content):
    file = folder / name
    text = content if isinstance(content, str) else yaml.safe_dump(content)
    file.write_text(text)
    return file


def test_bodies_in_python_are_those_of_a_file(tmp_path):
    text = """
    brachis_scene: 1
    bodies:
    - {box: [0.1, 0.1, 1.2], position: [0.5, 0.2, 0.6], rpy_deg: [0, 0, 30]}
    - {name: ball, sphere: 0.04, position: [0.4, 0.2, 0.5]}
    - {name: torch, capsule: {radius: 0.03, length: 0.3}, link: tool}
    - {name: drum, cylinder: {radius: 0.3, length: 0.1}}
    - {name: floor, half_space: {normal: [0, 0, 1], offset: -0.1}}
    """
    write(tmp_path, "cell.yaml", text)
    file = write(tmp_path, "task.yaml", {**TASK, "scene": {"file": "cell.yaml"}})
    in_file = brachis.load_task(file).scene
    in_python = [
        brachis.Box([0.1, 0.1, 1.2], position=[0.5, 0.2, 0.6], rpy_deg=[0, 0, 30]),
        brachis.Sphere(0.04, name="ball", position=np.array([0.4, 0.2, 0.5])),
        brachis.Capsule(0.03, 0.3, name="torch", link="tool"),
        brachis.Cylinder(0.3, 0.1, name="drum"),
        brachis.HalfSpace([0, 0, 1], -0.1, name="floor"),
    ]
    assert in_file == brachis.load_task({**TASK, "scene": in_python}).scene
    assert in_file[0].name == "box 0"
    again = brachis.load_task(brachis.load_task(file).to_dict())
    assert again.scene == in_file


def test_a_mesh_is_its_hull_and_its_file_is_beside_the_scene(tmp_path):
    (tmp_path / "cell").mkdir()
    write(tmp_path / "cell", "body.stl", TETRAHEDRON)
    body = {"name": "body", "mesh": "body.stl", "scale": 0.001, "position": [1, 0, 0]}
    write(tmp_path / "cell", "cell.yaml", {"brachis_scene": 1, "bodies": [body]})
    file = write(tmp_path, "task.yaml", {**TASK, "scene": {"file": "cell/cell.yaml"}})
    task = brachis.load_task(file)
    assert Path(task.scene[0].mesh) == tmp_path / "cell/body.stl"
    solid = scene_of_task(task).solids[-1]
    corners = np.array(solid.geometry.points())
    assert sorted(corners.round(6).tolist()) == [
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.1],
        [0.0, 0.1, 0.0],
        [0.1, 0.0, 0.0],
    ]


def test_an_srdf_disables_pairs(tmp_path):
    write(
        tmp_path,
        "arm.srdf",
        '<robot><disable_collisions link1="link_2" link2="link_5" reason="Never"/></robot>',
    )
    ball = [{"sphere": 0.1, "position": [2, 0, 0]}]
    file = write(
        tmp_path,
        "task.yaml",
        {**TASK, "scene": ball, "collisions": {"srdf": "arm.srdf"}},
    )
    scene = scene_of_task(brachis.load_task(file))
    names = {scene.names(pair) for pair in range(len(scene.pairs))}
    assert "link_2 and link_5 0" not in names
    assert "link_2 and link_6" in names


@pytest.mark.parametrize(
    "scene, says",
    [
        ({"fil": "cell.yaml"}, r"allowed: a list.*file: cell.yaml"),
        ({"file": "absent.yaml"}, r"absent.yaml"),
        ([{"bx": [1, 1, 1]}], r"scene\[0\].*bx"),
        ([{"name": "a", "sphere": "1"}], r"scene\[0\].sphere.*a number"),
    ],
)
def test_a_wrong_scene_is_an_error(scene, says):
    with pytest.raises(TaskError, match=says):
        brachis.load_task({**TASK, "scene": scene})


@pytest.mark.parametrize(
    "changes, where",
    [
        ("scene: [{name: post, box: [100, 100, 1200]}]", "scene: post"),
        ("scene: [{name: a, sphere: 0.1, position: [400, 0, 0]}]", "scene: a"),
        ("collisions: {clearance: 10.0}", "collisions.clearance"),
        ("collisions: {padding: {link_6: 20.0}}", "collisions.padding.link_6"),
    ],
)
def test_lengths_that_look_like_mm_are_implausible(changes, where):
    issues = of_task(brachis.load_task({**TASK, **yaml.safe_load(changes)}))
    assert [issue.where for issue in issues] == [where]
    assert "mm" in issues[0].message


def test_without_a_scene_the_mode_decides_about_self_collisions():
    assert scene_of_task(brachis.load_task(TASK)) is None
    assert (
        scene_of_task(brachis.load_task({**TASK, "collisions": {"clearance": 0.02}}))
        is None
    )
    scene = scene_of_task(brachis.load_task({**TASK, "collisions": {"mode": "avoid"}}))
    assert {solid.link for solid in scene.solids} >= {"link_0", "link_7"}
    body = brachis.Sphere(0.1, position=[2, 0, 0])
    task = brachis.load_task({**TASK, "scene": body})
    assert scene_of_task(task).solids[-1].name == "sphere 0"
    off = brachis.load_task({**TASK, "scene": body, "collisions": {"mode": "off"}})
    assert scene_of_task(off) is None


def test_inspect_lists_pairs_and_json_has_all(tmp_path, capfd):
    ball = [{"name": "ball", "sphere": 0.1, "position": [2, 0, 0]}]
    file = write(tmp_path, "task.yaml", {**TASK, "scene": ball})
    with interrupts_kept():
        assert code_of("inspect", file) == 0
        assert "pairs that may collide" in capfd.readouterr().out
        assert code_of("inspect", file, "--json") == 0
    data = json.loads(capfd.readouterr().out)
    assert "link_7 and ball" in data["collisions"]["pairs"]
    assert data["collisions"]["solids"][-1] == "ball"


def test_the_viewer_draws_the_bodies_where_they_are(line_trajectory):
    trimesh = pytest.importorskip("trimesh")
    from brachis.apps.view.bodies import scene_meshes

    scene = [
        brachis.Box([0.2, 0.4, 0.6], position=[1, 0, 0], name="box"),
        brachis.Capsule(0.1, 0.2, link="tool", position=[0, 0, 0.3], name="rod"),
        brachis.HalfSpace([0, 0, 1], -0.5, name="floor"),
    ]
    q = np.array([TASK["start"]["joints"]] * 2)
    motion = motion_between(line_trajectory, brachis.robots.iiwa14, q)
    task = brachis.load_task({**TASK, "scene": scene})
    meshes = scene_meshes(replace(motion, task=task), task.scene)
    assert {joint: len(solids) for joint, solids in meshes.items()} == {0: 2, 7: 1}
    box, floor = meshes[0]
    assert isinstance(box, trimesh.Trimesh)
    assert_allclose(box.bounds, [[0.9, -0.2, -0.3], [1.1, 0.2, 0.3]])
    assert floor.bounds[1, 2] == pytest.approx(-0.5)
    # The tool is 45 mm in front of joint 7.
    (rod,) = meshes[7]
    assert_allclose(rod.bounds.mean(axis=0), [0, 0, 0.345], atol=1e-6)
    assert_allclose(np.ptp(rod.bounds, axis=0), [0.2, 0.2, 0.4], atol=2e-3)


def test_a_cell_is_read_from_a_urdf(tmp_path):
    (tmp_path / "cell.urdf").write_text(CELL)
    cell = {"name": "cell", "urdf": "cell.urdf", "position": [0.1, 0.0, 0.0]}
    (tmp_path / "task.yaml").write_text(yaml.safe_dump({**TASK, "scene": [cell]}))
    task = brachis.load_task(tmp_path / "task.yaml")
    scene = scene_of(robot_for(None, task.robot), task)
    placed = {
        solid.name: placement
        for solid, placement in zip(scene.solids, scene.placements, strict=True)
    }
    assert_allclose(placed["cell: table"][:3, 3], [0.6, 0.0, 0.35])
    assert_allclose(placed["cell: post"][:3, 3], [0.6, 0.25, 1.0])
    assert_allclose(placed["cell: post"][:3, 2], [1.0, 0.0, 0.0], atol=1e-7)
    assert [solid.name for solid in scene.solids[scene.robot_count :]] == [
        "cell: table",
        "cell: post",
    ]


@pytest.mark.parametrize(
    "text, message",
    [
        (
            CELL.replace('"b" type="fixed"', '"b" type="revolute"'),
            "joint 'b' of type revolute",
        ),
        (CELL.replace("radius", "thickness"), "<cylinder> is wrong"),
        ("robot: 1", "not a URDF"),
        ("<robot name='c'><link name='world'/></robot>", "no collision geometry"),
        (None, "cell.urdf"),
    ],
)
def test_a_urdf_that_is_no_cell_is_an_error(tmp_path, text, message):
    if text is not None:
        (tmp_path / "cell.urdf").write_text(text)
    cell = {"name": "cell", "urdf": str(tmp_path / "cell.urdf")}
    task = brachis.load_task({**TASK, "scene": [cell]})
    with pytest.raises(brachis.BrachisError, match=message):
        scene_of(robot_for(None, task.robot), task)


def scene_with(**keys):
    task = brachis.load_task({**TASK, **keys})
    return scene_of(robot_for(None, task.robot), task)


@pytest.mark.parametrize(
    "keys",
    [
        "scene: [{box: [0.1, 1.0e+300, 0.1]}]",
        "scene: [{sphere: 1.0e+300}]",
        "scene: [{cylinder: {radius: 0.1, length: 1.0e+300}}]",
        "scene: [{mesh: body.stl, scale: 1.0e+300}]",
        "scene: [{half_space: {normal: [0, 0, 1], offset: 1.0e+300}}]",
        "scene: [{sphere: 0.1, position: [0, 0, 1.0e+300]}]",
        "collisions: {clearance: 1.0e+300}",
        "collisions: {padding: {link_3: 1.0e+300}}",
        "robot: {payload: {mass: 1.0e+300}}",
    ],
)
def test_lengths_and_masses_whose_squares_overflow_are_errors(keys):
    with pytest.raises(TaskError, match=r"out of range; found 1e\+300; allowed: <= 1e"):
        brachis.load_task({**TASK, **yaml.safe_load(keys)})


@pytest.mark.parametrize(
    "body",
    [
        "box: [0.1, 100000.0, 0.1]",
        "sphere: 100000.0",
        "capsule: {radius: 0.1, length: 100000.0}",
        "{mesh: body.stl, scale: 100000.0}",
        "urdf: cell.urdf",
    ],
)
def test_bodies_that_are_too_large_for_exact_distances_are_errors(
    body, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "body.stl").write_text(TETRAHEDRON)
    box = '<geometry><box size="1 1 1e300"/></geometry>'
    cell = f'<link name="cell"><collision>{box}</collision></link>'
    (tmp_path / "cell.urdf").write_text(f'<robot name="cell">{cell}</robot>')
    with pytest.raises(InputError, match=r"too large .*allowed: at most 10000 m"):
        scene_with(scene=[yaml.safe_load(body)])


def test_padding_that_makes_a_link_too_large_is_an_error():
    names = brachis.robots.iiwa14.urdf_dynamics.links
    link = next(name for name in names if name.endswith("3"))
    with pytest.raises(InputError, match=f"{link}.*: the body is too large"):
        scene_with(collisions={"mode": "avoid", "padding": {link: 1e6}})


def test_a_mesh_file_is_not_read_if_it_is_too_large(tmp_path):
    file = tmp_path / "sparse.stl"
    with file.open("wb") as stream:
        stream.truncate(4_000_000_000)
    with pytest.raises(TaskError, match=r"found 4000 MB; allowed: at most 32 MB"):
        scene_with(scene=[{"mesh": str(file)}])


@pytest.mark.parametrize(
    "count, what", [(1650, "pairs to keep apart"), (4001, "bodies")]
)
def test_more_bodies_than_a_plan_has_memory_for_are_errors(count, what):
    bodies = [{"sphere": 0.01, "position": [4.0, 0.0, 0.01 * i]} for i in range(count)]
    with pytest.raises(
        InputError, match=rf"too many bodies; .*at most 4000 {what}\. Leave"
    ):
        scene_with(scene=bodies)
