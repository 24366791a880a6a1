"""A program is verified for another robot in all its parts, each with its own payload and limits."""

import pytest

import brachis
from brachis.robot.from_task import robot_from_settings


def test_another_robot_holds_in_all_parts(cycle):
    motion = cycle.trajectory
    weaker = motion.robot.with_limits(torque=10.0)
    checked = brachis.verify_trajectory(motion, robot=weaker)
    (torque,) = (check for check in checked.checks if check.name == "torque ratio")
    usual = next(c for c in cycle.verification.checks if c.name == "torque ratio")
    assert torque.value > 4.0 * usual.value
    assert not checked.passed


def test_another_urdf_keeps_the_limits_and_payloads_of_parts(cycle, tmp_path):
    motion = cycle.trajectory
    heavier = tmp_path / "robot.urdf"
    heavier.write_text(motion.urdf.replace('mass value="20', 'mass value="25'))
    assert heavier.read_text() != motion.urdf
    robot = robot_from_settings(motion.task.robot, urdf=str(heavier))
    checked = brachis.verify_trajectory(motion, robot=robot)
    assert not checked.passed
    ratios = {check.name: check for check in checked.checks}
    assert ratios["torque ratio"].value > 1.05
    assert ratios["velocity ratio"].value == pytest.approx(1.0, abs=1e-3)
    assert ratios["velocity ratio"].subject.endswith("move 1")
