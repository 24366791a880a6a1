"""The best value known: reachable, faster, and within the limits."""

from __future__ import annotations

import numpy as np
import pytest

import brachis
from brachis.apps.bottleneck import find_reference
from brachis.robot import dynamics

from .conftest import FORCE, LENGTH, MASS


def test_the_slide_comes_to_bang_bang_itself(slide):
    result = slide(intervals=10, rest="full")
    best = 2.0 * np.sqrt(2.0 * MASS * LENGTH / FORCE)
    reference = find_reference(result.candidate.refined, intervals=40)
    assert reference.degree == 2, (
        "parabolas alone can jump from full force forwards to full force back"
    )
    assert reference.t_end == pytest.approx(best, rel=2e-4)
    assert reference.distance == pytest.approx(result.t_end / reference.t_end - 1.0)
    assert reference.distance > 0.1


def test_planar_line(scara):
    report = brachis.bottleneck.report(scara("j3"), reference=True)
    reference = report.reference
    assert 2.32 < reference.t_end < 2.34
    assert reference.intervals == 100
    (motion,) = reference.refined.program.motions(reference.refined.x)
    joint_map = scara("j3").candidate.refined.program.phases[0].joint_map
    t = np.sort(np.random.default_rng(3).uniform(0.0, motion.t_end, 4000))
    state = joint_map.state(*motion.at(t), t=t)
    torque = dynamics.torque(joint_map.robot, state.q, state.qdot, state.qddot)
    assert np.abs(torque / joint_map.robot.limits.torque).max() <= 1.0 + 1e-4
    y, ydot, *_ = motion.at(np.array([0.0, motion.t_end]))
    np.testing.assert_allclose(y[:, 0], [0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(ydot, 0.0, atol=1e-9)
    words = str(report)
    assert "best value known, not a proven bound" in words
    assert f"reference {reference.t_end:.4f} s" in words


def test_nothing_faster_is_said(slide):
    # Parabolas on a mesh with a knot in the middle are at the optimum already.
    result = slide(degree=2, intervals=4)
    reference = find_reference(result.candidate.refined, intervals=8)
    assert reference is None or reference.distance < 2e-4


def test_end_posture_is_kept(slide):
    limits = {"torque": {"j1": 30.0}}
    from brachis.apps.bottleneck.reference import _on_mesh

    free = slide(
        ((1.0, 0.0, 0.0),) * 2,
        ("x",),
        (LENGTH,),
        redundant=["j1"],
        robot={"limits": limits},
    )
    end = free.candidate.refined.program.phases[0].boundary.end
    np.testing.assert_array_equal([own.value for own in end], [1.0, np.nan])
    task = free.task.to_dict()
    task["end"] = {"joints": [0.1, LENGTH - 0.1]}
    given, _ = brachis.transcribe(free.trajectory.robot, brachis.load_task(task))
    (fine,) = _on_mesh(given, 3, 2).phases
    assert fine.intervals == 2 * given.phases[0].intervals
    assert fine.motion(np.zeros(fine.variables) + 0.5).control_points[1, -1] == 0.1
