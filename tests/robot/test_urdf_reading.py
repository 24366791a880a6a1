"""URDF to chain: what is read, what is locked, and what is refused in which words."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis import LimitSpec
from brachis.errors import (
    InputError,
    LimitError,
    TaskError,
    UnknownNameError,
    UrdfError,
)
from brachis.problem.plausibility import of_robot
from brachis.robot import Robot
from brachis.robot.dynamics import torque
from brachis.robot.urdf import DefaultChain, default_chain
from brachis.task import RobotKeywords, RobotSettings
from brachis.verify.mechanics import torques
from support.chains import INERTIAL, Joint, chain_urdf, planar_robot, planar_urdf

TURN = Joint("revolute", xyz=(0.4, 0.0, 0.0))
GRIPPER = """
<link name='palm'/><link name='finger1'>{inertial}</link><link name='finger2'>{inertial}</link>
<joint name='palm_mount' type='fixed'><parent link='tool'/><child link='palm'/></joint>
<joint name='finger' type='prismatic'><parent link='palm'/><child link='finger1'/><axis xyz='0 1 0'/>
  <limit lower='0.02' upper='0.05' effort='1' velocity='1'/></joint>
<joint name='follower' type='prismatic'><parent link='palm'/><child link='finger2'/><axis xyz='0 -1 0'/>
  <limit lower='0' upper='0.05' effort='1' velocity='1'/><mimic joint='finger'/></joint>
""".replace("{inertial}", INERTIAL.format(mass=0.5))


def load(joints, **options):
    elements = options.pop("elements", "")
    return Robot.from_urdf(
        "file.urdf",
        urdf_text=chain_urdf(joints, tool=(0.3, 0.0, 0.0), elements=elements),
        **options,
    )


def test_forward_kinematics_are_those_of_the_file():
    # Pinocchio reads the same text by itself; the continuous joint there has cosine and sine.
    text = planar_urdf("RPC", "tilted")
    robot = Robot.from_urdf("file.urdf", urdf_text=text)
    model = pin.buildModelFromXML(text)
    assert (model.nq, model.nv) == (4, 3)
    data, frame = model.createData(), model.getFrameId("tool")
    for q in np.random.default_rng(0).uniform(-3.0, 3.0, (20, 3)):
        full = np.array([q[0], q[1], np.cos(q[2]), np.sin(q[2])])
        pin.framesForwardKinematics(model, data, full)
        assert robot.tool_placement(q).isApprox(data.oMf[frame], 1e-14)


def test_continuous_joint_has_no_range_and_keeps_its_other_limits():
    robot = planar_robot("CR")
    assert robot.limits.position_lower[0] == -np.inf
    assert robot.limits.position_upper[0] == np.inf
    assert robot.limits.position_lower[1] == -3.0
    assert_array_equal(robot.limits.torque, [80.0, 70.0])
    assert_array_equal(robot.limits.velocity, [3.0, 3.1])


def test_the_chain_carries_the_mass_of_a_gripper_beside_it():
    bare = load([TURN, TURN])
    loaded = load([TURN, TURN], tool_frame="palm", elements=GRIPPER)
    assert loaded.joint_names == ("j1", "j2")
    masses = [sum(i.mass for i in robot.model.inertias) for robot in (bare, loaded)]
    assert masses == pytest.approx([4.0, 5.0])
    # The finger is held at the end of its range nearest to zero, or where the user says.
    options = {"tool_frame": "palm", "elements": re.sub("<mimic .*?/>", "", GRIPPER)}
    moments = []
    for locked in (None, {"finger": 0.05}):
        robot = load([TURN, TURN], locked_joints=locked, **options)
        inertia = robot.model.inertias[2]
        moments.append(inertia.mass * inertia.lever)
    change = moments[1] - moments[0]
    assert_allclose(change, [0.0, 0.5 * (0.05 - 0.02), 0.0], atol=1e-14)


def test_branching_urdf_needs_a_tool_frame():
    with pytest.raises(
        UrdfError, match="2 links without children: finger1, finger2"
    ) as caught:
        load([TURN, TURN], elements=GRIPPER)
    assert "robot.tool_frame" in str(caught.value)


LOOP = "<link name='a'/><joint name='aa' type='fixed'><parent link='a'/><child link='a'/></joint>"
ITSELF = GRIPPER.replace("mimic joint='finger'", "mimic joint='follower'")
FOLLOWER = replace(TURN, extra="<mimic joint='j1'/>")
AT_TOOL = {"elements": GRIPPER, "tool_frame": "tool"}


@pytest.mark.parametrize(
    "joints, options, kind, message",
    [
        (
            [TURN],
            {"elements": LOOP},
            UrdfError,
            r"not form one tree.*a loop of links: a",
        ),
        (
            [Joint("revolute", axis=(0.0, 0.0, 0.0))],
            {},
            UrdfError,
            r"the axis of joint 'j1' has zero length.*xyz='0 0 0'",
        ),
        (
            [TURN],
            AT_TOOL | {"elements": ITSELF},
            UrdfError,
            "mimic each other in a loop; found follower",
        ),
        (
            [TURN],
            AT_TOOL | {"locked_joints": {"finger": 0.03, "follower": 0.01}},
            UrdfError,
            r"'follower' mimics 'finger', which is locked at 0\.03 m; found 0\.01 m; allowed: 0\.03 m",
        ),
        (
            [TURN, FOLLOWER, TURN],
            {"locked_joints": {"j2": 0.0}},
            UrdfError,
            "joint 'j2' mimics 'j1'",
        ),
        (
            [TURN],
            {"base_frame": "bas"},
            UnknownNameError,
            r"base_frame: there is no frame named 'bas'.*Did you mean 'base'",
        ),
        (
            [TURN],
            {"locked_joints": {"j9": 0.0}},
            UnknownNameError,
            "locked_joints: there is no moving joint named 'j9'",
        ),
        (
            [TURN, TURN],
            {"base_frame": "tool", "tool_frame": "link1"},
            UrdfError,
            "the tool frame is not below the base frame; found tool -> link1",
        ),
        (
            [TURN, TURN],
            {"locked_joints": {"j2": 7.0}},
            UrdfError,
            r"locked_joints.j2: .*out of its range; found 7 rad",
        ),
        ([TURN], {"locked_joints": {"j1": 0.0}}, UrdfError, "no joint moves the tool"),
    ],
)
def test_chains_that_cannot_be(joints, options, kind, message):
    with pytest.raises(kind, match=message):
        load(joints, **options)


def test_the_last_link_before_the_chains_part():
    text = chain_urdf([TURN, TURN])
    assert default_chain(text, "file.urdf") == DefaultChain(None, "tool", ("tool",))
    branching = text.replace("</robot>", GRIPPER + "</robot>")
    assert default_chain(branching, "file.urdf") == DefaultChain(
        None, "palm", ("finger1", "finger2")
    )


@pytest.mark.parametrize("order", ["abc", "cba"])
def test_mimics_of_mimics_follow_in_any_order_of_the_file(order):
    mimics = {
        "a": "<mimic joint='b' multiplier='-2'/>",
        "b": "<mimic joint='c' multiplier='0.5' offset='0.1'/>",
        "c": "",
    }
    elements = "".join(
        f"<link name='finger_{name}'>{INERTIAL.format(mass=0.5)}</link>"
        f"<joint name='{name}' type='prismatic'><parent link='tool'/><child link='finger_{name}'/>"
        "<axis xyz='0 1 0'/><limit lower='-1' upper='1' effort='1' velocity='1'/>"
        f"{mimics[name]}</joint>"
        for name in order
    )
    follower = load(
        [TURN], elements=elements, tool_frame="tool", locked_joints={"c": 0.3}
    )
    free = re.sub("<mimic .*?/>", "", elements)
    locked = {"a": -0.5, "b": 0.25, "c": 0.3}
    expected = load([TURN], elements=free, tool_frame="tool", locked_joints=locked)
    inertias = (robot.model.inertias for robot in (follower, expected))
    for inertia, known in zip(*inertias, strict=True):
        assert_allclose(inertia.lever, known.lever, atol=1e-14)


def test_a_joint_beside_the_chain_that_follows_it_stands_still():
    elements = GRIPPER.replace("joint='finger'", "joint='j1'")
    robot = load([TURN, TURN], tool_frame="palm", elements=elements)
    assert robot.joint_names == ("j1", "j2")
    assert robot.model.inertias[2].mass == 3.0  # with both fingers
    assert of_robot(robot) == ()


def test_moments_without_mass_are_left_out_with_a_warning():
    ghost = f"<link name='ghost'>{inertial(0.0, (0.1, 0.1, 0.1))}</link>"
    ghost += "<joint name='fix' type='fixed'><parent link='tool'/><child link='ghost'/></joint>"
    bare, haunted = (load([TURN, TURN], elements=elements) for elements in ("", ghost))
    q = np.array([[0.3, -0.7]])
    args = q, 2.0 * q, 30.0 * q
    assert_array_equal(torque(haunted, *args), torque(bare, *args))
    assert_array_equal(torques(haunted, *args), torques(bare, *args))
    (issue,) = of_robot(haunted)
    assert issue.where == "URDF link ghost"
    assert issue.found == "0.1 kg m^2"


def test_undeclared_prefixes_are_a_part_of_the_name():
    text = chain_urdf(
        [TURN], elements="<sensor:camera name='x'><a:b c:d='1'/></sensor:camera>"
    )
    assert Robot.from_urdf("memory", urdf_text=text).n == 1
    with pytest.raises(
        UrdfError, match="not well-formed XML; found Opening and ending"
    ):
        Robot.from_urdf("memory", urdf_text=text.replace("</sensor:camera>", ""))


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_joints_of_more_coordinates_are_refused_on_the_chain_alone(kind):
    with pytest.raises(
        UrdfError, match=f"joint 'j1' cannot be planned for; found type '{kind}'"
    ):
        load([Joint(kind, limit=None), TURN])
    robot = load([Joint(kind, limit=None), TURN], base_frame="link1")
    assert robot.joint_names == ("j2",)


def test_a_missing_range_comes_from_the_task_or_is_an_error():
    without = {"effort": 1.0, "velocity": 1.0}
    for joint in (Joint("revolute", limit=without), Joint("prismatic", limit=None)):
        with pytest.raises(
            LimitError, match=r"joint 'j1'.*Set robot.limits.position.j1"
        ) as caught:
            load([joint], limits=LimitSpec(torque=1.0))
        assert caught.value.key == "robot.limits.position.j1"
        ranged = LimitSpec(torque=1.0, position={"j1": [-3.0, 2.0]})
        limits = load([joint], limits=ranged).limits
        assert (limits.position_lower[0], limits.position_upper[0]) == (-3.0, 2.0)
    assert load([Joint("continuous", limit=without)]).n == 1


def test_mass_without_inertia_is_an_error():
    text = chain_urdf([Joint("revolute")])
    without = re.sub(r"<inertia [^>]*/>", "", text)
    assert without != text
    with pytest.raises(UrdfError, match="has a mass but no <inertia>"):
        Robot.from_urdf("memory", urdf_text=without)


def inertial(mass, moments):
    ixx, iyy, izz = moments
    return (
        f"<inertial><mass value='{mass}'/>"
        f"<inertia ixx='{ixx}' ixy='0' ixz='0' iyy='{iyy}' iyz='0' izz='{izz}'/></inertial>"
    )


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "found 0 kg in the links that are moved by j2 (tool, link2);"),
        (
            inertial(0.0, (0.1, 0.1, 0.1)),
            "the URDF has no masses, which are needed for robot.limits.torque",
        ),
        (
            inertial(-1.0, (0.1, 0.1, 0.1)),
            "link 'link2' has a negative mass; found -1 kg",
        ),
        (
            inertial(1.0, (0.1, 0.1, 0.3)),
            "link 'link2' has a non-physical inertia; found principal moments 0.1, 0.1, 0.3",
        ),
    ],
)
def test_bodies_that_cannot_be(text, words):
    with pytest.raises(UrdfError) as caught:
        load([TURN, replace(TURN, inertial=text)])
    assert words in str(caught.value)


def test_a_lock_leaves_bodies_that_cannot_be_with_the_base():
    joints = [replace(TURN, inertial=inertial(1.0, (0.1, 0.1, 0.3))), TURN]
    with pytest.raises(UrdfError, match=r"lock .*j1 with robot\.locked_joints"):
        load(joints)
    assert load(joints, locked_joints={"j1": 0.1}).joint_names == ("j2",)


def test_massless_link_is_fine_where_its_body_has_mass():
    heavy_tool = "<link name='load'>" + inertial(2.0, (0.1, 0.1, 0.1)) + "</link>"
    heavy_tool += "<joint name='grip' type='fixed'><parent link='tool'/><child link='load'/></joint>"
    robot = load([TURN, replace(TURN, inertial="")], elements=heavy_tool)
    assert robot.model.inertias[2].mass == 2.0


def test_an_unknown_frame_is_answered_with_the_known_ones():
    with pytest.raises(
        UnknownNameError, match=r"there is no frame named 'tol'.*Did you mean 'tool'"
    ) as caught:
        load([TURN], tool_frame="tol")
    assert caught.value.valid == ("world", "base", "tool", "link1")


def test_base_frame_in_the_middle_holds_what_lies_before_it():
    robot = load([TURN, TURN, TURN])
    upper = load([TURN, TURN, TURN], base_frame="link1")
    assert upper.joint_names == ("j2", "j3")
    for q in np.random.default_rng(0).uniform(-3.0, 3.0, (5, 2)):
        assert upper.tool_placement(q).isApprox(robot.tool_placement([0.0, *q]), 1e-14)


def test_locked_joint_on_the_chain():
    robot = load([TURN, TURN, TURN])
    locked = load([TURN, TURN, TURN], locked_joints={"j2": 0.7})
    assert locked.joint_names == ("j1", "j3")
    postures = np.random.default_rng(0).uniform(-3.0, 3.0, (5, 2))
    full = np.insert(postures, 1, 0.7, axis=1)
    for q, q_full in zip(postures, full, strict=True):
        assert locked.tool_placement(q).isApprox(robot.tool_placement(q_full), 1e-14)
    expected = torque(robot, full, 0.0 * full, 0.0 * full)[:, [0, 2]]
    still = 0.0 * postures
    assert_allclose(torque(locked, postures, still, still), expected, atol=1e-12)


@pytest.mark.parametrize(
    "text, words",
    [
        ("<robot name='x'><link name='a'>", "not well-formed XML"),
        (
            "j1,j2",
            "found 'j1,j2' at its beginning; .* Name a URDF, or a robot that comes with brachis",
        ),
        ("", "not a URDF; found '' at its beginning"),
        (
            "<sdf version='1.7'></sdf>",
            "the file is not a URDF; found root element <sdf>",
        ),
        ("<robot name='x'></robot>", "the URDF has no links"),
        ("<robot name='x'><link name='a'/><link name='b'/></robot>", "links"),
    ],
)
def test_broken_files(tmp_path, text, words):
    file = tmp_path / "broken.urdf"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(UrdfError, match=words) as caught:
        Robot.from_urdf(file)
    assert str(file) in str(caught.value)


def test_missing_file_and_binary_file(tmp_path):
    (tmp_path / "binary.urdf").write_bytes(b"\xff\xfe\x00\x80")
    for name, message in (
        ("none.urdf", "the file does not exist"),
        ("", "it is a folder"),
        ("binary.urdf", "not a text file in UTF-8"),
    ):
        with pytest.raises(UrdfError, match=message):
            Robot.from_urdf(tmp_path / name)


def test_meshes_are_not_read():
    mesh = "<link name='shell'><visual><geometry><mesh filename='package://nowhere/none.stl'/></geometry></visual></link>"
    mesh += "<joint name='cover' type='fixed'><parent link='tool'/><child link='shell'/></joint>"
    assert load([TURN], elements=mesh).tool_frame == "shell"


@pytest.mark.parametrize(
    "gravity", [[0.0, 0.0], [0.0, 0.0, float("nan")], [[0.0, 0.0, 1.0]]]
)
def test_gravity_that_is_no_vector(gravity):
    with pytest.raises(InputError, match=r"robot: gravity\[\d\]: "):
        load([TURN], gravity=gravity)


def test_the_keywords_of_from_urdf_are_the_settings_of_a_task():
    settings = RobotSettings.model_fields.keys() - {"urdf", "limits_file"}
    assert RobotKeywords.__annotations__.keys() == settings
    assert all(f"        {name} : " in Robot.from_urdf.__doc__ for name in settings)
    with pytest.raises(TaskError, match=r"tol_frame.*tool_frame"):
        Robot.from_urdf("file.urdf", urdf_text=planar_urdf("RR"), tol_frame="tool")


def test_what_is_none_is_as_by_default():
    text = planar_urdf("RR")
    nothing = dict.fromkeys(RobotKeywords.__annotations__)
    made = Robot.from_urdf("file.urdf", urdf_text=text, **nothing)
    assert made.settings == Robot.from_urdf("file.urdf", urdf_text=text).settings
