"""What a task adds to its robot reaches the verification through the saved motion, each part by itself."""

import pytest
import yaml

import brachis
from brachis.robot.from_task import robot_from_settings
from brachis.task import check_robot_settings, task_with
from support.checks import check_of, failing_checks
from support.effort import QUICK

ROBOT = yaml.safe_load("""
tool_frame: tool
gravity: [0, -9.81, 0]
limits:
  torque:
    j1: [-400, 450]
    j2: [-200, 250]
    j3: [-110, 90]
  velocity: 4
payload:
  mass: 2
  com: [0.05, 0.02, 0]
  inertia: {ixx: 0.1, iyy: 0.1, izz: 0.12}
tool_offset:
  xyz: [0.1, 0.05, 0]
  rpy_deg: [0, 0, 20]
mounting:
  xyz: [0.2, 0.1, 0]
  rpy_deg: [0, 0, 30]
friction:
  viscous: [2, 2, 1]
  coulomb: [4, 3, 2]
  coulomb_velocity: 0.05
  rotor_inertia: 0.0002
  gear_ratio: 80
speed_override: 80 %
""")


@pytest.fixture(scope="module")
def saved(scara_urdf, tmp_path_factory):
    """A planned motion, read back from its file."""
    path = tmp_path_factory.mktemp("saved") / "result.npz"
    task = task_with(
        robot={"urdf": str(scara_urdf), **ROBOT},
        start=[0.5, -2.0, 2.0],
        task_space=["x", "y"],
        path=brachis.Line(by=[-0.5, 0.4]),
        redundant_joints=["j3"],
        intervals=12,
        search=QUICK,
    )
    brachis.plan(task).trajectory.save(path)
    return brachis.Trajectory.load(path)


def test_a_saved_motion_passes_again(saved):
    verification = brachis.verify_trajectory(saved)
    assert verification.passed
    assert check_of(verification, "torque ratio").value > 0.999


@pytest.mark.parametrize(
    "change, fault",
    [
        ({"payload": {**ROBOT["payload"], "mass": 2.5}}, "torque ratio"),
        ({"friction": {**ROBOT["friction"], "coulomb": [8, 6, 4]}}, "torque ratio"),
        ({"friction": {**ROBOT["friction"], "gear_ratio": 120}}, "torque ratio"),
        ({"mounting": "ceiling"}, "torque ratio"),
        ({"tool_offset": {"xyz": [0.1, 0.06, 0]}}, "path error"),
        ({"mounting": {"rpy_deg": [0, 0, 31]}}, "path error"),
        ({"speed_override": 0.2}, "velocity ratio"),
        (
            {"limits": {**ROBOT["limits"], "torque": {"j1": 400, "j2": 200, "j3": 90}}},
            "torque ratio",
        ),
    ],
    ids=str,
)
def test_every_part_counts(saved, change, fault):
    other = robot_from_settings(
        check_robot_settings({**ROBOT, **change}), urdf_text=saved.urdf
    )
    assert fault in failing_checks(saved, robot=other)
