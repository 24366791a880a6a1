"""Numbers of a URDF: each is checked where it stands, and the model weighs what the file says."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from brachis import LimitSpec
from brachis.errors import UrdfError
from brachis.robot import Robot
from brachis.robot.urdf_bodies import read_dynamics
from brachis.robot.urdf_elements import read_tree
from support.chains import INERTIAL, Joint, chain_urdf, planar_urdf

TURN = Joint("revolute", xyz=(0.4, 0.0, 0.0))
TEXT = chain_urdf(
    [TURN, Joint("revolute", xyz=(0.4, 0.0, 0.0), rpy=(0.1, 0.2, 0.3))],
    tool=(0.3, 0.0, 0.0),
    elements="<link name='aside'>" + INERTIAL.format(mass=1.5) + "</link>"
    "<joint name='flap' type='revolute'><parent link='link1'/><child link='aside'/><origin xyz='0.1 0.2 0.3'/>"
    "<axis xyz='0 1 1'/><limit lower='0.3' upper='0.9' effort='10' velocity='1'/></joint>",
)


def read(text, **options):
    return Robot.from_urdf("file.urdf", urdf_text=text, tool_frame="tool", **options)


def message_of(text):
    with pytest.raises(UrdfError) as caught:
        read(text, limits=LimitSpec(torque=1.0))
    return str(caught.value)


def replace_once(old, new, text=TEXT):
    assert old in text
    return text.replace(old, new, 1)


@pytest.mark.parametrize(
    "bad", ["nan", "inf", "-Infinity", "1e999", "", "1_0", "0x1", "five"]
)
@pytest.mark.parametrize(
    "old, new, words",
    [
        ('xyz="0.21 0.02 0.01"', 'xyz="0.21 {} 0.01"', "link 'link1': <origin xyz>"),
        ('rpy="0.1 0.2 0.3"', 'rpy="{} 0.2 0.3"', "link 'link1': <origin rpy>"),
        ('<mass value="2.0"/>', '<mass value="{}"/>', "link 'link1': <mass value>"),
        ('ixy="0.002"', 'ixy="{}"', "link 'link1': <inertia ixy>"),
        ("xyz='0.4 0.0 0.0'", "xyz='0.4 0.0 {}'", "joint 'j1': <origin xyz>"),
        (
            "<axis xyz='0.0 0.0 1.0'/>",
            "<axis xyz='0.0 {} 1.0'/>",
            "joint 'j1': <axis xyz>",
        ),
        ("velocity='3.0'", "velocity='{}'", "joint 'j1': <limit velocity>"),
        ("lower='0.3'", "lower='{}'", "joint 'flap': <limit lower>"),
        ('<mass value="1.5"/>', '<mass value="{}"/>', "link 'aside': <mass value>"),
    ],
)
def test_what_is_no_finite_number_is_refused_with_its_place(old, new, words, bad):
    message = message_of(replace_once(old, new.format(bad)))
    assert f"{words} is wrong" in message
    assert "file.urdf, line " in message


@pytest.mark.parametrize(
    "old, new, unit",
    [
        (
            'value="2.0"',
            'value="1,5"',
            "a finite number of at most 1e+12 in magnitude, kg",
        ),
        ('value="2.0"', 'value="1e13"', "at most 1e+12 in magnitude, kg"),
        ("effort='60.0'", "effort='10Nm'", "a finite number, Nm or N"),
        ("<axis xyz='0.0 0.0 1.0'/>", "<axis xyz='0, 0, 1'/>", "3 finite numbers"),
        (
            "xyz='0.4 0.0 0.0'",
            "xyz='0.4m 0.0m 0.0m'",
            "3 finite numbers separated by spaces of at most 1e+12 in magnitude, m",
        ),
    ],
)
def test_the_message_says_what_to_write_instead(old, new, unit):
    message = message_of(replace_once(old, new))
    assert unit in message
    assert message.endswith(
        "Write numbers with decimal points, spaces between them, and no units"
    )


def test_missing_and_repeated_figures():
    assert "link 'link1': <mass value> is missing" in message_of(
        replace_once('<mass value="2.0"/>', "<mass/>")
    )
    assert "link 'link1': <inertia izz> is missing" in message_of(
        replace_once('izz="0.055"', "")
    )
    assert "link 'link1': <mass> occurs twice" in message_of(
        replace_once("<mass", '<mass value="1"/><mass')
    )
    assert "3 finite numbers" in message_of(
        replace_once("xyz='0.4 0.0 0.0'", "xyz='0.4 0.0'")
    )


def test_numbers_that_do_not_count_are_not_read():
    plugin = "<gazebo reference='base'><kp>a lot</kp></gazebo><transmission name='t'><joint name='j1'/></transmission>"
    shape = "<link name='base'><visual><origin xyz='1,5'/><geometry><box size='big'/></geometry></visual>"
    text = replace_once("<link name='base'/>", f"{plugin}{shape}</link>")
    assert read(text).n == 2


@pytest.mark.parametrize(
    "text",
    [TEXT, planar_urdf("RPC", "tilted")],
)
def test_bodies_summed_up_from_the_file_are_those_of_the_model(text):
    robot = read(text)
    bodies = read_dynamics(
        read_tree(text, "file.urdf"), robot.joint_names, {"flap": 0.3}, "tool"
    ).bodies
    assert [body.joint for body in bodies] == list(robot.joint_names)
    for body, inertia in zip(bodies, list(robot.model.inertias)[1:], strict=True):
        assert body.mass == pytest.approx(inertia.mass, rel=1e-14)
        assert_allclose(body.com, inertia.lever, atol=1e-14)
        assert_allclose(body.inertia, inertia.inertia, atol=1e-14)
    if text is TEXT:
        assert bodies[0].links == ("link1", "aside")
        assert bodies[0].mass == 3.5
        # The held flap counts where it is held: another position is another body.
        moved = read_dynamics(
            read_tree(text, "file.urdf"), robot.joint_names, {"flap": 0.4}, "tool"
        ).bodies
        assert np.abs(moved[0].com - bodies[0].com).max() > 1e-3


def test_long_chains_are_summed_up_without_recursion():
    links = "".join(f"<link name='l{i}'/>" for i in range(3000))
    joints = "".join(
        f"<joint name='f{i}' type='fixed'><parent link='l{i}'/><child link='l{i + 1}'/></joint>"
        for i in range(2999)
    )
    tree = read_tree(f"<robot name='long'>{links}{joints}</robot>", "file.urdf")
    assert read_dynamics(tree, (), {}, tree.root).bodies == ()


def test_the_error_names_ghost_links():
    message = message_of(
        replace_once("<parent link='link1'/>", "<parent link='ghost'/>")
    )
    words = "the parent of joint 'j2' is not a link of the robot; found"
    assert f"{words} ghost; allowed: world, base, " in message
    assert message.endswith("Add <link name='ghost'/>")
    assert "Did you mean 'link1'?" in message_of(
        replace_once("<parent link='link1'/>", "<parent link='lnik1'/>")
    )
    assert "the child of joint 'j2' is not a link of the robot" in message_of(
        replace_once("<child link='link2'/>", "<child link='ghost'/>")
    )
    message = message_of(replace_once("<parent link='link1'/>", ""))
    assert f"{words} no name" in message


def test_the_error_names_xacro():
    include = '<xacro:include filename="$(find arm)/arm.xacro"/>'
    declared = replace_once(
        "<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" '
    )
    assert read(declared).n == 2
    for text in (
        replace_once("</robot>", include + "</robot>", declared),
        replace_once("</robot>", include + "</robot>"),
    ):
        message = message_of(text)
        assert "xacro" in message
        assert "include" in message
        assert message.endswith(
            "Expand the file with xacro first: xacro robot.xacro > robot.urdf"
        )
    message = message_of(replace_once('<mass value="2.0"/>', '<mass value="${mass}"/>'))
    assert "link 'link1': the URDF has xacro macros; found ${mass}" in message


@pytest.mark.parametrize(
    "old, new, words",
    [
        (
            "<link name='link2'>",
            "<link name='link1'>",
            "links have the same name; found link1",
        ),
        ("<joint name='j2'", "<joint name='j1'", "joints have the same name; found j1"),
        ("<link name='link2'>", "<link>", "a <link> has no name"),
        (
            "type='revolute'",
            "type='revolut'",
            "joint 'j1' has an unknown type; found revolut",
        ),
        ("type='revolute'", "", "joint 'j1' has an unknown type; found none"),
        (
            "<child link='link2'/>",
            "<child link='link1'/>",
            "link 'link1' is the child of two joints, 'j1' and 'j2'",
        ),
    ],
)
def test_names_and_types(old, new, words):
    assert words in message_of(replace_once(old, new))


@pytest.mark.parametrize("name", ["tool_mount", "mount", "flap", "j2"])
def test_joints_may_have_the_names_of_links_elsewhere(name):
    robot = read(replace_once(f"name='{name}'", "name='aside'"))
    expected = [inertia.mass for inertia in read(TEXT).model.inertias]
    assert [inertia.mass for inertia in robot.model.inertias] == expected


def test_a_joint_with_the_name_of_the_world_is_an_error():
    message = message_of(replace_once("name='j1'", "name='universe'"))
    assert "'universe'" in message
    assert "Rename the joint" in message


@pytest.mark.parametrize("link", ["base", "link1", "tool"])
def test_joints_and_links_may_share_their_names(link):
    text = TEXT.replace("name='j1'", f"name='{link}'")
    robot = read(text)
    q = np.array([0.3, -0.4])
    expected = read(TEXT).tool_placement(q)
    assert robot.tool_placement(q).isApprox(expected, 1e-14)
    locked = read(text, locked_joints={robot.joint_names[0]: 0.3})
    assert locked.tool_placement(q[1:]).isApprox(expected, 1e-14)
