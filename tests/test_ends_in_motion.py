"""Periodic motions and ends in motion, from the task to the verified motion and to MuJoCo."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.verify import verify_trajectory
from support.effort import QUICK
from support.mujoco_models import mujoco_model

ROOT = Path(__file__).parents[1]
CIRCLE = ROOT / "examples/10_periodic_circle.yaml"
BANDWIDTH, STEP, TURNS = 50.0, 4e-4, 3
IIWA = ROOT / "robots/iiwa14/robot.urdf"


def variant(**changes):
    return {**brachis.load_task(CIRCLE).to_dict(), **changes}


@pytest.fixture(scope="module")
def circle():
    return brachis.plan(variant(search=QUICK))


def failed_checks(trajectory):
    return {
        check.name for check in verify_trajectory(trajectory).checks if not check.passed
    }


def test_periodic_circle_is_faster_than_from_rest_to_rest(circle):
    at_rest = brachis.plan(
        variant(boundary={}, search=QUICK)
    )  # and its end posture is free
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
    """Feedforward of the planned torque and a weak feedback, over the seam and again."""
    mujoco = pytest.importorskip("mujoco")
    trajectory = circle.trajectory
    model, order = mujoco_model(trajectory.robot)
    model.opt.timestep, model.opt.integrator = STEP, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    data.qpos[order], data.qvel[order] = trajectory.q[0], trajectory.qdot[0]
    inertia = np.diag(
        pin.crba(
            trajectory.robot.model, trajectory.robot.model.createData(), trajectory.q[0]
        )
    )
    stiffness, damping = BANDWIDTH**2 * inertia, 2.0 * BANDWIDTH * inertia
    t = np.arange(0.0, TURNS * trajectory.t_end, STEP)
    once = np.mod(t, trajectory.t_end)
    away = np.empty(len(t))
    planned = (
        trajectory.position(once),
        trajectory.velocity(once),
        trajectory.torque(once),
    )
    for k, (q, v, tau) in enumerate(zip(*planned, strict=True)):
        error = q - data.qpos[order]
        away[k] = np.abs(error).max()
        data.qfrc_applied[order] = (
            tau + stiffness * error + damping * (v - data.qvel[order])
        )
        mujoco.mj_step(model, data)
    by_turn = [
        away[(t >= turn * trajectory.t_end) & (t < (turn + 1) * trajectory.t_end)].max()
        for turn in range(TURNS)
    ]
    assert max(by_turn) < 1e-4
    assert by_turn[-1] < 1.1 * by_turn[1] + 1e-7, "it drifts"


def test_closed_forms_close_too(circle):
    result = brachis.plan(
        variant(redundant_joints=["j1"], search=QUICK, spline={"intervals": 20})
    )
    assert result.verified
    assert result.t_end == pytest.approx(circle.t_end, rel=0.02)


def test_a_free_start_posture_is_the_end_posture():
    place = [3.0**0.5, 0.0]
    result = brachis.plan(
        variant(start="free", path_start=place, search=QUICK, spline={"intervals": 12})
    )
    assert result.verified
    assert_allclose(result.trajectory.q[0], result.trajectory.q[-1], atol=1e-9)


def test_the_verification_sees_changes_at_seams(circle):
    trajectory = circle.trajectory
    for name, what in (
        ("q", "position"),
        ("qdot", "velocity"),
        ("qddot_before", "acceleration"),
    ):
        array = np.array(getattr(trajectory, name))
        array[-1] += 1e-3
        assert f"{what} over the seam" in failed_checks(
            replace(trajectory, **{name: array})
        )


def test_closed_path_of_joints():
    """Around an ellipse of two joints: the timing alone closes."""

    def ellipse(angle):
        return [
            0.3 * np.cos(angle),
            0.5,
            0.2 * np.sin(angle),
            -1.2,
            0.0,
            0.6 + 0.1 * np.sin(angle),
            0.0,
        ]

    task = {
        "brachis": 1,
        "robot": {"urdf": str(IIWA), "limits": {"acceleration": 5.0}},
        "start": {"joints": ellipse(0.0)},
        "task_space": "joints",
        "path": [brachis.bspline_segment(ellipse, (0.0, 2.0 * np.pi), tolerance=1e-12)],
        "boundary": {"periodic": True},
    }
    round_and_round, once = brachis.plan(task), brachis.plan({**task, "boundary": {}})
    assert round_and_round.verified
    assert round_and_round.t_end < 0.95 * once.t_end


@pytest.mark.parametrize("rest", ["velocity", "full"])
def test_speeds_at_both_ends_with_redundancy(rest):
    speeds = {"start_speed": 0.2, "end_speed": 0.5}
    path = [{"line": {"length": 0.6, "angle_deg": 90}}]
    spline = {"intervals": 12, "rest": rest}
    task = variant(
        path=path, boundary=speeds, spline=spline, redundant_joints=["j1"], search=QUICK
    )
    result = brachis.plan(task)
    assert result.verified
    model, trajectory = result.trajectory.robot.model, result.trajectory
    data, frame = model.createData(), result.trajectory.robot.frame_id
    for time, speed in zip((0.0, result.t_end), speeds.values(), strict=True):
        pin.forwardKinematics(
            model, data, trajectory.position(time), trajectory.velocity(time)
        )
        found = pin.getFrameVelocity(
            model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        ).linear
        assert_allclose(found, [0.0, speed, 0.0], atol=1e-9)
    assert result.t_end < brachis.plan({**task, "boundary": {}}).t_end
    faster = replace(
        trajectory,
        task=brachis.load_task({**task, "boundary": {**speeds, "end_speed": 0.501}}),
    )
    assert failed_checks(faster) == {"end speed"}


def test_a_turn_on_the_spot_ends_at_an_angular_speed():
    path, boundary = [{"line": {"by": [0.0, 0.0, 0.5]}}], {"end_speed": 0.3}
    task = variant(
        task_space=["x", "y", "yaw"],
        path=path,
        boundary=boundary,
        search=QUICK,
        spline={"intervals": 12},
    )
    result = brachis.plan(task)
    assert result.verified
    assert result.trajectory.velocity(result.t_end).sum() == pytest.approx(
        0.3, abs=1e-9
    )


def test_path_of_joints_with_speeds_takes_as_long_as_in_toppra():
    pytest.importorskip("toppra")
    waypoints = np.random.default_rng(3).uniform(-1.0, 1.0, (4, 7))
    task = {
        "brachis": 1,
        "robot": {"urdf": str(IIWA), "limits": {"acceleration": 10.0}},
        "start": {"joints": waypoints[0]},
        "task_space": "joints",
        "path": [{"spline": {"through": waypoints[1:]}}],
        "boundary": {"start_speed": 0.8, "end_speed": 1.0},
        "spline": {"intervals": 120, "rest": "velocity"},
        "search": {"least_motion": False},
    }
    result = brachis.plan(task)
    assert result.verified
    least = toppra_time(result)
    assert result.t_end == pytest.approx(least, rel=3e-3)


def toppra_time(result):
    import importlib.util

    spec = importlib.util.spec_from_file_location(
        "from_toppra", ROOT / "examples/11_from_toppra.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    robot = result.trajectory.robot
    ends = result.task.boundary
    return module.by_toppra(
        robot,
        *module.joint_points(robot, result.task),
        speeds=(ends.start_speed, ends.end_speed),
    )


REFUSED = [
    (
        {"path": [{"line": {"length": 0.6, "angle_deg": 90}}]},
        "the path does not close; found 0.6 m off in y",
    ),
    (
        {"path": [{"circle": {"center": [1.4, 0.0], "turns": 1.25}}]},
        "the path does not close",
    ),
    (
        {"boundary": {"periodic": True, "end_speed": 0.1}},
        r"boundary.end_speed: a periodic motion has no ends",
    ),
    (
        {"end": {"joints": [0, 0, 0]}},
        "end: the end posture of a periodic motion is its start posture",
    ),
    (
        {"spline": {"knots": "free", "intervals": 10}},
        "spline.knots: free knots need a motion that begins and ends at rest",
    ),
    ({"boundary": {"start_speed": -0.1}}, "boundary.start_speed"),
]


@pytest.mark.parametrize(("changes", "words"), REFUSED)
def test_what_is_an_error(changes, words):
    with pytest.raises(brachis.BrachisError, match=words):
        brachis.plan(variant(**changes))


def test_a_corner_at_the_seam_is_an_error():
    corners = [
        {"line": {"by": [0.2, 0.0]}, "blend": 0.05},
        {"line": {"by": [0.0, 0.2]}, "blend": 0.05},
    ]
    with pytest.raises(
        brachis.BrachisError, match=r"the path's tangent jumps where it closes"
    ):
        brachis.plan(variant(path=[*corners, {"line": {"by": [-0.2, -0.2]}}]))


def test_a_motion_that_does_not_end_at_rest_has_no_posture_to_hold(circle):
    with pytest.raises(brachis.InputError, match="does not end at rest"):
        circle.trajectory.sample(0.01, last="hold")


LINK = """<link name="l{0}"><inertial><origin xyz="0.2 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j{0}" type="{1}"><parent link="{2}"/><child link="l{0}"/><origin xyz="{3} 0 0"/><axis xyz="0 0 1"/>
<limit effort="60" velocity="4" lower="-7" upper="7"/></joint>"""


@pytest.mark.parametrize("kind", ["continuous", "revolute"])
def test_a_circle_round_the_arm_closes_if_joints_turn_freely(tmp_path, kind):
    """A joint makes a whole turn, which one with a range cannot repeat."""
    links = [LINK.format(i, kind, f"l{i - 1}", 0.4 * (i > 1)) for i in (1, 2, 3)]
    tool = (
        '<link name="tool"/><joint name="jt" type="fixed"><parent link="l3"/>'
        '<child link="tool"/><origin xyz="0.4 0 0"/></joint>'
    )
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(
        f'<robot name="arm"><link name="l0"/>{"".join(links)}{tool}</robot>'
    )
    task = {
        "brachis": 1,
        "robot": {"urdf": str(urdf)},
        "start": "free",
        "path_start": [0.93, 0.3],
        "task_space": ["x", "y"],
        "path": [{"circle": {"center": [0.3, 0.3]}}],
        "boundary": {"periodic": True},
        "spline": {"intervals": 16},
        "search": QUICK | {"time_limit": 4.0},
    }
    result = brachis.plan(task, strict=False)
    turned = result.trajectory.position(result.t_end) - result.trajectory.position(0.0)
    turns = np.abs(turned) / (2.0 * np.pi)
    assert turns.max() > 0.9
    assert turns == pytest.approx(turns.round(), abs=1e-9)
    assert failed_checks(result.trajectory) == (
        set() if kind == "continuous" else {"position over the seam"}
    )
    assert result.verified == (kind == "continuous")
