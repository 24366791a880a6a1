"""Limits from a file: where they count, what the task still says, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_array_equal

import brachis
from brachis import robots
from brachis.errors import InputError, TaskError, UnknownNameError
from brachis.robot import Robot
from brachis.robot.from_task import robot_for, robot_from_settings
from brachis.task import RobotSettings, load_task, read_limits, task_with

ROOT = Path(__file__).parents[2]
FILE = yaml.safe_load("""
brachis_limits: 1
source: the maker
joints: [j1, j2, j3]
limits: {torque: [5, 6, [-7, 8]], acceleration: 20, velocity: {j2: 2}}
""")


@pytest.fixture
def load_beside(tmp_path):
    """Load a task whose robot part is given, beside a limits file."""

    def load(robot=None, **changes):
        (tmp_path / "limits.yaml").write_text(yaml.safe_dump(FILE | changes))
        beside = {"urdf": "scara3", "limits_file": "limits.yaml"}
        line = brachis.Line(length=0.5, angle_deg=90)
        task = task_with(start=[0.5, -2.0, 2.0], task_space=["x", "y"], path=line)
        content = {**task.to_dict(), "robot": beside | (robot or {})}
        path = tmp_path / "task.yaml"
        path.write_text(yaml.safe_dump(content))
        return load_task(path)

    return load


@pytest.fixture
def robot_beside(load_beside, tmp_path):
    """Build the robot of a task beside a limits file with this text."""

    def build(text, **robot):
        (tmp_path / "joint_limits.yaml").write_text(text)
        task = load_beside({"limits_file": "joint_limits.yaml", **robot})
        return robot_from_settings(task.robot)

    return build


def test_the_limits_of_the_file_count_and_what_the_task_says_counts_more(load_beside):
    limits = load_beside().robot.limits
    assert limits.torque == {"j1": 5.0, "j2": 6.0, "j3": (-7.0, 8.0)}
    assert limits.acceleration == {"j1": 20.0, "j2": 20.0, "j3": 20.0}
    assert limits.velocity == {"j2": 2.0}
    assert limits.position == "urdf"
    changes = "{torque: {j2: 1}, acceleration: null, scale: {torque: 0.5}}"
    own = load_beside({"limits": yaml.safe_load(changes)}).robot
    assert own.limits.torque == {"j1": 5.0, "j2": 1.0, "j3": (-7.0, 8.0)}
    assert own.limits.acceleration is None
    assert_array_equal(robot_from_settings(own).limits.torque_upper, [2.5, 0.5, 4.0])
    assert load_beside({"limits": {"torque": 3}}).robot.limits.torque == 3.0


def test_a_loaded_task_needs_the_file_no_more(load_beside):
    task = load_beside()
    assert task.robot.limits_file is None
    assert load_task(task.to_dict()) == task


def test_a_program_reads_the_file_too(tmp_path):
    path = tmp_path / "limits.yaml"
    path.write_text(yaml.safe_dump(FILE), encoding="utf-8")
    robot = Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf", limits=brachis.read_limits(path)
    )
    assert_array_equal(robot.limits.torque_lower, [-5.0, -6.0, -7.0])
    assert_array_equal(robot.limits.acceleration, 20.0)


@pytest.mark.parametrize(
    "changes, message",
    [
        ("brachis_limits: 2", "limits.yaml: brachis_limits"),
        ("brachis_limits: true", "brachis_limits: the version.*found true"),
        ("source: null", "limits.yaml: source"),
        ("limits: {torqe: 1}", "limits.torqe: unknown key.*Did you mean 'torque'"),
        (
            "limits: {torque: [1, 2]}",
            "limits.torque: the list has the wrong number of values; found 2.*j1, j2, j3",
        ),
        ("limits: {torque: {j4: 1}}", "limits.torque.*'j4'.*j1, j2, j3"),
        ("limits: {torque: [1, 2, -3]}", r"limits.torque\[2\]: out of range; found -3"),
        (
            "limits: {torque: [1, 2, [3, 4]]}",
            r"limits.torque\[2\]: a pair of limits must lie around zero",
        ),
        (
            "limits: {scale: {torque: 0.5}}",
            "limits.scale: a limits file cannot contain factors on limits",
        ),
    ],
)
def test_the_error_names_the_key_of_a_wrong_file(load_beside, changes, message):
    with pytest.raises(InputError, match=message):
        load_beside(None, **yaml.safe_load(changes))


def test_files_that_are_none(tmp_path, load_beside):
    with pytest.raises(TaskError, match=r"robot\.limits_file: the file does not exist"):
        load_beside({"limits_file": "nowhere.yaml"})
    (tmp_path / "list.yaml").write_text("[1, 2]", encoding="utf-8")
    with pytest.raises(
        TaskError, match=r"wrong type; found \[1, 2\] .*allowed: a mapping"
    ):
        read_limits(tmp_path / "list.yaml")
    urdf = str(robots.path_of("scara3"))
    with pytest.raises(TaskError, match="the limits file was not read"):
        robot_from_settings(RobotSettings(urdf=urdf, limits_file="limits.yaml"))


def test_the_error_names_joints_that_the_robot_does_not_have(load_beside):
    task = load_beside(None, joints=["a1", "j2", "j3"], limits={"torque": 5})
    with pytest.raises(UnknownNameError, match="'a1'"):
        robot_from_settings(task.robot)


def test_a_file_states_torque_curves_and_the_power_of_all_joints_too(load_beside):
    text = "{torque: 30, total_power: 70, torque_speed: {j2: [[0, 20], [2, 10]]}}"
    limits = yaml.safe_load(text)
    assert load_beside(None, limits=limits).robot.limits.total_power == 70.0
    task = load_beside({"limits": {"total_power": 50}}, limits=limits)
    robot = robot_from_settings(task.robot)
    assert robot.limits.total_power == 50.0
    assert_array_equal(robot.limits.torque, [30.0, 20.0, 30.0])


MOVEIT = """
default_velocity_scaling_factor: 0.5
joint_limits:
  j1:
    has_position_limits: true
    min_position: !degrees -170
    max_position: !radians 2.5
    has_velocity_limits: true
    max_velocity: 2
    has_acceleration_limits: true
    max_acceleration: 3.75
    has_jerk_limits: true
    max_jerk: 90.0
  j2:
    has_velocity_limits: false
    max_velocity: 0
    max_acceleration: 5.0
  j3:
    has_acceleration_limits: false
    max_acceleration: 0
    has_effort_limits: true
    max_effort: 7.5
"""
UR = """
joint_limits:
  {0}: &limits
    has_acceleration_limits: false
    has_effort_limits: true
    has_position_limits: true
    has_velocity_limits: true
    max_effort: 150.0
    max_position: !degrees  360.0
    max_velocity: !degrees  180.0
    min_position: !degrees -360.0
  {1}: *limits
  {2}: {{<<: *limits, max_position: !degrees 180.0, min_position: !degrees -180.0}}
  {3}: *limits
  {4}: *limits
  {5}: {{<<: *limits, max_effort: 28}}
"""
SHORT = (
    "shoulder_pan",
    "shoulder_lift",
    "elbow_joint",
    "wrist_1",
    "wrist_2",
    "wrist_3",
)


def test_a_file_of_moveit_is_read(load_beside, tmp_path):
    file = tmp_path / "joint_limits.yaml"
    file.write_text(MOVEIT, encoding="utf-8")
    limits = load_beside({"limits_file": file.name}).robot.limits
    assert limits.position == {"j1": (np.radians(-170.0), 2.5)}
    assert limits.velocity == {"j1": 2.0, "j2": None}
    assert limits.acceleration == {"j1": 3.75, "j2": 5.0, "j3": None}
    assert (limits.jerk, limits.torque) == ({"j1": 90.0}, {"j3": 7.5})
    assert (limits.scale.velocity, limits.scale.acceleration) == (0.5, 1.0)
    changes = {"scale": {"velocity": 1.0}, "velocity": {"j1": 1.0}}
    task = load_beside({"limits_file": file.name, "limits": changes})
    assert task.robot.limits.scale.velocity == 1.0
    assert task.robot.limits.velocity == {"j1": 1.0, "j2": None}
    robot = Robot.from_urdf(ROOT / "robots/scara3/robot.urdf", limits=read_limits(file))
    half = 0.5 * robot.urdf_limits[2].velocity
    assert_array_equal(robot.limits.velocity, [1.0, np.inf, half])
    assert_array_equal(robot.limits.acceleration, [3.75, 5.0, np.inf])


@pytest.mark.parametrize(
    "names", [SHORT, tuple(name.removesuffix("_joint") + "_joint" for name in SHORT)]
)
def test_a_file_of_universal_robots_is_read(robot_beside, names):
    text = UR.format(*names)
    limits = {"velocity": {"rail": 0.7}}
    limits = robot_beside(text, urdf="ur10_rail", limits=limits).limits
    assert_array_equal(limits.velocity, [0.7, *[180.0 * (np.pi / 180.0)] * 6])
    assert_array_equal(limits.torque[1:], [150.0] * 5 + [28.0])
    assert_array_equal(limits.position_upper[[1, 3]], np.radians([360.0, 180.0]))
    locked = {"locked_joints": {"rail": 0.0}}
    assert robot_beside(text, urdf="ur10_rail", **locked).n == 6
    robot = robot_beside(text, urdf="ur10_rail")
    assert robot.limits.velocity[0] == robot.urdf_limits[0].velocity


@pytest.mark.parametrize(
    "changes, words",
    [
        (("  j2:", "  j1:"), ["line 14, column 3", "the key 'j1' occurs twice"]),
        (
            ("max_velocity: 2", "max_velocity: -2"),
            ["joint_limits.j1.max_velocity: out of range; found -2", "> 0, or has"],
        ),
        (
            ("    max_velocity: 2\n", ""),
            [
                "joint_limits.j1.max_velocity: this figure is missing",
                "has_velocity_limits: f",
            ],
        ),
        (
            ("    min_position: !degrees -170\n", ""),
            ["joint_limits.j1.min_position: this figure is missing"],
        ),
        (("!degrees -170", "!degrees left"), ["!degrees needs a number, not 'left'"]),
        (
            ("!degrees -170", "!degres -170"),
            ["there is no tag named '!degres'", "Did you mean '!degrees'?"],
        ),
        (
            ("max_jerk", "max_jrk"),
            ["joint_limits.j1.max_jrk: unknown key", "Did you mean 'max_jerk'?"],
        ),
        (
            ("factor: 0.5", "factor: 50"),
            ["default_velocity_scaling_factor: out of range; found 50"],
        ),
    ],
    ids=str,
)
def test_a_wrong_file_of_moveit_is_refused_with_its_key(robot_beside, changes, words):
    assert changes[0] in MOVEIT
    with pytest.raises(InputError) as caught:
        robot_beside(MOVEIT.replace(*changes))
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_limits_of_joints_that_stand_still_have_no_effect():
    urdf = ROOT / "robots/ur10_rail/robot.urdf"
    limits = brachis.LimitSpec(
        velocity={"shoulder_pan_joint": 1.0, "wrist_3_joint": 0.5}
    )
    robot = Robot.from_urdf(urdf, tool_frame="wrist_2_link", limits=limits)
    assert "wrist_3_joint" not in robot.joint_names
    assert robot.limits.velocity[1] == 1.0
    with pytest.raises(UnknownNameError, match="'wrist_4_joint'"):
        Robot.from_urdf(urdf, limits=brachis.LimitSpec(velocity={"wrist_4_joint": 1.0}))


def test_a_task_may_limit_joints_that_stand_still_of_a_robot_that_has_limits():
    urdf = ROOT / "robots/ur10_rail/robot.urdf"
    robot = Robot.from_urdf(
        urdf,
        tool_frame="wrist_2_link",
        limits=brachis.LimitSpec(velocity={"rail": 0.4}),
    )
    settings = RobotSettings(
        limits=brachis.LimitSpec(
            velocity={"shoulder_pan_joint": 1.0, "wrist_3_joint": 0.5}
        )
    )
    assert robot_for(robot, settings).limits.velocity[:2].tolist() == [0.4, 1.0]


@pytest.mark.parametrize(
    "wrong",
    [{"urdf": "a\0b"}, {"urdf": "."}, {"tool_frame": [1]}, {"locked_joints": 5}],
    ids=str,
)
def test_a_wrong_robot_beside_a_file_of_moveit_is_an_error_of_ours(robot_beside, wrong):
    with pytest.raises(InputError):
        robot_beside(MOVEIT, **wrong)


def test_a_task_is_not_a_limits_file(load_beside):
    with pytest.raises(
        TaskError,
        match=r"task.yaml: .* a different kind; found a task file; allowed: a limits file",
    ):
        load_beside({"limits_file": "task.yaml"})


def test_joints_that_a_file_of_moveit_leaves_out_have_the_limits_of_the_urdf(
    robot_beside,
):
    text = "joint_limits:\n  j2: {max_velocity: 5}\n"
    robot = robot_beside(text)
    first, _, last = robot.urdf_limits
    expected = [first.velocity, 5.0, last.velocity]
    assert_array_equal(robot.limits.velocity, expected)
    unknown = "".join(f"  {name}: {{max_velocity: 5}}\n" for name in ("j7", "j9"))
    with pytest.raises(UnknownNameError, match="no joint named 'j7' or 'j9'"):
        robot_beside(text + unknown)
