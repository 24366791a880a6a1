"""Tolerances of the tool: its virtual joints, the limits beside their ranges, and motions that use them."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

import brachis
from brachis.errors import PathError, TaskError
from brachis.limits import Label, Moments, limits_of
from brachis.limits.tool import SpeedProfile, ToolMotionLimit
from brachis.robot import bind
from brachis.search.given_motion import EXACT, GIVEN
from brachis.search.portfolio import Search
from brachis.task import Tolerances, task_with
from brachis.trajectory.samples import tool_motion
from support.checks import check_of
from support.spatial import START, rail_arm

EVERYTHING = yaml.safe_load("""
orientation: {tilt: 15, roll: [-30, 40]}
position: {sphere: 0.004, x: 0.002, y: [-0.001, 0.003], z: [-0.002, 0.001], axes: world}
""")


def task_of(tolerances, space="pose"):
    by = [0.1, 0.2, 0.0][: 2 if space == ["x", "y"] else 3]
    return task_with(
        start=START, task_space=space, path=brachis.Line(by=by), tolerances=tolerances
    )


def robot_with(tolerances):
    return bind(rail_arm(), "pose", Tolerances(**tolerances))[0]


def test_virtual_joints_have_the_ranges_of_the_task():
    robot = robot_with(EVERYTHING)
    names = [f"tool_{name}" for name in ("roll", "lead", "side", "x", "y", "z")]
    assert list(robot.joint_names[-6:]) == names
    # A cone is as wide all around; a box in the world's axes fits into its own sphere, and into the one that is given.
    reach = 1.01 * min(0.004, np.linalg.norm([0.002, 0.003, 0.002]))
    tilt = 1.01 * np.radians(15)
    expected = [np.radians(40), tilt, tilt, reach, reach, reach]
    assert_allclose(robot.limits.position_upper[-6:], expected)
    assert_allclose(robot.limits.position_lower[-6], np.radians(-30))


def test_positions_of_virtual_joints_are_how_far_the_tool_is_from_the_path():
    robot = robot_with(EVERYTHING)
    count = len(START)
    side, lead, roll = -0.1, 0.15, 0.3
    shift = np.array([0.001, -0.002, 0.003])
    q = np.array([*START, roll, lead, side, *shift])
    path = robot.tool_placement(q)
    tool = rail_arm().tool_placement(q[:count])
    turn = pin.rpy.rpyToMatrix
    expected = (
        path
        * pin.SE3(np.eye(3), shift)
        * pin.SE3(turn(-side, 0.0, 0.0), np.zeros(3))
        * pin.SE3(turn(0.0, lead, 0.0), np.zeros(3))
        * pin.SE3(turn(0.0, 0.0, roll), np.zeros(3))
    )
    assert tool.isApprox(expected, 1e-12)
    # The tool's axis leans towards x for a positive lead, and towards y for a positive side.
    axis = (path.rotation.T @ tool.rotation)[:, 2]
    assert_allclose(axis[:2], [np.sin(lead), np.sin(side) * np.cos(lead)])


def test_limits_and_samples_are_those_of_the_real_tool():
    robot = robot_with(EVERYTHING)
    arm = rail_arm()
    rng = np.random.default_rng(2)
    states = rng.normal(size=(3, 5, robot.n))
    arm_states = [curve[:, : arm.n] for curve in states]
    moving = Moments(*states, states[0], np.zeros(5))
    for quantity in ("speed", "angular speed", "acceleration"):
        expected = arm.chain.tool_sizes(quantity, *arm_states)
        label = Label("tool", quantity, "-")
        limit = ToolMotionLimit(robot, quantity, [SpeedProfile([0.0], [1.0])], [label])
        assert_allclose(limit.values(moving)[:, 0], expected, rtol=1e-12)
        partials = limit.partials(moving)
        for slopes in (partials.q, partials.qdot):
            assert slopes.any()
            assert not slopes[..., arm.n :].any()
        assert (partials.qddot is not None) == (quantity == "acceleration")
    position, _, speed = tool_motion(robot, states[0], states[1])
    assert_allclose(position, arm.tool_placements(arm_states[0])[0], atol=1e-12)
    assert_allclose(speed, arm.chain.tool_sizes("speed", *arm_states), rtol=1e-9)


@pytest.mark.parametrize("kind", ["tool_tilt", "tool_distance", "tool_range"])
def test_slopes_are_those_of_differences(kind):
    robot = robot_with(EVERYTHING)
    every = limits_of(robot, task_of(EVERYTHING))
    (limit,) = [each for each in every if each.kind == kind]
    rng = np.random.default_rng(1)
    q = np.concatenate([rng.normal(size=(9, 7)), 0.01 * rng.normal(size=(9, 6))], 1)
    found = limit.partials(Moments.at_rest(q)).q
    for joint in range(robot.n):
        step = 1e-6 * np.eye(robot.n)[joint]
        ends = [limit.values(Moments.at_rest(q + sign * step)) for sign in (1, -1)]
        by_difference = (ends[0] - ends[1]) / 2e-6
        assert_allclose(found[:, :, joint], by_difference, atol=1e-5)


def test_a_posture_without_virtual_joints_is_as_near_to_the_path_as_ranges_allow():
    robot = robot_with({"orientation": {"lead": [5, 15]}, "position": {"x": 0.01}})
    q = robot.posture(list(START), "start")
    assert_allclose(q[-2:], [np.radians(5), 0.0])
    named = robot.posture(dict(zip(robot.joint_names, START, strict=False)), "start")
    assert_array_equal(named, q)


@pytest.mark.parametrize(
    "tolerances, space, match",
    [
        ("orientation: {tilt: 15}", "position", "prescribe the orientation"),
        ("position: {sphere: 0.1}", ["x", "y"], "no tolerances of the position"),
        ("orientation: {roll: 5}", "pose_free_roll", "roll is free"),
        ("orientation: {lead: [5, 2]}", "pose", "not a valid range"),
        ("orientation: {lead: 100}", "pose", "within 80 of zero"),
        ("tilt: 15", "pose", "tolerances.orientation.tilt"),
        ("position: {sphere: 0.1, y: 0.1, axes: world}", "pose", "all three ranges"),
        ("position: {sphere: 0.1, x: [0.2, 0.3]}", "pose", "outside sphere"),
        ("orientation: {tilt: 15, lead: [20, 30]}", "pose", "outside tilt"),
    ],
)
def test_tolerances_that_make_no_sense_are_errors(tolerances, space, match):
    with pytest.raises(TaskError, match=match):
        task_of(yaml.safe_load(tolerances), space)


def test_free_roll_is_a_tolerance():
    word, _ = bind(rail_arm(), "pose_free_roll")
    range_, _ = bind(rail_arm(), "pose", Tolerances(orientation={"roll": "free"}))
    assert word.tool_joints == range_.tool_joints


TILTED = {
    "locked_joints": {"rail": 0.0},
    "start": [0.5, 0.4, 1.3, 0.0, np.pi / 2 - 0.13, 0.3],
    "task_space": "pose",
    "path": brachis.Line(by=[0.1, -0.3, 0.05]),
    "intervals": 12,
    "rest": "velocity",
    "least_motion": False,
}


@pytest.fixture(scope="module")
def leaning():
    """The same task, without and with a lead."""
    lead = {"orientation": {"lead": [-5, 10]}}
    return [
        brachis.plan("tx90l_rail", **TILTED, **changes)
        for changes in ({}, {"tolerances": lead})
    ]


def test_a_tool_that_may_lean_is_faster_and_stays_within_its_range(leaning):
    """Angles by Pinocchio, from the joints of the arm and the path alone."""
    plain, result = leaning
    assert plain.verified
    assert result.verified
    assert result.t_end < 0.99 * plain.t_end
    trajectory = result.trajectory
    t = np.linspace(0.0, result.t_end, 400)
    arm = plain.trajectory.robot
    q = trajectory.position(t)
    _, rotations = arm.tool_placements(q[:, : arm.n])
    s = trajectory.path_coordinate(t)
    wanted = arm.tool_placements(np.array([plain.trajectory.position(0.0)]))[1][0]
    assert np.ptp(s) == pytest.approx(1.0)
    axis = rotations[:, :, 2] @ wanted  # the orientation stays the same along the path
    lead = np.degrees(np.arcsin(axis[:, 0]))
    assert lead.min() >= -5.001
    assert lead.max() <= 10.001
    assert np.abs(axis[:, 1]).max() < 1e-6
    assert_allclose(np.radians(lead), q[:, -1], atol=1e-6)


def test_a_plan_starts_from_the_motion_without_tolerances(leaning):
    plain, result = leaning
    assert result.candidate.origin == EXACT
    again = brachis.plan(result.task, start_from=plain)
    assert again.candidate.origin == GIVEN
    assert again.t_end == pytest.approx(result.t_end, rel=1e-9)
    found = brachis.plan(result.task, effort="exhaustive")
    assert len(found.candidates) > 1
    assert found.t_end <= result.t_end


def test_if_the_time_is_up_the_motion_without_tolerances_is_not_lost(
    leaning, monkeypatch
):
    plain, result = leaning
    whole = Search.run

    def run(search, known=None, exact=None):
        """Find nothing in the search with tolerances."""
        if search._problem.robot.tool_joints:
            search.interrupted = True
        else:
            whole(search, known, exact)

    monkeypatch.setattr(Search, "run", run)
    found = brachis.plan(result.task)
    assert found.interrupted
    assert [each.t_end for each in found.candidates] == [found.t_end]
    assert found.t_end == pytest.approx(plain.t_end, rel=1e-9)


@pytest.fixture(scope="module", params=["auto", ["joint_1"]], ids=["chart", "joint"])
def useless(request):
    """A line of the iiwa, without and with a tolerance that gains nothing."""
    line = {
        "path": [brachis.Line(by=[0.0, 0.5, 0.0])],
        "start": [-0.4, 0.7, 0.0, -1.2, 0.0, 1.0, 0.0],
        "task_space": "pose",
        "redundant_joints": request.param,
        "intervals": 8,
        "effort": "single",
    }
    tiny = {"orientation": {"roll": 1e-4}}
    return [
        brachis.plan("iiwa14", **line, **more) for more in ({}, {"tolerances": tiny})
    ]


def test_tolerances_that_gain_nothing_leave_the_tool_on_the_path(useless):
    plain, result = useless
    assert result.verified
    assert result.t_end == pytest.approx(plain.t_end, rel=1e-9)
    assert result.candidate.origin == "without tolerances"
    assert result.least_motion.verification.passed
    assert result.trajectory.joint_names == (*plain.trajectory.joint_names, "tool_roll")
    assert not result.trajectory.position([0.0, 0.3])[:, -1].any()
    keys = {check.name for check in result.verification.checks}
    assert "tool range ratio" in keys


def test_limits_of_a_tool_that_stays_on_the_path_cost_what_they_do_without_tolerances(
    useless, tmp_path
):
    plain, result = useless
    result.save(tmp_path / "motion.npz")
    expected = plain.bottleneck()
    for motion in (result, tmp_path / "motion.npz"):
        found = brachis.bottleneck.report(motion)
        assert found.t_end == pytest.approx(expected.t_end, rel=1e-9)
        for own, other in zip(
            found.sensitivities.limits, expected.sensitivities.limits, strict=True
        ):
            assert own.label == other.label
            assert own.derivative == pytest.approx(other.derivative, rel=1e-2, abs=1e-6)
        assert len(found.saturations) == len(expected.saturations)


def test_a_path_that_needs_its_tolerances_has_a_search():
    line = TILTED | {
        "path": brachis.Line(by=[0.24, 0.0, 0.0]),
        "start": [0.0, 0.4, 1.3, 0.0, np.pi / 2 - 0.13, 0.0],
        "intervals": 10,
    }
    with pytest.raises(PathError, match="out of reach from s = 0"):
        brachis.plan("tx90l_rail", **line, check_advice=False)
    result = brachis.plan("tx90l_rail", tolerances={"position": {"x": 0.02}}, **line)
    assert result.verified
    assert result.candidate.origin.startswith("lattice")
    assert result.not_completed == ()


def test_the_verification_sees_a_tool_that_leaves_its_range(leaning):
    plain, result = leaning
    trajectory, narrow = result.trajectory, {"orientation": {"lead": [-2, 6]}}
    task = task_with(trajectory.task, tolerances=narrow)
    robot, _ = bind(plain.trajectory.robot, "pose", task.tolerances)
    changed = replace(trajectory, task=task, robot=robot)
    check = check_of(brachis.verify_trajectory(changed), "tool range ratio")
    assert not check.passed
    assert check.subject == "tool lead"
    lead = np.degrees(trajectory.q[:, -1])
    assert check.value == pytest.approx(np.abs(lead - 2.0).max() / 4.0, 1e-3)


def test_saved_motions_come_back(leaning, tmp_path):
    _, result = leaning
    result.save(tmp_path / "motion.npz")
    again = brachis.Trajectory.load(tmp_path / "motion.npz")
    assert again.joint_names[-1] == "tool_lead"
    assert brachis.verify_trajectory(again).passed
    brachis.export.write(again, tmp_path / "motion.csv", dt=0.01)
    assert "tool_lead" not in (tmp_path / "motion.csv").read_text()
