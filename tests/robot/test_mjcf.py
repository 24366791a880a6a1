"""MJCF files; MuJoCo itself, and URDFs with the same figures, say what is right."""

import json
import sys
import warnings

import numpy as np
import pinocchio as pin
import pytest

import brachis
from brachis.errors import NotInstalledError, UrdfError
from brachis.robot.mjcf import is_mjcf
from support.mjcf_files import mjcf_of

mujoco = pytest.importorskip("mujoco")

ARM = """
<mujoco model="arm">
  <default>
    <joint armature="0.1" damping="0.3"/>
    <default class="strong"><joint frictionloss="0.2"/><motor gear="2"/></default>
  </default>
  <worldbody>
    <frame pos="0 0 0.5">
      <body name="base" pos="0 0.2 0.5" euler="0 0 30">
        <geom type="box" size="0.1 0.1 0.1"/>
        <body name="column" pos="0 0 0.1">
          <joint name="lift" type="slide" axis="0 0 1" range="-0.4 0.6" ref="0.1"/>
          <joint name="turn" axis="0 0.6 0.8" pos="0.1 0 0" range="-120 90" ref="20" class="strong"/>
          <geom type="capsule" fromto="0 0 0 0.3 0 0.4" size="0.05"/>
          <body name="mount" pos="0.3 0 0.4">
            <body name="link" quat="0.9 0.1 0 0.2">
              <joint name="swing" axis="1 0 0" limited="false" range="-1 1"/>
              <geom type="sphere" pos="0.1 0 0.2" size="0.1"/>
              <body name="hand" pos="0.2 0.3 0.1" euler="10 20 30">
                <site name="tip" pos="0 0 0.1" euler="0 90 0"/>
              </body>
            </body>
          </body>
        </body>
      </body>
    </frame>
    <body name="table" pos="2 0 0"><geom type="box" size="1 1 1"/></body>
    <body name="cube" pos="2 0 3"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>
  </worldbody>
  <actuator>
    <motor joint="lift" forcerange="-100 60"/>
    <motor joint="lift" ctrlrange="-5 5" class="strong"/>
    <position joint="turn" kp="100" forcerange="-30 30" gear="3"/>
  </actuator>
</mujoco>
"""
LIMITS = {"velocity": 2.0, "torque": {"swing": 10.0}}


def read(folder, text, **keywords):
    """Read an MJCF file, with the warning that it gives."""
    path = folder / "arm.xml"
    path.write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = brachis.Robot.from_urdf(path, **keywords)
    return robot, "".join(str(warning.message) for warning in caught)


def test_places_and_torques_are_those_of_mujoco(tmp_path):
    robot, _ = read(tmp_path, ARM, tool_frame="tip", limits=LIMITS)
    assert robot.joint_names == ("lift", "turn", "swing")
    model = mujoco.MjModel.from_xml_string(ARM)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    for q in np.random.default_rng(0).uniform(-0.3, 0.5, (5, 3)):
        v = np.cos(3.0 * q)
        a = np.sin(5.0 * q)
        data.qpos[:3] = q
        data.qvel[:3] = v
        data.qacc[:3] = a
        mujoco.mj_inverse(model, data)
        place = robot.tool_placement(q)
        assert place.translation == pytest.approx(data.site("tip").xpos, abs=1e-9)
        assert place.rotation.ravel() == pytest.approx(data.site("tip").xmat, abs=1e-9)
        torques = pin.rnea(robot.model, robot.model.createData(), q, v, a)
        torques += robot.friction.armature * a + robot.friction.viscous * v
        # the constraint forces are those of friction and ends of ranges
        forces = data.qfrc_inverse[:3] + data.qfrc_constraint[:3]
        assert torques == pytest.approx(forces, abs=1e-6)


def test_limits_and_what_has_no_counterpart(tmp_path):
    robot, warning = read(tmp_path, ARM, tool_frame="tip", limits=LIMITS)
    degrees = np.radians([-120.0, 90.0])
    assert robot.limits.position_lower == pytest.approx([-0.4, degrees[0], -np.inf])
    assert robot.limits.position_upper == pytest.approx([0.6, degrees[1], np.inf])
    assert robot.limits.torque == pytest.approx([60.0 + 2.0 * 5.0, 90.0, 10.0])
    assert robot.friction.armature == pytest.approx([0.1, 0.1, 0.1])
    assert robot.friction.viscous == pytest.approx([0.3, 0.3, 0.3])
    assert robot.friction.coulomb == pytest.approx([0.0, 0.2, 0.0])
    assert "counterpart: collision shapes (5), control laws of actuators (1)" in warning
    shown = '<geom type="box" size="1 1 1" contype="0" conaffinity="0"/>'
    text = ARM.replace('<geom type="box" size="1 1 1"/>', shown)
    _, warning = read(tmp_path, text, tool_frame="tip", limits=LIMITS)
    assert "collision shapes (4)" in warning
    extra = """
      <option gravity="0 0 -3.7"/>
      <equality><weld body1="hand"/><joint joint1="lift" joint2="swing"/></equality>
      <tendon><fixed name="rope"><joint joint="lift" coef="1"/></fixed></tendon>
      <actuator><motor tendon="rope"/></actuator></mujoco>"""
    text = ARM.replace("</mujoco>", extra).replace(
        'class="strong"/>\n          <geom', 'stiffness="3"/>\n          <geom'
    )
    _, warning = read(tmp_path, text, tool_frame="tip", limits=LIMITS)
    for expected in (
        "equality constraints (2)",
        "tendons (1)",
        "joint springs (1)",
        "actuators that act on no joint (1)",
        "gravity [0.0, 0.0, -3.7] m/s^2, which robot.gravity can set",
    ):
        assert expected in warning


@pytest.mark.parametrize(
    "joint", ['<freejoint name="j"/>', '<joint name="j" type="ball"/>']
)
def test_joints_with_several_coordinates_cannot_be_planned_for(tmp_path, joint):
    text = f"""<mujoco><worldbody><body name="a">{joint}<geom size="0.1"/>
      <body name="b" pos="0 0 1"><joint name="k" axis="1 0 0"/><geom size="0.1" pos="0 0 1"/></body>
    </body></worldbody></mujoco>"""
    limits = {"torque": 1.0, "velocity": 1.0}
    with pytest.raises(
        UrdfError, match="'j' cannot be planned for; found type 'floating'"
    ):
        read(tmp_path, text, limits=limits)
    robot, _ = read(tmp_path, text, limits=limits, base_frame="a")
    assert robot.tool_placement([0.0]).translation.tolist() == [0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    "actuator, torque, text",
    [
        ('<position joint="k" ctrlrange="0 1.5" forcerange="-80 80"/>', 80.0, "laws"),
        ('<motor joint="k" ctrlrange="0 1" gear="50"/>', np.inf, "torque limits of 0"),
        ('<motor joint="k" ctrlrange="-1 2" gear="50"/>', 50.0, ""),
    ],
)
def test_ranges_of_actuators_that_begin_at_zero(tmp_path, actuator, torque, text):
    arm = f"""<mujoco><worldbody><body name="b"><joint name="k" axis="1 0 0"/><geom size="0.1"/></body></worldbody>
      <actuator>{actuator}</actuator></mujoco>"""
    limits = {"velocity": 1.0, "acceleration": 1.0}
    robot, warning = read(tmp_path, arm, limits=limits)
    assert robot.limits.torque == pytest.approx([torque])
    assert text in warning


@pytest.mark.parametrize(
    "text, expected",
    [
        ("<mujoco><worldbody><bdy/></worldbody></mujoco>", "unrecognized"),
        ('<mujoco><include file="part.xml"/></mujoco>', "part.xml"),
        ("<?xml version='1.0'?><!-- an arm --><mujoco>", "XML"),
    ],
)
def test_files_that_mujoco_refuses(tmp_path, text, expected):
    with pytest.raises(
        UrdfError,
        match=rf"arm\.xml: MuJoCo cannot read the MJCF file; found .*{expected}",
    ):
        read(tmp_path, text)


def test_without_mujoco(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(NotInstalledError, match=r"an MJCF file.*mujoco"):
        read(tmp_path, ARM)


@pytest.mark.parametrize(
    "name, example, redundant",
    [("scara3", "scara_line", "j1"), ("tx90l_rail", "tx90l_rail_line", "rail")],
)
def test_urdf_model_and_mjcf_give_the_same_plan(tmp_path, name, example, redundant):
    urdf = brachis.robots.path_of(name)
    mjcf = tmp_path / "arm.xml"
    mjcf.write_text(mjcf_of(urdf.read_text()))
    known = getattr(brachis.robots, name)
    speeds = known.limits.velocity
    velocity = {
        joint: float(speed) if np.isfinite(speed) else None
        for joint, speed in zip(known.joint_names, speeds, strict=True)
    }
    content = brachis.load_task(getattr(brachis.examples, example)).to_dict()
    content["robot"].pop("urdf")
    content["robot"]["tool_frame"] = known.tool_frame
    model = pin.buildModelFromUrdf(str(urdf))
    robots = (urdf, brachis.Robot.from_pinocchio(model, known.tool_frame), mjcf)
    ends = []
    for robot in robots:
        result = brachis.plan(
            robot,
            content,
            limits={"velocity": velocity},
            redundant_joints=[redundant],
            intervals=20,
            effort="single",
        )
        assert result.verified
        ends.append(result.t_end)
        result.save(tmp_path / "result.npz")
        mjcf.rename(tmp_path / "away.xml")  # what is saved needs no file
        saved = brachis.Trajectory.load(tmp_path / "result.npz")
        assert brachis.verify_trajectory(saved).passed
        (tmp_path / "away.xml").rename(mjcf)
    assert ends == pytest.approx([ends[0]] * 3, rel=0.0, abs=1e-9)


def test_task_files_and_rails_take_mjcf(tmp_path):
    mjcf = tmp_path / "arm.xml"
    mjcf.write_text(mjcf_of(brachis.robots.scara3.urdf))
    content = brachis.load_task(brachis.examples.scara_line).to_dict()
    content["robot"] |= {"urdf": "arm.xml", "tool_frame": "tool"}
    task = tmp_path / "task.yaml"
    task.write_text(json.dumps(content))
    assert brachis.load_task(task).robot.urdf == str(mjcf)
    rail = brachis.compose.Rail(range=(-1.0, 1.0), velocity=1.0, force=100.0, mass=5.0)
    assert 'name="rail"' in brachis.compose.on_rail(mjcf, rail)


def test_many_comments_before_the_root_are_passed_at_once():
    """Generated files have dozens; a pattern that looks back took minutes."""
    assert not is_mjcf("<!-- generated -->\n" * 60 + "<robot name='arm'/>")
    assert is_mjcf("<!-- generated -->\n" * 60 + "<mujoco/>")
