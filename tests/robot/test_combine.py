"""A robot and a task that has a robot part: what is combined, what is refused, what is kept."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from numpy.testing import assert_array_equal

import brachis
from brachis.errors import InputError, TaskError
from brachis.robot import Robot, bind
from brachis.robot.from_task import robot_for
from brachis.task import RobotSettings, check_robot_settings
from support.scara import SCARA, START, scara

RAIL = brachis.robots.path_of("tx90l_rail")


def settings_of(**settings):
    return check_robot_settings(settings)


def line(**robot):
    content = yaml.safe_load("""
    brachis: 1
    task_space: [x, y]
    path: [{line: {length: 0.5, angle_deg: 90}}]
    redundant_joints: [j3]
    spline: {intervals: 10}
    search: {effort: single}
    """)
    return {"robot": robot, "start": {"joints": START}, **content}


def test_every_part_of_the_task_counts():
    text = """
    gravity: [0, -9.81, 0]
    limits:
      torque: 7
      velocity: 3
      acceleration: 20
      position: [[-3, 3], [-3, 3], [-3, 3]]
      scale: {torque: 0.5}
    friction: {armature: 0.1, viscous: [1, 2, 3], coulomb: {j2: 0.5}, coulomb_velocity: 0.02}
    """
    settings = settings_of(**yaml.safe_load(text))
    made = robot_for(Robot.from_urdf(SCARA), settings)
    alone = robot_for(SCARA, settings)
    assert made.settings == alone.settings
    assert made.model == alone.model
    assert_array_equal(made.limits.torque, 3.5)
    for part in ("limits", "friction"):
        for name, values in vars(getattr(alone, part)).items():
            assert_array_equal(getattr(getattr(made, part), name), values)


def test_frames_and_locked_joints_of_the_task_count():
    plain = Robot.from_urdf(RAIL)
    made = robot_for(
        plain,
        settings_of(
            base_frame="base_link",
            locked_joints={"joint_6": 0.3},
            limits={"torque": {"joint_1": 5}},
        ),
    )
    assert made.joint_names == plain.joint_names[1:-1]
    assert made.limits.torque[0] == 5.0
    also = robot_for(
        Robot.from_urdf(RAIL, locked_joints={"joint_6": 0.3}),
        settings_of(locked_joints={"joint_5": 0.2}),
    )
    assert also.joint_names == plain.joint_names[:-2]


def test_a_robot_stays_as_it_is_where_the_task_adds_nothing():
    robot = scara()
    assert robot_for(robot, RobotSettings()) is robot
    assert robot_for(robot, settings_of(urdf="another.urdf")) is robot
    assert robot_for(robot, robot.settings) is robot
    same = settings_of(
        gravity=[0, 0, 0], limits={"torque": [10, 10, 10], "velocity": None}
    )
    assert robot_for(robot, same) is robot


def test_limits_are_combined_joint_by_joint():
    robot = scara({"torque": {"j1": 5.0}})
    made = robot_for(robot, settings_of(limits={"torque": {"j2": 6}}))
    assert_array_equal(made.limits.torque, [5.0, 6.0, robot.limits.torque[2]])
    assert made.settings.limits.torque == {"j1": 5.0, "j2": 6.0}
    assert np.isinf(made.limits.velocity).all()


@pytest.mark.parametrize(
    "options, settings, key",
    [
        ("{}", "gravity: [0, 0, -1.6]", "gravity"),
        ("tool_frame: tool", "tool_frame: link2", "tool_frame"),
        ("{}", "limits: {torque: {j2: 20}}", "limits.torque.j2"),
        ("{}", "limits: {velocity: 20}", "limits.velocity.j1"),
        (
            "limits: {scale: {torque: 0.25}}",
            "limits: {scale: {torque: 0.5}}",
            "limits.scale.torque",
        ),
        (
            "friction: {coulomb: 0.5}",
            "friction: {coulomb: {j3: 1.0}}",
            "friction.coulomb.j3",
        ),
        ("locked_joints: {j3: 0.4}", "locked_joints: {j3: 0.5}", "locked_joints.j3"),
    ],
)
def test_a_contradiction_is_refused_with_its_key(options, settings, key):
    robot = scara(**yaml.safe_load(options))
    with pytest.raises(TaskError, match="contradict") as caught:
        robot_for(robot, settings_of(**yaml.safe_load(settings)))
    assert caught.value.where == f"robot.{key}"


def test_what_a_task_writes_counts_even_where_it_is_the_default():
    robot = scara(
        {"velocity": {"j1": 3.0, "j2": 3.0, "j3": 3.0}, "scale": {"torque": 0.5}}
    )
    for settings, key in (
        ({"gravity": [0, 0, -9.81]}, "robot.gravity"),
        ({"limits": {"scale": {"torque": 1.0}}}, "robot.limits.scale.torque"),
    ):
        with pytest.raises(TaskError, match="contradict") as caught:
            robot_for(robot, settings_of(**settings))
        assert caught.value.where == key
    # Joint by joint, "as in the URDF" is what is not said.
    assert robot_for(robot, settings_of(limits={"velocity": "urdf"})) is robot


def test_replaced_limits_are_kept_and_the_task_of_the_result_has_them():
    robot = scara()
    weak = replace(
        robot, limits=robot.limits.with_magnitudes(torque=np.array([4.0, 5.0, 90.0]))
    )
    result = brachis.plan(weak, line())
    assert result.task.robot.limits.torque == {"j1": 4.0, "j2": 5.0, "j3": 90.0}
    assert result.t_end > brachis.plan(robot, line()).t_end
    assert brachis.plan(result.task).t_end == pytest.approx(result.t_end, rel=1e-6)
    assert brachis.plan(weak, result.task).t_end == pytest.approx(
        result.t_end, rel=1e-6
    )
    made = robot_for(weak, settings_of(limits={"acceleration": 50}))
    assert_array_equal(made.limits.torque, [4.0, 5.0, 90.0])
    assert_array_equal(made.limits.acceleration, 50.0)


def test_a_task_keeps_the_friction_of_the_robot():
    robot = scara()
    stiff = replace(
        robot, friction=replace(robot.friction, viscous=np.array([1.0, 0.0, 2.0]))
    )
    made = robot_for(stiff, settings_of(limits={"acceleration": 50}))
    assert_array_equal(made.friction.viscous, [1.0, 0.0, 2.0])
    assert_array_equal(made.friction.v_eps, 0.01)


def test_a_changed_model_is_not_lost():
    robot = scara()
    model = robot.model.copy()
    model.inertias[3].mass = 5.0
    loaded = replace(robot, model=model)
    assert robot_for(loaded, RobotSettings()) is loaded
    with pytest.raises(InputError, match="model"):
        robot_for(loaded, settings_of(limits={"acceleration": 50}))


def test_a_robot_whose_tool_rolls_freely_is_made_anew_without_the_virtual_joint():
    rolling, _ = bind(Robot.from_urdf(RAIL), "pose_free_roll")
    assert robot_for(rolling, RobotSettings()) is rolling
    made = robot_for(rolling, settings_of(limits={"torque": {"joint_1": 5}}))
    assert made.joint_names == rolling.joint_names[:-1]
    assert made.limits.torque[1] == 5.0


def test_transcribe_combines_as_well():
    task = brachis.load_task(
        line(gravity=[0, 0, 0], limits={"torque": 3, "velocity": None})
    )
    problem, _ = brachis.transcribe(Robot.from_urdf(SCARA), task)
    assert_array_equal(problem.phases[0].joint_map.robot.limits.torque, 3.0)
