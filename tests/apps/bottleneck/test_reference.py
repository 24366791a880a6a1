"""The best value known: reachable, faster, and within the limits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import brachis
from brachis.apps.bottleneck import find_reference

from .conftest import FORCE, LENGTH, MASS

BEST = 2.0 * np.sqrt(2.0 * MASS * LENGTH / FORCE)


def test_the_slide_comes_to_bang_bang_itself(slide):
    result = slide(intervals=10, rest="full")
    reference = find_reference(result.candidate)
    assert reference.t_end == pytest.approx(BEST, rel=2e-4)
    assert reference.distance == pytest.approx(result.t_end / reference.t_end - 1.0)
    assert reference.distance > 0.1


def test_planar_line(scara):
    report = brachis.bottleneck.report(scara("j3"), reference=True)
    reference = report.reference
    assert 2.32 < reference.t_end < 2.34
    motion = reference.candidate.trajectory
    t = np.sort(np.random.default_rng(3).uniform(0.0, motion.t_end, 4000))
    torque = motion.torque(t) / motion.robot.limits.torque
    assert np.abs(torque).max() <= 1.0 + 1e-4
    ends = np.array([0.0, motion.t_end])
    assert_allclose(motion.path_coordinate(ends), [0.0, 1.0], atol=1e-9)
    assert_allclose(motion.velocity(ends), 0.0, atol=1e-9)
    words = str(report)
    assert "best value known, not a proven bound" in words
    assert f"reference {reference.t_end:.4f} s" in words


def test_limits_on_jerk_are_left_out(slide):
    limits = {"jerk": 100.0}
    result = slide(intervals=20, degree=4, rest="full", robot={"limits": limits})
    free = slide(intervals=20, degree=4, rest="full")
    assert result.t_end > 1.01 * free.t_end
    reference = find_reference(result.candidate)
    assert reference.t_end == pytest.approx(BEST, rel=2e-4)


def test_an_optimal_motion_has_no_faster_reference(slide):
    # Parabolas on a mesh with a knot in the middle are at the optimum already.
    result = slide(degree=2, intervals=4)
    reference = find_reference(result.candidate)
    assert reference is None or reference.distance < 2e-4


def test_the_reference_keeps_the_end_posture(slide):
    free = slide(
        ((1.0, 0.0, 0.0),) * 2,
        ("x",),
        (LENGTH,),
        redundant=["j1"],
        robot={"limits": {"torque": {"j1": 30.0}}},
    )
    end = {"joints": [0.1, LENGTH - 0.1]}
    given = brachis.plan(free.trajectory.robot, {**free.task.to_dict(), "end": end})
    motion = find_reference(given.candidate).candidate.trajectory
    end = motion.position(motion.t_end)
    assert_allclose(end, [0.1, LENGTH - 0.1], atol=1e-9)
