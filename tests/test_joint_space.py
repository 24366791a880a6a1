"""Paths of joints from the task to the verified motion: beside toppra, under every limit, saved, tampered with."""

from __future__ import annotations

import importlib
import importlib.util
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

import brachis
from brachis.apps.bottleneck import check_sensitivities, plan_again
from brachis.errors import InputError, PathError, StartError
from brachis.robot import dynamics
from brachis.task import LimitSpec, task_with
from support.chains import Joint, chain_urdf, planar_robot
from support.effort import QUICK

ROOT = Path(__file__).parents[1]
IIWA = ROOT / "robots/iiwa14/robot.urdf"
SEEDS = (41, 54)
"""Cases in which velocity, acceleration and torque limits are all active."""
WAYPOINTS = np.random.default_rng(3).uniform(-1.0, 1.0, (4, 7))


def task(path=None, *, limits=None, **more):
    return {
        "brachis": 1,
        "robot": {
            "urdf": str(IIWA),
            "limits": {"acceleration": 10.0, **(limits or {})},
        },
        "start": {"joints": WAYPOINTS[0]},
        "task_space": "joints",
        "path": path or [{"spline": {"through": WAYPOINTS[1:]}}],
        "spline": {"intervals": 20},
        "search": {"least_motion": False},
        **more,
    }


@pytest.fixture(scope="module")
def bench():
    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        yield importlib.import_module("joint_paths")
    finally:
        sys.path.remove(str(ROOT / "benchmarks"))


@pytest.fixture(scope="module")
def example():
    spec = importlib.util.spec_from_file_location(
        "from_toppra", ROOT / "examples/11_from_toppra.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def joint_motion():
    return brachis.plan(task())


@pytest.mark.parametrize("seed", SEEDS)
def test_end_time_is_that_of_toppra(bench, example, seed):
    pytest.importorskip("toppra")
    result = brachis.plan(bench.case(seed, intervals=150))
    assert result.verified
    least = example.by_toppra(
        result.trajectory.robot,
        *example.joint_points(result.trajectory.robot, result.task),
    )
    assert result.t_end == pytest.approx(least, rel=3e-3)


def test_result_is_verified_and_follows_the_path(joint_motion):
    assert joint_motion.verified
    assert joint_motion.verification.path_error <= 1e-9
    assert joint_motion.trajectory.redundant_joints == ()
    assert joint_motion.family == "path of joints"
    assert_allclose(joint_motion.trajectory.position(0.0), WAYPOINTS[0], atol=1e-12)
    assert_allclose(
        joint_motion.trajectory.position(joint_motion.t_end), WAYPOINTS[-1], atol=1e-12
    )


def test_a_spline_of_scipys_is_the_path():
    from scipy.interpolate import make_interp_spline

    curve = make_interp_spline(
        np.linspace(0.0, 3.0, 6), np.vstack([WAYPOINTS, WAYPOINTS[:2]]), k=5
    )
    result = brachis.plan(task([brachis.bspline_segment(curve)]))
    assert result.verified
    u = 3.0 * result.trajectory.path_coordinate(1.0)
    assert_allclose(result.trajectory.position(1.0), curve(u), atol=1e-9)


@pytest.mark.parametrize(
    "spline",
    [{"intervals": "auto", "tolerance": 0.01}, {"intervals": 6, "knots": "free"}],
)
def test_calmest_motion_auto_intervals_and_free_knots(spline):
    result = brachis.plan(task(spline=spline, search={"least_motion": True}))
    assert result.verified


def test_paths_beyond_a_limit_at_rest_are_refused_with_their_place():
    with pytest.raises(
        brachis.BrachisError,
        match=r"'joint_2' is out of its range; found 3 rad at s = 1",
    ):
        brachis.plan(task([{"line": {"to": [0, 3.0, 0, 0, 0, 0, 0]}}]))
    weak = {"torque": {"joint_2": 40.0}}
    with pytest.raises(
        brachis.BrachisError, match=r"torque limit of 'joint_2' .* Nm at s = .*40 N"
    ):
        brachis.plan(
            task(
                [{"line": {"to": [0, 1.6, 0, 0, 0, 0, 0]}}],
                start={"joints": [0.0] * 7},
                limits=weak,
            )
        )


def test_momentum_carries_an_arm_through_postures_that_it_cannot_hold():
    """A pendulum that needs 6.2 Nm to be held level, from its lowest to its highest position, which takes 12.4 J."""
    task = {
        "brachis": 1,
        "start": {"joints": [-1.5]},
        "task_space": "joints",
        "path": [{"line": {"to": [1.5]}}],
        "spline": {"intervals": 20},
        "search": {"least_motion": False},
    }
    strong, weak = (
        planar_robot("R", "xz", limits=LimitSpec(torque=torque))
        for torque in (5.5, 3.0)
    )
    assert np.abs(dynamics.torque(strong, *np.zeros((3, 1, 1)))).max() > 6.0
    assert brachis.plan(strong, task).verified
    with pytest.raises(
        brachis.BrachisError,
        match=r"torque limit of 'j1' cannot hold the arm against gravity",
    ):
        brachis.plan(weak, task)


def test_an_end_beside_the_path_is_an_error():
    with pytest.raises(
        brachis.BrachisError, match=r"end posture is off the path.*in joint joint_3"
    ):
        brachis.plan(task(end={"joints": WAYPOINTS[-1] + [0, 0, 1e-3, 0, 0, 0, 0]}))


def test_sensitivities_are_those_of_solving_again(joint_motion):
    found = check_sensitivities(
        joint_motion.candidate.refined, joint_motion.sensitivities
    )
    assert found.larger()
    assert found.worst_deviation() < 0.05


def test_bottlenecks_of_the_saved_motion_are_those_of_the_plan(joint_motion, tmp_path):
    joint_motion.trajectory.save(tmp_path / "motion.npz")
    again = plan_again(brachis.Trajectory.load(tmp_path / "motion.npz"))
    assert again.t_end == pytest.approx(joint_motion.t_end, rel=1e-4)


@pytest.mark.parametrize(("row", "excess"), [(0, 1e-8), (1, 5e-5), (2, 1e-8)])
def test_a_path_of_joints_may_leave_a_range_within_the_tolerance(row, excess):
    robot = brachis.robots.iiwa14
    waypoints = np.array([0.0, 0.3, 0.0, -1.2, 0.0, 0.6, 0.0]) * np.ones((3, 1))
    waypoints[:, 0] = (
        robot.limits.position_upper[0] + excess - 0.4 * np.abs(np.arange(3) - row)
    )
    result = brachis.plan(
        robot,
        path=waypoints,
        task_space="joints",
        intervals=8,
        effort="single",
        least_motion=False,
    )
    assert result.verified
    assert result.trajectory.q[:, 0].max() == pytest.approx(
        robot.limits.position_upper[0] + excess, abs=1e-7
    )


@pytest.mark.parametrize("excess", [1.01e-4, 2e-4, 0.1])
def test_beyond_the_tolerance_the_message_tells_the_numbers_apart(excess):
    robot = brachis.robots.iiwa14
    waypoints = np.array([0.0, 0.3, 0.0, -1.2, 0.0, 0.6, 0.0]) * np.ones((2, 1))
    waypoints[1, 0] = robot.limits.position_upper[0] + excess
    with pytest.raises(PathError, match=r"joint_1.*out of its range") as caught:
        brachis.plan(robot, path=waypoints, task_space="joints")
    assert float(caught.value.found.split()[0]) > float(
        caught.value.allowed.split()[-2]
    )
    with pytest.raises(StartError, match="joint_1") as caught:
        brachis.plan(robot, path=waypoints[::-1], task_space="joints")
    assert float(caught.value.found.split()[0]) > float(
        caught.value.allowed.split()[-2]
    )


def test_a_start_posture_may_leave_its_range_and_exceed_its_torque_within_the_tolerance():
    robot, start = brachis.robots.gen3, np.array([0.0, 1.2, 0.0, 1.2, 0.0, 0.6, 0.0])
    need = abs(
        dynamics.torque(robot, start[None], 0 * start[None], 0 * start[None])[0, 1]
    )
    line = {
        "path": brachis.Line(by=[-0.02, 0.0, 0.05]),
        "task_space": "position",
        "intervals": 8,
    }
    line |= {"search": {**QUICK, "guesses": "numeric"}}
    within = {
        "torque": {"joint_2": need * (1 - 5e-5)},
        "position": {"joint_4": [-2.0, 1.2 - 5e-5]},
    }
    assert brachis.plan(robot, limits=within, start=start, **line).verified
    with pytest.raises(StartError, match="cannot hold the arm"):
        brachis.plan(
            robot,
            limits={"torque": {"joint_2": need * (1 - 2e-4)}},
            start=start,
            check_advice=False,
            **line,
        )


def test_the_first_waypoint_may_be_the_start(tmp_path):
    line = {
        "task_space": "joints",
        "intervals": 8,
        "effort": "single",
        "least_motion": False,
    }
    rest = brachis.Spline(through=WAYPOINTS[1:])
    asked = brachis.plan("iiwa14", path=rest, start=WAYPOINTS[0], **line)
    for path in (WAYPOINTS, WAYPOINTS.tolist(), brachis.Spline(through=WAYPOINTS)):
        for start in ({}, {"start": WAYPOINTS[0]}, {"start": WAYPOINTS[0].round(5)}):
            task = task_with(path=path, **start, **line)
            assert np.allclose(task.start.joints, WAYPOINTS[0], rtol=0, atol=1e-5)
    given = brachis.plan("iiwa14", path=WAYPOINTS, **line)
    assert given.t_end == pytest.approx(asked.t_end, rel=1e-9)
    content = {
        "brachis": 1,
        "robot": {"urdf": str(IIWA)},
        "task_space": "joints",
        "path": WAYPOINTS.tolist(),
    }
    (tmp_path / "task.yaml").write_text(json.dumps(content))
    task = brachis.load_task(tmp_path / "task.yaml")
    assert task.start.joints == tuple(WAYPOINTS[0])
    assert brachis.load_task(task.to_dict()) == task


def test_a_table_of_joints_in_any_order_has_its_start(tmp_path):
    names = brachis.robots.iiwa14.joint_names
    order = [1, 0, 2, 3, 4, 5, 6]
    rows = [
        ",".join(names[i] for i in order),
        *(",".join(map(str, row)) for row in WAYPOINTS[:, order].tolist()),
    ]
    (tmp_path / "joints.csv").write_text("\n".join(rows))
    for start in ({}, {"start": "free"}):
        task = task_with(
            path={"csv": {"file": str(tmp_path / "joints.csv")}},
            task_space="joints",
            **start,
        )
        assert task.start.joints == dict(
            zip(np.array(names)[order], WAYPOINTS[0, order], strict=True)
        )


def test_waypoints_that_begin_elsewhere_are_errors():
    with pytest.raises(PathError, match=r"starts elsewhere.*rad or m off"):
        brachis.plan(
            "iiwa14", path=WAYPOINTS[1:], start=WAYPOINTS[0], task_space="joints"
        )


@pytest.mark.parametrize("space", ["pose", "joints"])
def test_a_turn_of_one_joint_is_answered_with_a_path_of_joints(space, tmp_path):
    limit = {"lower": -3.0, "upper": 3.0, "velocity": 3.0, "effort": 20.0}
    (tmp_path / "turntable.urdf").write_text(
        chain_urdf([Joint("revolute", axis=(0.0, 0.0, 1.0), limit=limit)])
    )
    turn = {"turn": {"rotate": {"axis": [0, 0, 1], "angle_deg": 90}}}
    with pytest.raises(InputError, match=r"line: {by: \[[0-9.]+\]}") as caught:
        brachis.plan(
            tmp_path / "turntable.urdf", path=turn, start=[0.0], task_space=space
        )
    advice = re.search(r"{by: \[[0-9.]+\]}", str(caught.value))
    line = {"line": yaml.safe_load(advice[0])}
    result = brachis.plan(
        tmp_path / "turntable.urdf",
        path=line,
        start=[0.0],
        task_space="joints",
        intervals=8,
    )
    assert result.verified


def test_a_bspline_of_seven_joints_is_no_pose():
    rows = np.linspace(
        [0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0], [0.3, 0.5, 0.1, -0.3, 0.1, 0.2, 0.1], 6
    )
    curve = {
        "degree": 5,
        "knots": [0.0] * 6 + [1.0] * 6,
        "control_points": rows.tolist(),
    }
    asked = brachis.load_task(
        {"brachis": 1, "task_space": "joints", "path": [{"bspline": curve}]}
    )
    assert_array_equal(asked.start.joints, rows[0])
