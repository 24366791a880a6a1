"""Payload, tool offset, mounting, armature, friction of the URDF: against URDFs edited by hand and by formulas."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

import brachis
from brachis.errors import InputError, LimitError, TaskError
from brachis.robot import Robot, dynamics
from brachis.robot.from_task import in_use, robot_for, robot_from_settings
from brachis.task import check_robot_settings
from support.chains import Joint, chain_urdf, planar_urdf

ROOT = Path(__file__).parents[2]
IIWA = (ROOT / "robots/iiwa14/robot.urdf").read_text()
TOOL = "tool"
PAYLOAD = yaml.safe_load("""
mass: 4.5
com: [0.05, -0.02, 0.11]
inertia: {ixx: 0.03, iyy: 0.04, izz: 0.02, ixy: 0.004, ixz: -0.002, iyz: 0.003}
""")
LOAD = """
  <link name="load"><inertial><origin xyz="0.05 -0.02 0.11"/><mass value="4.5"/>
    <inertia ixx="0.03" ixy="0.004" ixz="-0.002" iyy="0.04" iyz="0.003" izz="0.02"/></inertial></link>
  <joint name="load_mount" type="fixed"><parent link="{tool}"/><child link="load"/></joint>
"""
TIP = """
  <link name="tip"/>
  <joint name="tip_mount" type="fixed"><parent link="{tool}"/><child link="tip"/>
    <origin xyz="0.1 0.02 0.3" rpy="0.3 -0.7 1.1"/></joint>
"""
HALL = """
  <link name="hall"/>
  <joint name="hall_mount" type="fixed"><parent link="hall"/><child link="{root}"/>
    <origin xyz="1 -2 3" rpy="0.4 1.2 -0.6"/></joint>
"""
OFFSET = {"xyz": [0.1, 0.02, 0.3], "rpy_deg": np.degrees([0.3, -0.7, 1.1])}
PLACE = {"xyz": [1, -2, 3], "rpy_deg": np.degrees([0.4, 1.2, -0.6])}


def states(n, count=20):
    rng = np.random.default_rng(2)
    return tuple(
        scale * rng.uniform(-1.0, 1.0, (count, n)) for scale in (2.0, 3.0, 8.0)
    )


def with_links(*parts, text=IIWA, tool=TOOL, root="base"):
    more = "".join(part.format(tool=tool, root=root) for part in parts)
    return text.replace("</robot>", more + "</robot>")


def of(text, **options):
    return Robot.from_urdf("x", urdf_text=text, **{"tool_frame": TOOL, **options})


@pytest.mark.parametrize(
    "parts, options, tool",
    [
        ((LOAD,), {"payload": PAYLOAD}, TOOL),
        ((TIP,), {"tool_offset": OFFSET}, "tip"),
        ((HALL,), {"mounting": PLACE}, TOOL),
        (
            (LOAD, TIP, HALL),
            {"payload": PAYLOAD, "tool_offset": OFFSET, "mounting": PLACE},
            "tip",
        ),
    ],
    ids=["payload", "tool offset", "mounting", "all"],
)
def test_a_urdf_edited_by_hand_moves_alike(parts, options, tool):
    root = re.search(r'<link name="(\w+)"', IIWA).group(1)
    robot = of(IIWA, **options)
    edited = of(with_links(*parts, root=root), tool_frame=tool)
    q, qdot, qddot = states(7)
    expected = dynamics.torque(edited, q, qdot, qddot)
    scale = np.abs(expected).max()
    assert_allclose(dynamics.torque(robot, q, qdot, qddot), expected, atol=1e-9 * scale)
    for array, known in zip(
        robot.tool_placements(q), edited.tool_placements(q), strict=True
    ):
        assert_allclose(array, known, atol=1e-12)
    change = dynamics.torque(of(IIWA), q, qdot, qddot) - expected
    changes_torque = np.abs(change).max() > 0.01 * scale
    assert changes_torque == (options.keys() != {"tool_offset"})


@pytest.mark.parametrize(
    "word, direction",
    [("floor", [0, 0, 1]), ("wall", [1, 0, 0]), ("ceiling", [0, 0, -1])],
)
def test_where_the_base_points(word, direction):
    arm = chain_urdf([Joint("prismatic")], tool=(0.0, 0.0, 0.5))
    robot = of(arm, mounting=word)
    positions, _ = robot.tool_placements(np.array([[0.7]]))
    assert_allclose(positions[0], 1.2 * np.array(direction), atol=1e-15)
    held = dynamics.torque(robot, *np.zeros((3, 1, 1)))[0, 0]
    assert held == pytest.approx(2.0 * 9.81 * direction[2])


def test_a_rotor_behind_a_gear_counts_as_armature():
    chain = planar_urdf("RRP", "xz")
    geared = {
        "rotor_inertia": {"j1": 2e-4, "j3": 1e-3},
        "gear_ratio": {"j1": 100, "j3": 50.0},
    }
    robot = of(chain, friction=geared)
    assert_allclose(robot.friction.armature, [2.0, 0.0, 2.5])
    same = of(chain, friction={"armature": [2.0, 0.0, 2.5]})
    assert_allclose(
        *(dynamics.torque(arm, *states(3)) for arm in (robot, same)), rtol=1e-12
    )
    again = robot_from_settings(robot.settings, urdf_text=chain)
    assert_array_equal(again.friction.armature, robot.friction.armature)


@pytest.mark.parametrize(
    "friction, words",
    [
        (
            {"rotor_inertia": 1e-4},
            r"robot\.friction\.gear_ratio\.j1: the rotor of joint 'j1' has no gear ratio",
        ),
        (
            {"rotor_inertia": 1e-4, "gear_ratio": 50, "armature": {"j2": 1.0}},
            r"rotor_inertia\.j2: joint 'j2' has both armature and rotor_inertia",
        ),
        ({"rotor_inertia": -1e-4, "gear_ratio": 50}, "out of range; found -0.0001"),
    ],
)
def test_rotors_that_cannot_be(friction, words):
    with pytest.raises(InputError, match=words):
        of(planar_urdf("RRP"), friction=friction)


DYNAMICS = "<dynamics damping='7' friction='3'/>"
DAMPED = chain_urdf([Joint("revolute", extra=DYNAMICS), Joint("prismatic")])


def test_friction_is_the_urdfs_unless_the_task_says_otherwise():
    for friction, viscous, coulomb in (
        ({"viscous": None, "coulomb": None}, [0, 0], [0, 0]),
        ({"viscous": {"j2": 4}}, [7, 4], [3, 0]),
        ({"viscous": "urdf", "coulomb": 1.5}, [7, 0], [1.5, 1.5]),
    ):
        settings = check_robot_settings({"friction": friction})
        robot = robot_for(of(DAMPED, friction=friction), settings)
        assert_array_equal(robot.friction.viscous, viscous)
        assert_array_equal(robot.friction.coulomb, coulomb)
    said = in_use(of(DAMPED))["viscous friction"]
    assert said == "j1 7 Nm s/rad, j2 0 N s/m (as in the URDF)"
    off = in_use(of(DAMPED, friction={"viscous": None}))
    assert off["viscous friction"] == "none (different from the URDF)"


def test_friction_of_the_urdf_that_cannot_be():
    with pytest.raises(
        InputError, match=r"viscous\.j1: the value is negative.*-7 in the URDF"
    ):
        of(DAMPED.replace("damping='7'", "damping='-7'"))
    with pytest.raises(InputError, match="joint 'j1' is not below its torque limit"):
        of(DAMPED.replace("friction='3'", "friction='70'"))


def test_a_gripper_that_its_friction_holds_is_left_out_as_the_message_says():
    text = planar_urdf("RRP")
    held = {"coulomb": {"j3": 1e4}}
    with pytest.raises(InputError, match="joint 'j3' is not below") as caught:
        of(text, friction=held)
    link = re.search(
        r"end the chain at (\S+) with robot.tool_frame or --tool-frame",
        caught.value.hint,
    )[1]
    assert of(text, tool_frame=link).joint_names == ("j1", "j2")
    with pytest.raises(InputError, match="joint 'j1' is not below") as caught:
        of(text, friction={"coulomb": {"j1": 1e4}})
    assert "tool_frame" not in caught.value.hint


def test_speed_override_is_a_factor_on_all_velocity_limits_and_nothing_else():
    plain = planar_urdf("RRP")
    full, half = (of(plain, speed_override=factor) for factor in (1.0, 0.5))
    assert_array_equal(half.limits.velocity, 0.5 * full.limits.velocity)
    assert_array_equal(half.limits.torque, full.limits.torque)
    scale = {"limits": {"scale": {"velocity": 0.5}}}
    slow = robot_for(half, check_robot_settings(scale))
    assert_array_equal(slow.limits.velocity, 0.25 * full.limits.velocity)
    percent = check_robot_settings({"speed_override": "30 %"})
    assert percent.speed_override == pytest.approx(0.3)
    for wrong in (0.0, 1.2, -1.0):
        with pytest.raises(TaskError, match="speed_override: out of range"):
            of(plain, speed_override=wrong)
    with pytest.raises(
        InputError, match="the speed override has no velocity limit to scale"
    ):
        of(plain, speed_override=0.5, limits=brachis.LimitSpec(velocity=None))


@pytest.mark.parametrize(
    "section, ours, theirs, key",
    [
        ("payload", {"mass": 4.5}, {"mass": 2}, ""),
        ("tool_offset", {"xyz": [0, 0, 1]}, {"xyz": [0, 0, 2]}, ".xyz"),
        ("mounting", "wall", "floor", ".rpy_deg"),
        ("speed_override", 0.5, 0.7, ""),
        ("friction", {"coulomb": None}, {"coulomb": 1.0}, ".coulomb"),
    ],
    ids=str,
)
def test_contradictions_are_refused_with_their_key(section, ours, theirs, key):
    with pytest.raises(TaskError, match="contradict") as caught:
        robot_for(of(IIWA, **{section: ours}), check_robot_settings({section: theirs}))
    assert caught.value.where.startswith(f"robot.{section}{key}")


@pytest.mark.parametrize(
    "options, words",
    [
        ("payload: {mass: -1}", r"robot.*payload\.mass: out of range"),
        ("payload: {com: [0, 0, 0]}", "mass"),
        (
            "payload: {mass: 1, inertia: {ixx: 1, iyy: 1, izz: 9}}",
            r"payload\.inertia: the payload has a non-physical inertia",
        ),
        ("mounting: roof", "mounting: this mounting is unknown.*floor, wall, ceiling"),
        ("tool_offset: {xyz: [0, 0]}", r"tool_offset\.xyz"),
    ],
)
def test_what_cannot_be_is_an_error(options, words):
    with pytest.raises((InputError, LimitError), match=words):
        of(IIWA, **yaml.safe_load(options))


def test_the_summary_names_joints_without_a_limit_on_their_acceleration():
    free = of(DAMPED)
    key = "acceleration limits"
    assert in_use(free)[key] == "none (robot.limits.acceleration)"
    qddot = np.array([[1.0, -5.0], [-3.0, 2.0]])
    said = in_use(free, qddot)[key]
    assert said.endswith("; the largest is 3 rad/s^2, of j1, and 5 m/s^2, of j2")
    some = of(DAMPED, limits={"acceleration": {"j2": 9.0}})
    said = in_use(some, qddot)[key]
    assert said.startswith("none for j1 (robot.limits.acceleration); the largest is 3 ")
    both = of(DAMPED, limits={"acceleration": 9.0})
    assert key not in in_use(both, qddot)


def test_slower_limits_are_said_to_be_in_use():
    slower = brachis.LimitSpec(scale={"velocity": 0.1})
    said = in_use(of(DAMPED, limits=slower))["limits"]
    assert said == "velocity 10 % of what is stated (limits.scale)"
    assert "limits" not in in_use(of(DAMPED))
