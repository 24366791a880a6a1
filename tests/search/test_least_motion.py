"""The calmest motion among those that are as fast: what it is, what it costs, and when the fastest one stays."""

import dataclasses

import numpy as np
import pytest

import brachis
from brachis.common.deadline import Deadline
from brachis.robot.from_task import robot_for
from brachis.search import least_motion
from brachis.task import task_with
from brachis.trajectory import Trajectory
from support.starts import starting_points

NOTEWORTHY = 0.01
"""A velocity above this part of its limit."""


def reversals(trajectory):
    """How often every joint turns round: changes of sign between velocities that are noteworthy."""
    velocity = trajectory.velocity(np.linspace(0.0, trajectory.t_end, 4001))
    limits = trajectory.robot.limits.velocity
    scale = np.where(np.isfinite(limits), limits, np.abs(velocity).max(axis=0))
    kept = [
        v[np.abs(v) > NOTEWORTHY * most]
        for v, most in zip(velocity.T, scale, strict=True)
    ]
    return [int((np.diff(np.sign(v)) != 0.0).sum()) for v in kept]


def rms(trajectory):
    t = np.linspace(0.0, trajectory.t_end, 4001)
    return np.sqrt((trajectory.acceleration(t) ** 2).mean(axis=0))


def plan(**search):
    """Plan the line of the paper's arm."""
    return brachis.plan(brachis.examples.scara_line, effort="single", **search)


TASKS = {
    "free roll": task_with(brachis.examples.free_roll, effort="single", intervals=16),
    # The iiwa's flange along a line in space: four redundant joints.
    "seven joints": task_with(
        robot={"urdf": "iiwa14"},
        start=[0.3, 0.6, 0.2, -1.3, 0.4, 0.9, 0.1],
        task_space="position",
        path=brachis.Line(by=[-0.1, 0.35, 0.2]),
        intervals=20,
        effort="single",
    ),
}


@pytest.fixture(scope="module", params=TASKS)
def result(request):
    return brachis.plan(TASKS[request.param])


def test_no_joint_swings_to_and_fro_and_the_motion_is_as_fast(result):
    fastest = result.candidate.trajectory
    assert max(reversals(fastest)) > 2, "the fastest motion has nothing to calm"
    assert max(reversals(result.trajectory)) <= 2
    assert result.verified
    assert result.t_end <= (1.0 + 1e-4) * fastest.t_end
    found = result.least_motion
    assert found.reduction > 0.2
    assert found.later == pytest.approx(result.t_end / fastest.t_end - 1.0)
    swinging = np.argmax(reversals(fastest))
    assert rms(result.trajectory)[swinging] < 0.6 * rms(fastest)[swinging]
    assert result.to_dict()["least_motion"]["status"] == found.status
    assert "lower" in found.status


def test_bottlenecks_are_those_of_the_fastest_motion(result):
    candidate = result.candidate
    refined = candidate.refined
    assert refined.program.objective(refined.x) == refined.t_end
    assert refined.t_end == pytest.approx(candidate.trajectory.t_end, rel=1e-9)
    fastest = dataclasses.replace(result, trajectory=candidate.trajectory)
    compare_sensitivities(result, fastest, rel=1e-6, abs=1e-9)


def compare_sensitivities(first, second, **near):
    ours, theirs = (brachis.bottleneck.report(motion) for motion in (first, second))
    limits = ours.sensitivities.limits
    assert len(limits) == len(theirs.sensitivities.limits) > 0
    for entry in limits:
        label = entry.label
        again = theirs.sensitivities.of(label.subject, label.kind, entry.side)
        assert again.derivative == pytest.approx(entry.derivative, **near)


def test_joints_count_in_proportion_to_their_velocity_limits_or_velocities():
    task = TASKS["free roll"]
    robot = robot_for(None, task.robot)
    most = robot.limits.velocity.copy()
    most[:2] = np.inf
    program, _ = brachis.transcribe(robot.with_limits(velocity=most), task)
    x = next(starting_points(program))
    (state,) = program.states(x)
    most[:2] = np.abs(state.qdot[:, :2]).max(axis=0)  # a rail and a revolute joint
    weights = least_motion.least_acceleration(program, x, 0.0).weights
    np.testing.assert_allclose(weights[:-1] * most, weights[0] * most[0])
    assert weights[-1] == 0.0, "the virtual roll is no joint"


def test_with_many_variables_only_a_slower_one_is_looked_for(monkeypatch):
    monkeypatch.setattr(least_motion, "_MANY", 20)
    fastest = plan().least_motion
    assert fastest.reports == ()
    assert "variables" in fastest.status
    slower = plan(slower=0.05)
    assert slower.least_motion.reduction > 0.2
    assert slower.verified


def test_it_can_be_switched_off():
    result = plan(least_motion=False)
    assert result.least_motion is None
    assert result.trajectory is result.candidate.trajectory
    assert result.to_dict()["least_motion"] is None


def test_the_fastest_motion_stays_where_there_is_nothing_to_gain():
    result = plan()
    assert result.trajectory is result.candidate.trajectory
    assert result.least_motion.reduction == result.least_motion.later == 0.0
    assert len(result.least_motion.reports) == 1
    assert "is kept" in result.least_motion.status


def test_a_slower_motion_is_calmer(tmp_path):
    result = plan(slower="1 %")
    assert result.verified
    assert 1.005 < result.t_end / result.candidate.t_end <= 1.01
    assert np.all(rms(result.trajectory) < 0.9 * rms(result.candidate.trajectory))
    result.trajectory.save(tmp_path / "result.npz")
    again = Trajectory.load(tmp_path / "result.npz")
    compare_sensitivities(result, again, rel=0.05, abs=1e-3)


def test_without_time_or_a_verified_motion_the_fastest_stays():
    fastest = plan(least_motion=False).candidate
    over = least_motion.find_least_motion(fastest, Deadline(0.0), lambda _text: None)
    assert over.trajectory is fastest.trajectory
    assert over.status == "no time was left"


def test_a_press_while_a_smoother_motion_is_sought_keeps_the_fastest(monkeypatch):
    def press(*_arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("brachis.planner.find_least_motion", press)
    interrupted = plan(least_motion=True)
    assert interrupted.trajectory is interrupted.candidate.trajectory
    assert interrupted.least_motion.status == "interrupted"


def test_without_refinement_nothing_is_verified_and_the_fastest_stays():
    result = plan(refinement={"max_rounds": 0})
    assert not result.verified
    assert result.least_motion.status == "the fastest motion is not verified"
