"""Paths of joints from the task to the verified motion: beside toppra, under every limit, saved, tampered with."""

import re

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import make_interp_spline

import brachis
from brachis.apps.bottleneck import check_sensitivities, plan_again
from brachis.errors import InputError, PathError, StartError
from brachis.robot import dynamics
from brachis.task import LimitSpec, task_with
from support.chains import Joint, chain_urdf, planar_robot
from support.effort import QUICK
from support.scripts import load_script

SEEDS = (41, 54)
"""Cases in which velocity, acceleration and torque limits are all active."""
WAYPOINTS = np.random.default_rng(3).uniform(-1.0, 1.0, (4, 7))
REST = np.array([0.0, 0.3, 0.0, -1.2, 0.0, 0.6, 0.0])


BRIEF = {"task_space": "joints", "least_motion": False}
LINE = {
    "limits": {"acceleration": 10.0},
    "start": WAYPOINTS[0],
    "path": brachis.Spline(through=WAYPOINTS[1:]),
    "intervals": 20,
    **BRIEF,
}
SHORT = {"intervals": 8, "effort": "single", **BRIEF}


def plan(**changes):
    return brachis.plan("iiwa14", **{**LINE, **changes})


@pytest.fixture(scope="module")
def joint_motion():
    return plan()


@pytest.mark.parametrize("seed", SEEDS)
def test_end_time_is_that_of_toppra(bench, seed):
    pytest.importorskip("toppra")
    result = brachis.plan(bench("joint_paths").case(seed, intervals=150))
    assert result.verified
    example = load_script("examples/11_from_toppra.py")
    robot = result.trajectory.robot
    least = example.by_toppra(robot, *example.joint_points(robot, result.task))
    assert result.t_end == pytest.approx(least, rel=3e-3)


def test_result_is_verified_and_follows_the_path(joint_motion):
    assert joint_motion.verified
    assert joint_motion.verification.path_error <= 1e-9
    assert joint_motion.trajectory.redundant_joints == ()
    assert joint_motion.family == "path of joints"
    ends = joint_motion.trajectory.position([0.0, joint_motion.t_end])
    assert_allclose(ends, WAYPOINTS[[0, -1]], atol=1e-12)


def test_a_spline_of_scipys_is_the_path():
    points = np.vstack([WAYPOINTS, WAYPOINTS[:2]])
    curve = make_interp_spline(np.linspace(0.0, 3.0, 6), points, k=5)
    result = plan(path=[brachis.bspline_segment(curve)])
    assert result.verified
    u = 3.0 * result.trajectory.path_coordinate(1.0)
    assert_allclose(result.trajectory.position(1.0), curve(u), atol=1e-9)


@pytest.mark.parametrize(
    "spline", [{"intervals": "auto"}, {"intervals": 6, "knots": "free"}]
)
def test_calmest_motion_auto_intervals_and_free_knots(spline):
    assert plan(**spline, least_motion=True).verified


@pytest.mark.parametrize(
    "changes, reason",
    [
        (
            {"path": brachis.Line(to=[0, 3.0, 0, 0, 0, 0, 0])},
            r"'joint_2' is out of its range; found 3 rad at s = 1",
        ),
        (
            {
                "path": brachis.Line(to=[0, 1.6, 0, 0, 0, 0, 0]),
                "start": [0.0] * 7,
                "limits": {"torque": {"joint_2": 40.0}},
            },
            r"torque limit of 'joint_2' .* Nm at s = .*40 N",
        ),
        (
            {"end": WAYPOINTS[-1] + [0, 0, 1e-3, 0, 0, 0, 0]},
            r"end posture is off the path.*in joint joint_3",
        ),
    ],
    ids=["range", "torque", "end beside the path"],
)
def test_paths_beyond_a_limit_at_rest_are_refused_with_their_place(changes, reason):
    with pytest.raises(brachis.BrachisError, match=reason):
        plan(**changes)


def test_momentum_carries_an_arm_through_postures_that_it_cannot_hold():
    """A pendulum that needs 6.2 Nm to be held level, from its lowest to its highest position, which takes 12.4 J."""
    line = brachis.Line(to=[1.5])
    swing = {"start": [-1.5], "path": line, "intervals": 20, **BRIEF}
    strong, weak = (
        planar_robot("R", "xz", limits=LimitSpec(torque=torque))
        for torque in (5.5, 3.0)
    )
    assert np.abs(dynamics.torque(strong, *np.zeros((3, 1, 1)))).max() > 6.0
    assert brachis.plan(strong, **swing).verified
    reason = r"torque limit of 'j1' cannot hold the arm against gravity"
    with pytest.raises(brachis.BrachisError, match=reason):
        brachis.plan(weak, **swing)


def test_sensitivities_are_those_of_solving_again(joint_motion):
    refined = joint_motion.candidate.refined
    found = check_sensitivities(refined, joint_motion.sensitivities)
    assert found.larger()
    assert found.worst_deviation() < 0.05


def test_bottlenecks_of_the_saved_motion_are_those_of_the_plan(joint_motion, tmp_path):
    joint_motion.trajectory.save(tmp_path / "motion.npz")
    again = plan_again(brachis.Trajectory.load(tmp_path / "motion.npz"))
    assert again.t_end == pytest.approx(joint_motion.t_end, rel=1e-4)


@pytest.mark.parametrize("row, excess", [(0, 1e-8), (1, 5e-5), (2, 1e-8)])
def test_a_path_of_joints_may_leave_a_range_within_the_tolerance(row, excess):
    upper = brachis.robots.iiwa14.limits.position_upper[0]
    waypoints = np.tile(REST, (3, 1))
    waypoints[:, 0] = upper + excess - 0.4 * np.abs(np.arange(3) - row)
    result = brachis.plan("iiwa14", path=waypoints, **SHORT)
    assert result.verified
    highest = result.trajectory.q[:, 0].max()
    assert highest == pytest.approx(upper + excess, abs=1e-7)


@pytest.mark.parametrize("excess", [1.01e-4, 0.1])
@pytest.mark.parametrize("end, kind", [(1, PathError), (0, StartError)])
def test_beyond_the_tolerance_the_message_tells_the_numbers_apart(excess, end, kind):
    waypoints = np.tile(REST, (2, 1))
    waypoints[end, 0] = brachis.robots.iiwa14.limits.position_upper[0] + excess
    with pytest.raises(kind, match=r"joint_1.*out of its range") as caught:
        brachis.plan("iiwa14", path=waypoints, task_space="joints")
    error = caught.value
    assert float(error.found.split()[0]) > float(error.allowed.split()[-2])


def test_a_start_posture_may_leave_its_range_and_exceed_its_torque_within_the_tolerance():
    robot, start = brachis.robots.gen3, np.array([0.0, 1.2, 0.0, 1.2, 0.0, 0.6, 0.0])
    rest = np.zeros((1, 7))
    load = abs(dynamics.torque(robot, start[None], rest, rest)[0, 1])
    line = {
        "path": brachis.Line(by=[-0.02, 0.0, 0.05]),
        "task_space": "position",
        "intervals": 8,
        "search": {**QUICK, "guesses": "numeric"},
        "start": start,
    }
    within = {
        "torque": {"joint_2": load * (1 - 5e-5)},
        "position": {"joint_4": [-2.0, 1.2 - 5e-5]},
    }
    assert brachis.plan(robot, limits=within, **line).verified
    beyond = {"torque": {"joint_2": load * (1 - 2e-4)}}
    with pytest.raises(StartError, match="cannot hold the arm"):
        brachis.plan(robot, limits=beyond, check_advice=False, **line)


def test_the_first_waypoint_may_be_the_start(tmp_path):
    beyond = brachis.Spline(through=WAYPOINTS[1:])
    expected = brachis.plan("iiwa14", path=beyond, start=WAYPOINTS[0], **SHORT)
    for path in (WAYPOINTS, WAYPOINTS.tolist(), brachis.Spline(through=WAYPOINTS)):
        for start in ({}, {"start": WAYPOINTS[0]}, {"start": WAYPOINTS[0].round(5)}):
            task = task_with(path=path, **start, **SHORT)
            assert np.allclose(task.start.joints, WAYPOINTS[0], rtol=0, atol=1e-5)
    result = brachis.plan("iiwa14", path=WAYPOINTS, **SHORT)
    assert result.t_end == pytest.approx(expected.t_end, rel=1e-9)
    text = f"""
    brachis: 1
    robot: {{urdf: iiwa14}}
    task_space: joints
    path: {WAYPOINTS.tolist()}
    """
    (tmp_path / "task.yaml").write_text(text)
    task = brachis.load_task(tmp_path / "task.yaml")
    assert task.start.joints == tuple(WAYPOINTS[0])
    assert brachis.load_task(task.to_dict()) == task


def test_a_table_of_joints_in_any_order_has_its_start(tmp_path):
    order = [1, 0, 2, 3, 4, 5, 6]
    names = np.array(brachis.robots.iiwa14.joint_names)[order]
    file = tmp_path / "joints.csv"
    header = ",".join(names)
    np.savetxt(file, WAYPOINTS[:, order], "%.17g", ",", header=header, comments="")
    for start in ({}, {"start": "free"}):
        path = {"csv": {"file": str(file)}}
        task = task_with(path=path, task_space="joints", **start)
        expected = dict(zip(names, WAYPOINTS[0, order], strict=True))
        assert task.start.joints == expected


def test_waypoints_that_begin_elsewhere_are_errors():
    with pytest.raises(PathError, match=r"does not start where.*rad or m off"):
        brachis.plan(
            "iiwa14", path=WAYPOINTS[1:], start=WAYPOINTS[0], task_space="joints"
        )


@pytest.mark.parametrize("space", ["pose", "joints"])
def test_a_turn_of_one_joint_is_answered_with_a_path_of_joints(space, tmp_path):
    limit = {"lower": -3.0, "upper": 3.0, "velocity": 3.0, "effort": 20.0}
    urdf = tmp_path / "turntable.urdf"
    urdf.write_text(chain_urdf([Joint("revolute", limit=limit)]))
    turn = {"turn": {"rotate": {"axis": [0, 0, 1], "angle_deg": 90}}}
    with pytest.raises(InputError, match=r"line: {by: \[[0-9.]+\]}") as caught:
        brachis.plan(urdf, path=turn, start=[0.0], task_space=space)
    advice = re.search(r"{by: \[[0-9.]+\]}", str(caught.value))
    line = {"line": yaml.safe_load(advice[0])}
    result = brachis.plan(
        urdf, path=line, start=[0.0], task_space="joints", intervals=8
    )
    assert result.verified


def test_a_bspline_of_seven_joints_is_no_pose():
    first = [0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0]
    rows = np.linspace(first, [0.3, 0.5, 0.1, -0.3, 0.1, 0.2, 0.1], 6)
    knots = [0.0] * 6 + [1.0] * 6
    curve = {"degree": 5, "knots": knots, "control_points": rows.tolist()}
    task = task_with(task_space="joints", path=[{"bspline": curve}])
    assert_array_equal(task.start.joints, first)
