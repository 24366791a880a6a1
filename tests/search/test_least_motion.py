"""The calmest motion among those that are as fast: what it is, what it costs, and when the fastest one stays."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import brachis
from brachis.common.deadline import NEVER, Deadline
from brachis.search import least_motion
from brachis.task import task_with
from brachis.trajectory import Trajectory

ROOT = Path(__file__).parents[2]
NOTEWORTHY = 0.01
"""A velocity above this part of its limit."""


def reversals(trajectory: Trajectory) -> list[int]:
    """How often every joint turns round: changes of sign between velocities that are noteworthy."""
    velocity = trajectory.velocity(np.linspace(0.0, trajectory.t_end, 4001))
    limits = trajectory.robot.limits.velocity
    scale = np.where(np.isfinite(limits), limits, np.abs(velocity).max(axis=0))
    kept = [
        v[np.abs(v) > NOTEWORTHY * most]
        for v, most in zip(velocity.T, scale, strict=True)
    ]
    return [int((np.diff(np.sign(v)) != 0.0).sum()) for v in kept]


def rms(trajectory: Trajectory) -> np.ndarray:
    return np.sqrt(
        (trajectory.acceleration(np.linspace(0.0, trajectory.t_end, 4001)) ** 2).mean(
            axis=0
        )
    )


def free_roll() -> brachis.Task:
    return task_with(brachis.examples.free_roll, effort="single", intervals=16)


def seven_joints() -> brachis.Task:
    """The iiwa's flange along a line in space: four redundant joints."""
    task = {
        "brachis": 1,
        "robot": {"urdf": str(ROOT / "robots/iiwa14/robot.urdf")},
        "start": {"joints": [0.3, 0.6, 0.2, -1.3, 0.4, 0.9, 0.1]},
        "task_space": "position",
        "path": [{"line": {"by": [-0.1, 0.35, 0.2]}}],
        "spline": {"intervals": 20},
        "search": {"effort": "single"},
    }
    return brachis.load_task(task)


def scara(**search) -> dict:
    return {
        "brachis": 1,
        "robot": {
            "urdf": str(ROOT / "robots/scara3/robot.urdf"),
            "gravity": [0, 0, 0],
            "limits": {"torque": 10, "velocity": None},
        },
        "start": {"joints": [np.pi / 6, -2 * np.pi / 3, 2 * np.pi / 3]},
        "task_space": ["x", "y"],
        "path": [{"line": {"length": 1.0, "angle_deg": 90}}],
        "redundant_joints": ["j3"],
        "spline": {"intervals": 20},
        "search": {"effort": "single", **search},
    }


@pytest.fixture(scope="module", params=[free_roll, seven_joints])
def result(request):
    return brachis.plan(request.param())


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
    assert (
        result.candidate.refined.program.objective(result.candidate.refined.x)
        == result.candidate.refined.t_end
    )
    assert result.candidate.refined.t_end == pytest.approx(
        result.candidate.trajectory.t_end, rel=1e-9
    )
    fastest = dataclasses.replace(result, trajectory=result.candidate.trajectory)
    ours, theirs = (
        brachis.bottleneck.report(each).sensitivities for each in (result, fastest)
    )
    assert len(ours.limits) == len(theirs.limits) > 0
    for entry in ours.limits:
        other = theirs.of(entry.label.subject, entry.label.kind, entry.side)
        assert other.derivative == pytest.approx(entry.derivative, rel=1e-6, abs=1e-9)


def test_with_many_variables_only_a_slower_one_is_looked_for(monkeypatch):
    monkeypatch.setattr(least_motion, "_MANY", 20)
    kept = brachis.plan(scara()).least_motion
    assert kept.reports == ()
    assert "variables" in kept.status
    slower = brachis.plan(scara(slower=0.05))
    assert slower.least_motion.reduction > 0.2
    assert slower.verified


def test_it_can_be_switched_off():
    result = brachis.plan(scara(least_motion=False))
    assert result.least_motion is None
    assert result.trajectory is result.candidate.trajectory
    assert result.to_dict()["least_motion"] is None


def test_the_fastest_motion_stays_where_there_is_nothing_to_gain():
    result = brachis.plan(scara())
    assert result.trajectory is result.candidate.trajectory
    assert result.least_motion.reduction == result.least_motion.later == 0.0
    assert len(result.least_motion.reports) == 1
    assert "is kept" in result.least_motion.status


def test_a_slower_motion_is_calmer(tmp_path):
    result = brachis.plan(scara(slower="1 %"))
    assert result.verified
    assert 1.005 < result.t_end / result.candidate.t_end <= 1.01
    assert np.all(rms(result.trajectory) < 0.9 * rms(result.candidate.trajectory))
    result.trajectory.save(tmp_path / "result.npz")
    again = brachis.bottleneck.report(
        Trajectory.load(tmp_path / "result.npz")
    ).sensitivities
    for entry in brachis.bottleneck.report(result).sensitivities.limits:
        found = again.of(entry.label.subject, entry.label.kind, entry.side)
        assert found.derivative == pytest.approx(entry.derivative, rel=0.05, abs=1e-3)


def test_without_time_or_a_verified_motion_the_fastest_stays():
    task = brachis.load_task(scara(least_motion=False))
    kept = []

    def keep(candidate, *_) -> None:
        kept.append(candidate)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("brachis.planner.find_least_motion", keep)
        brachis.plan(
            task.model_copy(
                update={"search": task.search.model_copy(update={"least_motion": True})}
            )
        )
    (fastest,) = kept
    over = least_motion.find_least_motion(fastest, Deadline(0.0), lambda _text: None)
    assert over.trajectory is fastest.trajectory
    assert over.status == "no time was left"

    def interrupt(_text):
        raise KeyboardInterrupt

    interrupted = least_motion.find_least_motion(fastest, NEVER, interrupt)
    assert interrupted.trajectory is fastest.trajectory
    assert interrupted.status == "interrupted"


def test_without_refinement_nothing_is_verified_and_the_fastest_stays():
    result = brachis.plan({**scara(), "refinement": {"max_rounds": 0}})
    assert not result.verified
    assert result.least_motion.status == "the fastest motion is not verified"
