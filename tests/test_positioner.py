"""A seam around a tube, with the arm alone and with a positioner that turns the tube."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.errors import PathError
from brachis.robot import bind
from brachis.robot.chain import path_frame_in_world

EXAMPLE = Path(__file__).parents[1] / "examples/20_positioner.yaml"
FLAT = -0.5 * np.pi
"""Tilt at which the tube lies flat: position 1G."""


@cache
def planned(**locked):
    """The motion along the seam with some joints of the positioner locked, rad."""
    task = brachis.load_task(EXAMPLE, changes={"robot.locked_joints": locked})
    return brachis.plan(task, intervals=12, effort="single", least_motion=False)


def redundancy(result):
    robot, task_map = bind(result.trajectory.robot, "pose_free_roll")
    return robot.n - task_map.m


def test_turning_the_tube_is_faster_than_the_arm_alone():
    alone = planned(tilt=0.0, turn=0.0)
    turning = planned(tilt=0.0)
    both = planned()
    assert [redundancy(result) for result in (alone, turning, both)] == [1, 2, 3]
    assert all(result.verified for result in (alone, turning, both))
    assert turning.t_end < 0.8 * alone.t_end
    assert both.t_end < turning.t_end


def test_a_seam_in_position_1g():
    flat = planned(tilt=FLAT)
    assert flat.verified
    assert redundancy(flat) == 2
    assert flat.t_end < planned(tilt=0.0, turn=0.0).t_end
    # The arm alone does not reach around the tube that lies flat.
    with pytest.raises(PathError, match="no posture within the joint ranges"):
        planned(tilt=FLAT, turn=0.0)


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


@pytest.mark.parametrize("joints", [["turn", "tilt"], ["turn", "joint_1"]])
def test_closed_forms_of_the_arm_serve_behind_the_positioner(joints):
    task = brachis.load_task(EXAMPLE, changes={"redundant_joints": joints})
    result = brachis.plan(task, intervals=10, effort="single", least_motion=False)
    assert result.verified
    assert result.trajectory.branch
