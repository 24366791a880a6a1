import math
import struct
import zipfile

import numpy as np
import pytest
import trimesh

from brachis.apps.view.bodies import link_shapes
from brachis.common.files import mesh_file
from support.shown import PANDA, ROBOTS

LINK = '<robot name="r"><link name="a"><visual><origin xyz="1 0 0"/><geometry>{}</geometry>{}</visual></link></robot>'
RED = '<material name="red"><color rgba="1 0 0 1"/></material>'


def shapes_of(geometry, folder):
    return link_shapes(LINK.format(geometry, ""), folder)


@pytest.mark.parametrize("urdf", ROBOTS, ids=lambda path: path.parent.name)
def test_every_shape_of_every_robot_is_read(urdf):
    text = urdf.read_text()
    shapes, unread = link_shapes(text, urdf.parent)
    assert unread == []
    assert sum(map(len, shapes.values())) == text.count("<visual>") > 0


@pytest.mark.skipif(not PANDA.exists(), reason="example-robot-data is not installed")
def test_meshes_of_a_package_are_found_beside_the_urdf():
    pytest.importorskip("collada", reason="pycollada is not installed")
    shapes, unread = link_shapes(PANDA.read_text(), PANDA.parent)
    assert unread == []
    assert {"panda_link0", "panda_hand", "panda_leftfinger"} <= set(shapes)
    assert 0.15 < np.ptp(shapes["panda_link5"][0].vertices, axis=0).max() < 0.5


def test_shapes_stand_where_the_urdf_has_them_in_their_colour():
    shapes, _ = link_shapes(LINK.format('<box size="0.2 0.4 0.6"/>', RED), None)
    (box,) = shapes["a"]
    np.testing.assert_allclose(box.bounds, [[0.9, -0.2, -0.3], [1.1, 0.2, 0.3]])
    assert tuple(box.visual.material.baseColorFactor) == (255, 0, 0, 255)


@pytest.mark.parametrize(
    "name",
    ["part.stl", "meshes/../part.stl", "package://cell/part.stl", "file://{}/part.stl"],
)
def test_mesh_files_of_every_form_of_name(name, tmp_path, monkeypatch):
    folder = tmp_path / "cell"
    (folder / "meshes").mkdir(parents=True)
    trimesh.creation.box((1.0, 2.0, 3.0)).export(folder / "part.stl")
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{tmp_path}")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    base = elsewhere if name.startswith("package") else folder
    assert mesh_file(name.format(folder), base).samefile(folder / "part.stl")
    mesh = f'<mesh filename="{name.format(folder)}" scale="2 2 2"/>'
    shapes, unread = shapes_of(mesh, folder)
    assert unread == []
    np.testing.assert_allclose(np.ptp(shapes["a"][0].vertices, axis=0), [2.0, 4.0, 6.0])


def test_a_missing_mesh_is_named_and_the_other_links_are_read(tmp_path):
    (tmp_path / "broken.stl").write_bytes(b"solid nonsense")
    text = (
        '<robot name="r">'
        '<link name="a"><visual><geometry><mesh filename="package://none/a.dae"/></geometry></visual></link>'
        '<link name="b"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>'
        '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>'
    )
    shapes, unread = link_shapes(text, tmp_path)
    assert list(shapes) == ["b"]
    assert unread == [
        "missing mesh files: package://none/a.dae; ROS_PACKAGE_PATH can name the folder of a package"
    ]


def test_many_missing_meshes_are_one_line(tmp_path):
    visual = '<visual><geometry><mesh filename="{}.stl"/></geometry></visual>'
    text = f'<robot name="r"><link name="a">{"".join(map(visual.format, range(14)))}</link></robot>'
    _, unread = link_shapes(text, tmp_path)
    (line,) = unread
    assert line.startswith("missing mesh files: 0.stl, 1.stl, 2.stl and 11 more; ")


@pytest.mark.skipif(not PANDA.exists(), reason="example-robot-data is not installed")
def test_packages_of_the_python_installation_are_found_from_anywhere(tmp_path):
    name = "package://example-robot-data/robots/panda_description/urdf/panda.urdf"
    assert mesh_file(name, tmp_path).samefile(PANDA)
    assert mesh_file(name + 5000 * "x", tmp_path) is None, (
        "longer than a name of a file can be"
    )


BROKEN = {
    "cut.dae": (b"<COLLADA><x", "DaeMalformedError"),
    "cut.zip": (b"PK\3\4", "BadZipFile"),
    "empty.stl": (b"", "no faces"),
    "nan.stl": (
        b"\0" * 80 + struct.pack("<I12fH", 1, *[math.nan] * 12, 0),
        "not finite",
    ),
    "packed.tar.gz": (b"\x1f\x8b", "compressed meshes cannot be read"),
    "a" * 5000 + ".stl": (None, "missing mesh files"),
}


@pytest.mark.parametrize("name", BROKEN, ids=lambda name: name[-12:])
def test_a_remark_names_a_broken_mesh(name, tmp_path):
    if name.endswith("dae"):
        pytest.importorskip("collada", reason="pycollada is not installed")
    content, reason = BROKEN[name]
    if content is not None:
        (tmp_path / name).write_bytes(content)
    shapes, unread = shapes_of(f'<mesh filename="{name}"/>', tmp_path)
    assert shapes == {}
    (line,) = unread
    assert reason in line
    assert len(line) <= 500


@pytest.mark.parametrize("packed", [False, True])
def test_meshes_that_are_too_large_are_told_and_not_read(packed, tmp_path):
    name = "large.zip" if packed else "large.stl"
    if packed:
        with zipfile.ZipFile(tmp_path / name, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("large.stl", bytes(200_000_001))
    else:
        with (tmp_path / name).open("wb") as stream:
            stream.truncate(4_000_000_000)  # takes no room
    shapes, unread = shapes_of(f'<mesh filename="{name}"/>', tmp_path)
    size = "200 MB" if packed else "4000 MB"
    words = (
        f"a: {name}: the mesh is too large to be shown; found {size}; allowed: 200 MB"
    )
    assert shapes == {}
    assert unread == [f"{words} for all meshes of the robot"]


def test_a_remark_names_a_broken_shape(tmp_path):
    _, (line,) = shapes_of('<box size="wide"/>', tmp_path)
    assert line.startswith("a: ValueError")
