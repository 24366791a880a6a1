"""A seam around a tube, with the arm alone and with a positioner that turns the tube."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.errors import InputError, PathError
from brachis.robot import bind, dynamics
from brachis.robot.chain import path_frame_in_world

ROBOTS = Path(__file__).parents[1] / "robots"
EXAMPLE = ROBOTS.parent / "examples/20_positioner.yaml"
FLAT = -0.5 * np.pi
"""Tilt at which the tube lies flat: position 1G."""


ALONE = {"tilt": 0.0, "turn": np.pi}
"""Positions of the positioner, rad, in which the arm alone reaches around the tube."""


@cache
def planned(mode="avoid", **locked):
    """The motion along the seam with some joints of the positioner locked, rad."""
    changes = {"robot.locked_joints": locked, "collisions.mode": mode}
    task = brachis.load_task(EXAMPLE, changes=changes)
    return brachis.plan(task, intervals=12, effort="single", least_motion=False)


def redundancy(result):
    robot, task_map = bind(result.trajectory.robot, "pose_free_roll")
    return robot.n - task_map.m


def test_turning_the_tube_is_faster_than_the_arm_alone():
    alone = planned(**ALONE)
    turning = planned(tilt=0.0)
    both = planned()
    assert [redundancy(result) for result in (alone, turning, both)] == [1, 2, 3]
    assert all(result.verified for result in (alone, turning, both))
    assert turning.t_end < 0.75 * alone.t_end
    assert both.t_end < 0.75 * alone.t_end


def test_a_seam_in_position_1g():
    flat = planned(tilt=FLAT)
    assert flat.verified
    assert redundancy(flat) == 2
    assert flat.t_end < 0.9 * planned(**ALONE).t_end
    # The arm alone does not reach around the tube that lies flat.
    for turn in (0.0, np.pi):
        with pytest.raises(PathError, match="no "):
            planned(tilt=FLAT, turn=turn)


def test_the_arm_keeps_clear_of_the_positioner():
    touching = planned("check", tilt=0.0)
    assert not touching.verified
    (clearance,) = clearances(touching)
    assert not clearance.passed
    (clearance,) = clearances(planned(tilt=0.0))
    assert clearance.passed


def clearances(result):
    checks = result.verification.checks
    return [check for check in checks if check.name == "clearance ratio"]


def test_the_tool_follows_the_seam_on_the_tube():
    trajectory = planned().trajectory
    samples = trajectory.at(np.linspace(0.0, trajectory.t_end, 50))
    x, y, z = samples.tool_position.T
    assert np.hypot(x, y) == pytest.approx(0.07, abs=1e-9)
    assert z == pytest.approx(0.2, abs=1e-9)
    assert np.arctan2(y, x) == pytest.approx(
        np.remainder(2.0 * np.pi * samples.s + np.pi, 2.0 * np.pi) - np.pi, abs=1e-6
    )
    robot = trajectory.robot
    frames = [
        path_frame_in_world(data, robot.world) for data in robot.place_joints(samples.q)
    ]
    turned = np.array([frame.rotation for frame in frames])
    assert np.linalg.norm(turned[-1] - turned[0]) > 0.5


def test_a_saved_motion_is_verified_for_the_whole_cell(tmp_path):
    path = tmp_path / "seam.npz"
    planned().save(path)
    assert brachis.verify_trajectory(path).passed
    trajectory = brachis.Trajectory.load(path)
    assert trajectory.robot.settings.workpiece_frame == "workpiece"
    heavy = trajectory.robot.urdf.replace('mass value="11.8"', 'mass value="411.8"')
    assert heavy != trajectory.robot.urdf
    settings = trajectory.robot.settings
    robot = brachis.Robot.from_settings(settings, "heavy.urdf", heavy)
    checks = brachis.verify_trajectory(path, robot=robot).checks
    (torque,) = [check for check in checks if check.name == "torque ratio"]
    assert not torque.passed
    assert torque.subject in ("turn", "tilt")


GUN = """<link name="gun"/><joint name="stand" type="fixed"><parent link="base_link"/><child link="gun"/>
<origin xyz="0.7 0.1 0.7" rpy="0 3.14159265 0"/></joint></robot>"""


def test_an_arm_moves_the_workpiece_under_a_fixed_tool():
    text = (ROBOTS / "tx90l_rail/arm.urdf").read_text().replace("</robot>", GUN)
    robot = brachis.Robot.from_urdf(
        "arm.urdf", urdf_text=text, workpiece_frame="tool", tool_frame="gun"
    )
    with pytest.raises(InputError, match="a payload has no effect"):
        robot.with_payload(1.0)
    result = brachis.plan(
        robot,
        start="free",
        path_start={"position": [0.1, 0.0, 0.05], "rpy_deg": [180, 0, 0]},
        path=[brachis.Circle(center=[0.0, 0.0, 0.05], normal=[0, 0, 1])],
        task_space="pose_free_roll",
        intervals=12,
        effort="single",
    )
    assert result.verified
    trajectory = result.trajectory
    arm = brachis.Robot.from_urdf("arm.urdf", urdf_text=text, tool_frame="tool")
    # Backwards through the chain, the torques are those of the same arm.
    t = np.linspace(0.0, trajectory.t_end, 20)
    curves = (trajectory.position, trajectory.velocity, trajectory.acceleration)
    states = [curve(t)[:, 5::-1] for curve in curves]
    np.testing.assert_allclose(
        trajectory.torque(t)[:, 5::-1], dynamics.torque(arm, *states), atol=1e-9
    )


@pytest.mark.parametrize("joints", [["turn", "tilt"], ["turn", "joint_1"]])
def test_closed_forms_of_the_arm_serve_behind_the_positioner(joints):
    changes = {"redundant_joints": joints, "collisions.mode": "off"}
    task = brachis.load_task(EXAMPLE, changes=changes)
    result = brachis.plan(task, intervals=10, effort="single", least_motion=False)
    assert result.verified
    assert result.trajectory.branch
