"""First tasks: they plan and verify at once, for whichever robot."""

from pathlib import Path

import numpy as np
import pytest
import yaml

import brachis
from brachis.apps.starter import choices, heights, placeholders, starter_task, task_text
from brachis.errors import InputError, PlanningError, UrdfError
from brachis.robot import bind
from brachis.robot.limits import UrdfLimit
from brachis.task import LimitSpec
from support.chains import Joint, chain_urdf
from support.published import published_urdf

FOREIGN = {
    "panda_description/urdf/panda.urdf": ("panda_hand", 7),
    "ur_description/urdf/ur5_robot.urdf": ("wrist_3_link", 6),
    "baxter_description/urdf/baxter.urdf": ("left_gripper_base_link", 7),
    "double_pendulum_description/urdf/double_pendulum.urdf": ("link2", 2),
}


def check(starter, folder):
    """The quick plan is one of the task file as it was written, and begins well within all ranges."""
    path = folder / "task.yaml"
    path.write_text(starter.text)
    task = brachis.load_task(path)
    assert starter.result.verified
    assert task.path == starter.result.task.path
    assert Path(task.robot.urdf).samefile(starter.robot.source)
    limits, q = starter.robot.limits, starter.result.trajectory.position(0.0)
    lower, upper = limits.position_lower, limits.position_upper
    margin = 0.1 * np.where(np.isfinite(upper), upper - lower, 0.0)
    assert np.all((q > lower + margin) & (q < upper - margin))


def two_joints(axis=(0.0, 0.0, 1.0), effort=60.0):
    """A chain whose first joint may be weak."""
    limit = {"lower": -3.1, "upper": 3.1, "velocity": 3.0, "effort": effort}
    joints = [
        Joint("revolute", axis, limit=limit),
        Joint("revolute", axis, xyz=(0.5, 0.0, 0.0)),
    ]
    return chain_urdf(joints, tool=(0.5, 0.0, 0.0))


@pytest.mark.parametrize("name", brachis.robots.names())
def test_robots_that_come_along(name, tmp_path):
    starter = starter_task(brachis.robots.path_of(name), folder=tmp_path)
    check(starter, tmp_path)
    motion = starter.result.trajectory
    q = motion.position(np.linspace(0.0, motion.t_end, 20))
    assert heights(starter.robot, q).min() > (
        -1e-9 if name in ("scara3", "gantry2") else 0.05
    ), "the tool is above the robot's base"


@pytest.mark.parametrize(
    "name, slides", [("tx90l_rail", 1), ("ur10_rail", 1), ("gen3_rails", 2)]
)
def test_an_arm_on_a_rail_begins_away_from_its_own_singularities(name, slides):
    robot, space = bind(getattr(brachis.robots, name), "pose")
    assert robot.revolute.argmax() == slides
    first = next(choices(space))
    arm = space.jacobian(space.twists(first.posture[None]))[0, :, slides:]
    assert (
        np.linalg.svd(arm, compute_uv=False)[-1] > 0.1
    )  # 0.011 to 0.017 with the rail's help alone


def test_heights_are_above_the_base_wherever_it_is():
    text = chain_urdf([Joint("prismatic")], tool=(0.3, 0.0, 0.5))
    q = np.array([[0.2], [-0.7]])
    for mounting in ("wall", {"xyz": [1, 2, 3], "rpy_deg": [10, 20, 30]}):
        robot = brachis.Robot.from_urdf(
            "x", urdf_text=text, tool_frame="tool", mounting=mounting
        )
        np.testing.assert_allclose(heights(robot, q), [0.7, -0.2], atol=1e-12)


@pytest.mark.parametrize("file", FOREIGN)
def test_robots_of_others(file, tmp_path):
    starter = starter_task(published_urdf(file), folder=tmp_path)
    check(starter, tmp_path)
    assert (starter.robot.tool_frame, starter.robot.n) == FOREIGN[file]


@pytest.fixture
def urdf(tmp_path):
    return tmp_path / "robot # 1.urdf"


def test_names_that_yaml_would_misread(urdf, tmp_path):
    text = two_joints().replace("'j1'", "'on'").replace("'j2'", "'2: a # b'")
    urdf.write_text(text.replace("'tool'", "'null'"))
    starter = starter_task(urdf, folder=tmp_path)
    check(starter, tmp_path)
    assert list(yaml.safe_load(starter.text)["start"]["joints"]) == ["on", "2: a # b"]


def test_the_task_marks_missing_limits(urdf, tmp_path):
    urdf.write_text(two_joints(effort=0.0))
    starter = starter_task(urdf, folder=tmp_path)
    assert "ENTER THE MANUFACTURER'S DATA HERE" in starter.text
    assert yaml.safe_load(starter.text)["robot"]["limits"] == {
        "torque": {"j1": None},
        "acceleration": {"j1": 1.0},
    }


def test_placeholders_of_every_kind():
    limits = placeholders(
        ("a", "b"),
        (UrdfLimit(-1.0, 1.0, 2.0, 3.0), UrdfLimit(0.0, 0.0, 0.0, None)),
        has_masses=True,
    )
    assert limits.torque == {"b": None}
    assert limits.velocity == {"b": None}
    assert limits.position == {"b": (-1.5, 1.5)}
    assert limits.acceleration == {"b": 1.0}


def test_an_arm_that_cannot_hold_itself(urdf):
    urdf.write_text(two_joints(axis=(0.0, 1.0, 0.0), effort=0.001))
    with pytest.raises(PlanningError, match=r"no first motion was found.*j1, j2"):
        starter_task(urdf)


def test_what_is_no_arm(urdf):
    urdf.write_text("<robot name='x'><link name='a'/></robot>")
    with pytest.raises(UrdfError, match="no joint moves"):
        starter_task(urdf)


def test_a_warning_names_masses_in_g_without_a_motion(urdf):
    text = brachis.robots.iiwa14.urdf
    urdf.write_text(text.replace('mass value="', 'mass value="1000'))
    with (
        pytest.warns(brachis.PlausibilityWarning, match="the mass looks like g"),
        pytest.raises(PlanningError, match="no first motion"),
    ):
        starter_task(urdf)


@pytest.mark.parametrize(
    "name, frame", [("iiwa14", "link_1"), ("iiwa14", "link_2"), ("scara3", "link1")]
)
def test_a_frame_that_only_turns_on_the_spot_is_an_error(name, frame):
    with pytest.raises(InputError, match=r"only rotates on the spot.*Choose another"):
        starter_task(brachis.robots.path_of(name), tool_frame=frame)


def test_the_limits_that_are_suggested_are_those_of_the_urdf():
    robot, space = bind(brachis.robots.tx90l_rail, "pose")
    text = task_text(robot, "pose", next(choices(space)), LimitSpec(), Path())
    (line,) = [line for line in text.splitlines() if "# limits:" in line]
    assert f"torque: {{rail: {robot.limits.torque_upper[0]}}}" in line
    assert "# N, as the URDF" in line
    assert "acceleration" not in line
