"""The verification of poses: it sees a wrong orientation, and a wrong roll."""

from dataclasses import replace

import numpy as np
import pytest

import brachis
from brachis import Trajectory, export, verify_trajectory
from support.checks import check_of, with_entry
from support.effort import QUICK
from support.spatial import START, rail_arm


@pytest.fixture(scope="module", params=["pose", "pose_free_roll"])
def motion(request):
    turning = {"rotate": {"axis": [1, 0, 0], "angle_deg": 20}}
    return brachis.plan(
        rail_arm(tool=(0.0, 0.0, 0.12)),
        start=START,
        task_space=request.param,
        path=brachis.Line(by=[0.1, 0.3, 0.0], orientation=turning),
        redundant_joints=["j1"],
        intervals=10,
        search=QUICK,
    ).trajectory


def path_error(trajectory):
    return check_of(verify_trajectory(trajectory), "path error")


def test_the_motion_of_the_plan_passes(motion):
    assert verify_trajectory(motion).passed


@pytest.mark.parametrize("joint", range(1, 7))
def test_it_sees_every_joint_that_is_a_little_off(motion, joint):
    """The last joint turns the tool about its own axis and does not move it."""
    off = with_entry(motion, "q", (slice(None), joint), 1e-7)
    check = path_error(off)
    assert not check.passed
    assert check.value == pytest.approx(1e-7, rel=0.9)


@pytest.mark.parametrize("motion", ["pose_free_roll"], indirect=True)
def test_it_sees_a_roll_that_does_not_fit_the_joints(motion):
    assert motion.joint_names[-1] == "tool_roll"
    q = np.array(motion.q)
    q[:, -1] += 1e-7
    assert path_error(replace(motion, q=q)).value == pytest.approx(1e-7, rel=1e-3)
    # Turned back by the last joint, about the same axis, the tool is as it was.
    q[:, -2] += 1e-7
    assert path_error(replace(motion, q=q)).passed


def test_saved_motions_come_back(motion, tmp_path):
    motion.save(tmp_path / "motion.npz")
    again = Trajectory.load(tmp_path / "motion.npz")
    assert again.joint_names == motion.joint_names
    assert verify_trajectory(again).passed
    export.write(again, tmp_path / "motion.csv", dt=0.01)
    assert "q_j7" in (tmp_path / "motion.csv").read_text().splitlines()[0]


@pytest.mark.parametrize("motion", ["pose_free_roll"], indirect=True)
def test_a_tool_that_rolls_freely_is_for_that_task_space_alone(motion):
    with pytest.raises(brachis.BrachisError, match="leaves the path in other ways"):
        brachis.plan(motion.robot, {**motion.task.to_dict(), "task_space": "pose"})
