"""What happens to the arm's own URDF: names, mesh files, and what yourdfpy does not know."""

from pathlib import Path

import pytest
from lxml import etree

from brachis import InputError, Robot
from brachis.apps.compose import Rail, on_rail
from brachis.common.files import mesh_file

from .conftest import RAIL, arm_text

MESHES = """
<link name='cover'>
  <visual><geometry><mesh filename='meshes/a.stl' scale='0.001 0.001 0.001'/></geometry>
    <material name='wood'><texture filename='../wood.png'/></material></visual>
  <visual><geometry><mesh filename='package://arm_description/b.dae'/></geometry></visual>
  <visual><geometry><mesh filename='/opt/c.dae'/></geometry></visual>
  <visual><geometry><box size='1 2 3'/></geometry></visual>
  <collision><geometry><mesh filename='./meshes/../d.stl'/></geometry></collision>
  <collision><geometry><sphere radius='0.1'/></geometry></collision>
</link>
<joint name='cover_mount' type='fixed'><parent link='tool'/><child link='cover'/></joint>
"""
OTHER = """
<!-- a remark -->
<material name='grey'><color rgba='1 0 0 1'/></material>
<link name='finger'/>
<joint name='grip' type='revolute'><parent link='tool'/><child link='finger'/><axis xyz='0 0 1'/>
  <limit lower='0' upper='1.23456789012345678' effort='1' velocity='1'/><mimic joint='j3' multiplier='2'/>
  <safety_controller k_velocity='3'/><dynamics damping='0.5'/></joint>
<transmission name='t1'><type>transmission_interface/SimpleTransmission</type><joint name='j1'/></transmission>
<gazebo reference='world'><static>true</static></gazebo>
<gazebo reference='link1'><mu1>0.2</mu1></gazebo>
<ros2_control name='arm' type='system'><joint name='j1'/></ros2_control>
"""


def parse(text):
    return etree.fromstring(text.encode())


def files(text):
    return [each.get("filename") for each in parse(text).iter("mesh", "texture")]


@pytest.fixture
def arm_with_meshes(arm):
    arm.write_text(arm_text(elements=MESHES))
    return arm


@pytest.mark.parametrize("folder", [".", "arm", "elsewhere/deep", "link"])
def test_relative_meshes_are_found_from_the_new_file(arm_with_meshes, tmp_path, folder):
    (tmp_path / "elsewhere/deep").mkdir(parents=True)
    (tmp_path / "link").symlink_to("elsewhere/deep")
    output = tmp_path / folder / "new.urdf"
    text = on_rail(arm_with_meshes, Rail(**RAIL), output=output)
    assert output.read_text() == text
    a, wood, package, absolute, d = files(text)
    assert (package, absolute) == ("package://arm_description/b.dae", "/opt/c.dae")
    for name, expected in (
        (a, "arm/meshes/a.stl"),
        (wood, "wood.png"),
        (d, "arm/d.stl"),
    ):
        assert not Path(name).is_absolute()
        assert (output.parent.resolve() / name).resolve() == (
            tmp_path / expected
        ).resolve()


@pytest.mark.parametrize("ros", [False, True])
def test_meshes_of_a_package_are_found_from_another_folder(
    arm_with_meshes, tmp_path, monkeypatch, ros
):
    (tmp_path / "arm_description").mkdir()
    (tmp_path / "arm_description/b.dae").touch()
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path) if ros else "")
    output = tmp_path / "elsewhere/new.urdf"
    output.parent.mkdir()
    package = files(on_rail(arm_with_meshes, Rail(**RAIL), output=output))[2]
    assert (package == "package://arm_description/b.dae") == ros
    file = mesh_file(package, output.parent)
    assert file.samefile(tmp_path / "arm_description/b.dae")


def test_relative_meshes_become_absolute_without_a_file(
    arm_with_meshes, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    a, wood, *_, d = files(on_rail(arm_with_meshes.relative_to(tmp_path), Rail(**RAIL)))
    assert [a, wood, d] == [
        str(tmp_path.resolve() / name)
        for name in ("arm/meshes/a.stl", "wood.png", "arm/d.stl")
    ]


def test_a_composed_robot_may_have_no_meshes(arm_with_meshes):
    text = on_rail(arm_with_meshes, Rail(**RAIL), meshes=False)
    assert files(text) == []
    cover = parse(text).find("link[@name='cover']")
    shapes = [each.find("geometry")[0].tag for each in cover]
    assert shapes == ["box", "sphere"]
    assert files(on_rail(arm_with_meshes, Rail(**RAIL))) != []


def test_the_rest_of_the_arm_is_kept_as_written(arm):
    arm.write_text(arm_text(elements=OTHER))
    robot = parse(on_rail(arm, Rail(**RAIL)))
    before = parse(arm.read_text())
    assert robot.get("name") == "chain_rail"
    for place in (
        "transmission",
        "ros2_control",
        "material",
        "gazebo[@reference='link1']",
        "joint[@name='grip']",
    ):
        elements = (tree.find(place) for tree in (robot, before))
        texts = [etree.tostring(element, method="c14n") for element in elements]
        assert b"".join(texts[0].split()) == b"".join(texts[1].split())
    assert [comment.text for comment in robot.iter(etree.Comment)] == [" a remark "]
    # The arm's own world has become the frame that stands on the carriage.
    references = [element.get("reference") for element in robot.findall("gazebo")]
    assert references == ["rail_base", "link1"]
    assert robot.find("joint[@name='mount']/parent").get("link") == "rail_base"
    assert robot.find("joint[@name='rail_mount']/child").get("link") == "rail_base"


def test_root_link_with_a_name_of_its_own_keeps_it(arm):
    text = arm_text().replace("<robot name='chain'>", "<robot>")
    arm.write_text(text.replace("'world'", "'stand'"))
    robot = parse(on_rail(arm, Rail(**RAIL)))
    assert robot.get("name") == "arm_rail", "that of its file"
    links = {link_element.get("name") for link_element in robot.findall("link")}
    assert {"world", "rail_carriage", "stand"} <= links
    assert robot.find("joint[@name='rail_mount']/child").get("link") == "stand"


def test_text_in_other_scripts(arm):
    declared = '<?xml version="1.0" encoding="utf-8"?>\n<!-- Größe, 大きさ -->\n'
    arm.write_text(declared + arm_text(), encoding="utf-8")
    output = arm.with_name("new.urdf")
    on_rail(arm, Rail(**RAIL), output=output)
    assert "<!-- Größe, 大きさ -->\n<robot" in output.read_text(encoding="utf-8")
    assert Robot.from_urdf(output).n == 4


CLASHES = {
    "joint": ("j2", "rail", {}, "name"),
    "joint called as a link": ("j2", "rail_carriage", {}, "name"),
    "link": ("link2", "rail_mount", {}, "name"),
    "new name of the root link": ("link2", "rail_base", {}, "name"),
    "root": ("base", "floor", {"root": "floor"}, "root"),
    "name taken from the arm": ("j2", "j2", {"name": "j3"}, "name"),
    "both new names": ("j2", "j2", {"name": "slide", "root": "slide"}, "name"),
}


@pytest.mark.parametrize("case", CLASHES)
def test_name_clash_names_its_cure(arm, case):
    old, new, options, parameter = CLASHES[case]
    arm.write_text(arm_text().replace(f"'{old}'", f"'{new}'"))
    with pytest.raises(InputError) as caught:
        on_rail(arm, Rail(**RAIL, **options))
    assert caught.value.where == parameter
    assert f"Choose another {parameter}" in str(caught.value)
    if old != new:
        assert f"'{new}'" in str(caught.value)
        assert str(arm) in str(caught.value)
    cure = {parameter: "unlike"}
    text = on_rail(arm, Rail(**RAIL, **(options | cure)))
    assert Robot.from_urdf("cured", urdf_text=text).n == 4
