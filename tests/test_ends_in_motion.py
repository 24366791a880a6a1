"""Periodic motions and ends in motion, from the task to the verified motion and to MuJoCo."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.task import task_with
from brachis.verify import verify_trajectory
from support.chains import Joint, chain_urdf
from support.checks import failing_checks, with_entry
from support.effort import QUICK
from support.mujoco_models import follow, mujoco_model
from support.scripts import load_script

CIRCLE = brachis.examples.periodic_circle
STEP, TURNS = 4e-4, 3


def plan(**changes):
    return brachis.plan(CIRCLE, **{**QUICK, **changes})


@pytest.fixture(scope="module")
def circle():
    return plan()


def test_periodic_circle_is_faster_than_from_rest_to_rest(circle):
    at_rest = plan(periodic=False)  # and its end posture is free
    assert circle.verified
    assert circle.t_end < 0.85 * at_rest.t_end


def test_everything_closes_over_the_seam(circle):
    trajectory, ends = circle.trajectory, np.array([0.0, circle.t_end])
    for part in (
        trajectory.position,
        trajectory.velocity,
        trajectory.acceleration,
        trajectory.torque,
    ):
        first, last = part(ends)
        assert_allclose(last, first, atol=1e-9)
    assert np.abs(trajectory.velocity(0.0)).max() > 0.1
    names = {check.name for check in circle.verification.checks}
    assert {
        f"{name} over the seam"
        for name in ("position", "velocity", "acceleration", "torque")
    } <= names
    assert not {"start velocity", "end velocity", "start acceleration"} & names


def test_three_turns_in_mujoco_without_drift(circle):
    pytest.importorskip("mujoco")
    trajectory = circle.trajectory
    t = np.arange(0.0, TURNS * trajectory.t_end, STEP)
    states = follow(trajectory, *mujoco_model(trajectory.robot), t)
    away = np.array([np.abs(error).max() for _, error in states])
    number = t // trajectory.t_end
    by_turn = [away[number == turn].max() for turn in range(TURNS)]
    assert max(by_turn) < 1e-4
    assert by_turn[-1] < 1.1 * by_turn[1] + 1e-7, "it drifts"


def test_closed_forms_close_too(circle):
    result = plan(redundant_joints=["j1"], intervals=20)
    assert result.verified
    assert result.t_end == pytest.approx(circle.t_end, rel=0.02)


def test_a_free_start_posture_is_the_end_posture():
    result = plan(start="free", path_start=[3.0**0.5, 0.0], intervals=12)
    assert result.verified
    q = result.trajectory.q
    assert_allclose(q[0], q[-1], atol=1e-9)


def test_the_verification_sees_changes_at_seams(circle):
    trajectory = circle.trajectory
    for name, what in (
        ("q", "position"),
        ("qdot", "velocity"),
        ("qddot_before", "acceleration"),
    ):
        torn = with_entry(trajectory, name, -1, 1e-3)
        assert f"{what} over the seam" in failing_checks(torn)


def test_closed_path_of_joints():
    """Around an ellipse of two joints: the timing alone closes."""

    def ellipse(angle):
        c, s = np.cos(angle), np.sin(angle)
        return [0.3 * c, 0.5, 0.2 * s, -1.2, 0.0, 0.6 + 0.1 * s, 0.0]

    task = task_with(
        robot={"urdf": "iiwa14"},
        limits={"acceleration": 5.0},
        start=ellipse(0.0),
        task_space="joints",
        path=[brachis.bspline_segment(ellipse, (0.0, 2.0 * np.pi), tolerance=1e-12)],
    )
    round_and_round, once = brachis.plan(task, periodic=True), brachis.plan(task)
    assert round_and_round.verified
    assert round_and_round.t_end < 0.95 * once.t_end


@pytest.mark.parametrize("rest", ["velocity", "full"])
def test_speeds_at_both_ends_with_redundancy(rest):
    line = {
        "path": brachis.Line(length=0.6, angle_deg=90),
        "periodic": False,
        "intervals": 12,
        "rest": rest,
        "redundant_joints": ["j1"],
    }
    result = plan(**line, start_speed=0.2, end_speed=0.5)
    assert result.verified
    trajectory = result.trajectory
    model, frame = trajectory.robot.model, trajectory.robot.frame_id
    data, axes = model.createData(), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for time, speed in ((0.0, 0.2), (result.t_end, 0.5)):
        state = trajectory.at(time)
        pin.forwardKinematics(model, data, state.q[0], state.qdot[0])
        velocity = pin.getFrameVelocity(model, data, frame, axes).linear
        assert_allclose(velocity, [0.0, speed, 0.0], atol=1e-9)
    assert result.t_end < plan(**line).t_end
    faster = task_with(result.task, end_speed=0.501)
    assert failing_checks(replace(trajectory, task=faster)) == {"end speed"}


def test_a_turn_on_the_spot_ends_at_an_angular_speed():
    result = plan(
        task_space=["x", "y", "yaw"],
        path=brachis.Line(by=[0.0, 0.0, 0.5]),
        periodic=False,
        end_speed=0.3,
        intervals=12,
    )
    assert result.verified
    last = result.trajectory.velocity(result.t_end)
    assert last.sum() == pytest.approx(0.3, abs=1e-9)


def test_path_of_joints_with_speeds_takes_as_long_as_in_toppra():
    pytest.importorskip("toppra")
    waypoints = np.random.default_rng(3).uniform(-1.0, 1.0, (4, 7))
    result = brachis.plan(
        "iiwa14",
        limits={"acceleration": 10.0},
        start=waypoints[0],
        task_space="joints",
        path=brachis.Spline(through=waypoints[1:]),
        start_speed=0.8,
        end_speed=1.0,
        intervals=120,
        rest="velocity",
        least_motion=False,
    )
    assert result.verified
    example = load_script("examples/11_from_toppra.py")
    robot = result.trajectory.robot
    points = example.joint_points(robot, result.task)
    least = example.by_toppra(robot, *points, speeds=(0.8, 1.0))
    assert result.t_end == pytest.approx(least, rel=3e-3)


REFUSED = [
    (
        {"path": brachis.Line(length=0.6, angle_deg=90)},
        "the path does not close; found 0.6 m off in y",
    ),
    ({"path": brachis.Circle([1.4, 0.0], turns=1.25)}, "the path does not close"),
    ({"end_speed": 0.1}, r"boundary.end_speed: a periodic motion has no ends"),
    (
        {"end": [0, 0, 0]},
        "end: the end posture of a periodic motion is its start posture",
    ),
    (
        {"knots": "free", "intervals": 10},
        "spline.knots: free knots need a motion that starts and ends at rest",
    ),
    ({"start_speed": -0.1}, "boundary.start_speed"),
    (
        {
            "path": brachis.Line(by=[0.2, 0.0], blend=0.05)
            + brachis.Line(by=[0.0, 0.2], blend=0.05)
            + brachis.Line(by=[-0.2, -0.2])
        },
        "the path's tangent jumps where it closes",
    ),
]


@pytest.mark.parametrize("changes, words", REFUSED)
def test_what_is_an_error(changes, words):
    with pytest.raises(brachis.BrachisError, match=words):
        plan(**changes)


def test_a_motion_that_does_not_end_at_rest_has_no_posture_to_hold(circle):
    with pytest.raises(brachis.InputError, match="does not end at rest"):
        circle.trajectory.sample(0.01, last="hold")


def test_a_circle_round_the_arm_closes_if_joints_turn_freely():
    """A joint makes a whole turn, which one with a range cannot repeat."""

    def arm(kind):
        limit = {"effort": 60.0, "velocity": 4.0, "lower": -7.0, "upper": 7.0}
        offsets = [(0.0, 0.0, 0.0), (0.4, 0.0, 0.0), (0.4, 0.0, 0.0)]
        joints = [Joint(kind, xyz=offset, limit=limit) for offset in offsets]
        text = chain_urdf(joints, tool=(0.4, 0.0, 0.0))
        return brachis.Robot.from_urdf("arm", urdf_text=text, tool_frame="tool")

    result = brachis.plan(
        arm("continuous"),
        start="free",
        path_start=[0.93, 0.3],
        task_space=["x", "y"],
        path=brachis.Circle([0.3, 0.3]),
        periodic=True,
        intervals=16,
        time_limit=600.0,
        strict=False,
        **QUICK,
    )
    assert result.verified
    turns = np.abs(np.diff(result.trajectory.q[[0, -1]], axis=0)) / (2.0 * np.pi)
    assert turns.max() > 0.9
    assert_allclose(turns, turns.round(), rtol=0.0, atol=1e-9)
    with_ranges = verify_trajectory(result.trajectory, robot=arm("revolute"))
    failed = [check.name for check in with_ranges.checks if not check.passed]
    assert failed == ["position over the seam"]
