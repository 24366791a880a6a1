"""Robots whose URDF has no masses: planned as long as nothing needs torques, which are unknown."""

import json

import numpy as np
import pytest
import yaml

import brachis
from brachis.apps import bottleneck
from brachis.apps.export import write
from brachis.apps.plots import PLOTS
from brachis.apps.plots.panels import joint_rows_of
from brachis.apps.report import make_report
from brachis.apps.starter import starter_task
from brachis.apps.view.panel import shown_panels
from brachis.apps.view.tables import state_table
from brachis.errors import InputError, LimitError, UrdfError
from brachis.robot import Robot
from support.command_line import code_of
from support.scripts import load_script

AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
ORIGINS = ("0 0 0.5", "0.15 0 0", "0 0 0.8", "0 0 0.2", "0.8 0 0", "0.1 0 0")
RANGES = ((-3, 3), (-1.5, 2.6), (-2.6, 1.3), (-4, 4), (-2, 2), (-6, 6))
GRAM = (
    "<inertial><mass value='0.001'/>"
    "<inertia ixx='1e-6' iyy='1e-6' izz='1e-6' ixy='0' ixz='0' iyz='0'/></inertial>"
)
TASK = yaml.safe_load("""
brachis: 1
start: {joints: [0.2, 0.3, -0.4, 0.3, 0.9, 0.1]}
task_space: pose
path: [{line: {by: [0.1, 0.4, 0]}}]
""")


def six_axes(inertial="", effort=0.0, bare=""):
    """Write an arm with a spherical wrist and a gas spring that follows a2; links in `bare` have no inertial."""
    links = ["base", *(f"l{i}" for i in range(1, 7)), "spring", "tool0"]
    parts = [
        f"<link name='{link}'>{'' if link in bare.split() else inertial}</link>"
        for link in links
    ]
    rows = zip(AXES, ORIGINS, RANGES, links, strict=False)
    for i, (axis, origin, (low, high), parent) in enumerate(rows, 1):
        parts.append(
            f"<joint name='a{i}' type='revolute'><origin xyz='{origin}'/>"
            f"<parent link='{parent}'/><child link='l{i}'/><axis xyz='{axis}'/>"
            f"<limit lower='{low}' upper='{high}' effort='{effort}' velocity='{2.6 if i < 4 else 5}'/></joint>"
        )
    return f"""<robot name='six_axes'>{"".join(parts)}
        <joint name='f' type='fixed'><parent link='l6'/><child link='tool0'/></joint>
        <joint name='gas' type='revolute'><parent link='l1'/><child link='spring'/><axis xyz='0 1 0'/>
        <limit lower='-3' upper='3' effort='0' velocity='5'/><mimic joint='a2' multiplier='-0.4'/></joint></robot>"""


def robot_of(text, **settings):
    given = {"limits": {"acceleration": 8.0}, **settings}
    return Robot.from_urdf("arm.urdf", urdf_text=text, tool_frame="tool0", **given)


@pytest.fixture(scope="module")
def result():
    return brachis.plan(robot_of(six_axes()), TASK)


@pytest.fixture
def saved_file(result, tmp_path):
    result.trajectory.save(tmp_path / "result.npz")
    return tmp_path / "result.npz"


@pytest.mark.parametrize(
    "text, limits",
    [
        (six_axes(), {"torque": None, "acceleration": 8.0}),
        (six_axes(GRAM), {"acceleration": 8.0}),
        (six_axes(GRAM, effort=50.0), {"torque": None, "acceleration": 8.0}),
        (six_axes(GRAM, bare="l6 tool0"), {"acceleration": 8.0}),
    ],
)
def test_masses_change_nothing_where_nothing_needs_them(result, text, limits):
    other = brachis.plan(robot_of(text, limits=limits), TASK)
    assert other.verified
    assert other.t_end == pytest.approx(result.t_end, rel=1e-12)


def test_the_motion_is_verified_without_torques(result, saved_file):
    assert result.verified
    again = brachis.verify_trajectory(brachis.Trajectory.load(saved_file))
    assert again.passed
    names = [check.name for check in again.checks]
    assert "acceleration jump" in names
    assert not [name for name in names if "torque" in name]


def test_torques_are_absent_not_zero(result, tmp_path):
    trajectory = result.trajectory
    with pytest.raises(UrdfError, match=r"no masses, which are needed for torques"):
        trajectory.torque(0.1)
    samples = trajectory.sample(0.1)
    assert samples.tau is None
    assert not [name for name in trajectory.to_dataframe(0.1) if "tau" in name]
    for name in ("x.csv", "x.json"):
        write(trajectory, tmp_path / name, dt=0.1)
    header, *_ = (tmp_path / "x.csv").read_text().splitlines()
    assert header.endswith("qdd_a6")
    content = json.loads((tmp_path / "x.json").read_text())
    assert set(content["samples"]) == {"t", "s", "q", "qdot", "qddot"}
    assert joint_rows_of(trajectory) == ("position", "velocity", "acceleration")
    assert "torque" not in state_table(trajectory, trajectory.at(0.1))
    titles = [panel.title for panel in shown_panels(trajectory, samples)]
    assert not [title for title in titles if "torque" in title]
    said = result.to_dict()["in_use"]
    assert said["torques"] == "unknown, the URDF has no masses"
    assert not [key for key in said if "friction" in key]


@pytest.mark.parametrize("kind", sorted({*PLOTS} - {"fit", "torques"}))
def test_figures_without_torques(result, kind):
    figure = PLOTS[kind](result.trajectory)
    assert not [ax for ax in figure.axes if "tau" in ax.get_ylabel()]


def test_the_figure_of_torques_is_an_error(result):
    with pytest.raises(UrdfError, match=r"Add the masses to the URDF"):
        PLOTS["torques"](result.trajectory)


def test_bottlenecks_and_report(result):
    assert bottleneck.report(result).sensitivities
    page = make_report(result).html
    assert "unknown, the URDF has no masses" in page


@pytest.mark.parametrize(
    "text, key",
    [
        (f"limits: {{acceleration: 8.0, {kind}: {{a2: 5.0}}}}", f"limits.{kind}.a2")
        for kind in ("torque", "power", "rms_torque", "torque_rate")
    ]
    + [
        (
            "limits: {acceleration: 8.0, torque_speed: {a2: [[0, 5], [1, 2]]}}",
            "limits.torque_speed",
        ),
        ("limits: {acceleration: 8.0, total_power: 100.0}", "limits.total_power"),
        ("payload: {mass: 1.0}", "payload"),
        ("friction: {viscous: 1.0}", "friction.viscous"),
        ("friction: {armature: {a1: 0.1}}", "friction.armature"),
    ],
)
def test_what_needs_torques_is_refused_by_its_key(text, key):
    settings = yaml.safe_load(text)
    with pytest.raises(UrdfError) as caught:
        robot_of(six_axes(), **settings)
    message = str(caught.value)
    keys, _, _ = message.partition("which are needed for ")[2].partition(";")
    assert f"robot.{key}" in keys.split(", ")
    assert "moved by a1 (l1, spring), a2 (l2)," in message
    assert robot_of(six_axes(GRAM), **settings).has_masses


def test_what_changes_a_robot_is_refused_too():
    robot = robot_of(six_axes())
    with pytest.raises(UrdfError, match="has no masses"):
        robot.with_limits(torque=5.0)
    with pytest.raises(UrdfError, match="has no masses"):
        robot.with_payload(1.0)
    assert robot.with_limits(jerk=100.0).limits.jerk[0] == 100.0
    assert not robot_of(six_axes(), friction={"viscous": None, "coulomb": 0}).has_masses


def test_an_effort_of_the_urdf_asks_for_masses():
    some = six_axes(effort=50.0).replace("upper='2.6' effort='50.0'", "upper='2.6'")
    with pytest.raises(UrdfError, match=r"effort in the URDF is a limit") as caught:
        robot_of(some)
    keys = ", ".join(f"robot.limits.torque.a{number}" for number in (1, 3, 4, 5, 6))
    assert f"which are needed for {keys};" in str(caught.value)
    free = {"torque": None, "acceleration": 8.0}
    assert robot_of(six_axes(effort=50.0), limits=free).n == 6


def test_one_body_without_mass_is_in_the_message():
    robot = robot_of(six_axes(GRAM, bare="l6 tool0"))
    assert not robot.has_masses
    with pytest.raises(
        UrdfError, match=r"0 kg in the links that are moved by a6 \(l6, tool0\);"
    ):
        robot.with_limits(torque=5.0)


def test_a_missing_limit_is_said_for_all_joints():
    with pytest.raises(LimitError) as caught:
        robot_of(six_axes(), limits={"acceleration": {"a1": 8.0, "a3": 8.0}})
    assert caught.value.joint == "a2"
    assert "found none for a2, a4, a5, a6" in str(caught.value)


def test_an_effort_of_0_is_no_limit():
    robot = robot_of(six_axes(GRAM))
    assert np.isinf(robot.limits.torque).all()
    said = brachis.robot.from_task.in_use(robot)
    assert said["torque limits"] == "none (robot.limits.torque)"
    some = robot_of(
        six_axes(GRAM), limits={"torque": {"a2": 50.0}, "acceleration": 8.0}
    )
    row = brachis.robot.from_task.in_use(some)["torque limits"]
    assert row == "none for a1, a3, a4, a5, a6 (robot.limits.torque)"
    every = robot_of(six_axes(GRAM), limits={"torque": 50.0})
    assert "torque limits" not in brachis.robot.from_task.in_use(every)


class TorqueShare:
    """A limit of a user's own that needs torques."""

    def bind(self, robot):
        return BoundTorqueShare(robot)


class BoundTorqueShare(brachis.limits.Limit):
    kind = "share of torque"
    labels = (brachis.limits.Label("a1", "share of torque", "-", ""),)
    lower = np.array([-1.0])
    upper = np.array([1.0])

    def __init__(self, robot):
        self._robot = robot

    def values(self, motion):
        return motion.torque(self._robot)[:, :1]

    def partials(self, motion):
        exact = motion.torque_derivatives(self._robot)
        return brachis.limits.Partials(*(each[:, :1] for each in exact))


def test_a_limit_of_a_user_that_needs_torques_is_an_error():
    with pytest.raises(InputError, match="no masses, which are needed for torques"):
        brachis.plan(robot_of(six_axes()), TASK, own_limits=[TorqueShare()])


def test_the_commands(tmp_path, capsys):
    (tmp_path / "arm.urdf").write_text(six_axes(effort=50.0))
    assert code_of("inspect", tmp_path / "arm.urdf", "--tool-frame", "tool0") == 0
    shown = capsys.readouterr().out
    assert "torques: unknown, the URDF has no masses" in shown
    assert "torque limit" not in shown
    assert " kg" not in shown
    starter = starter_task(tmp_path / "arm.urdf", folder=tmp_path, tool_frame="tool0")
    assert starter.result.verified
    limits = yaml.safe_load(starter.text)["robot"]["limits"]
    assert set(limits["torque"].values()) == {None}
    assert set(limits["acceleration"].values()) == {1.0}


ARMS = load_script("benchmarks/industrial_arms.py")


@pytest.mark.parametrize(
    "name",
    [
        "fanuc m20ia",  # ortho-parallel, with offsets
        "abb irb120_3_58",
        "staubli tx90",
        "kuka kr210l150",
        "abb irb6640_185_280",  # a gas spring that follows
        "universal_robots ur5",  # no spherical wrist
        "layout three_roll_offset",  # a paint wrist
        "adept cobra_s600",  # a SCARA
    ],
)
def test_industrial_arms_without_masses(name, tmp_path):
    result = ARMS.plan_line(ARMS.arms()[name], tmp_path)
    assert result.verified
    assert not result.trajectory.robot.has_masses


def test_a_joint_on_the_chain_that_follows_is_an_error(tmp_path):
    rows = ARMS.arms()["abb irb5400"]
    assert ARMS.follows_on_the_chain(rows)
    assert not ARMS.follows_on_the_chain(ARMS.arms()["abb irb6640_185_280"])
    with pytest.raises(UrdfError, match="joint 'joint5b' mimics 'joint5'"):
        ARMS.plan_line(rows, tmp_path)
