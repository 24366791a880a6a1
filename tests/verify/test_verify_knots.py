"""Splines of degree 2: the acceleration jumps at knots, and limits are checked on both sides."""

from dataclasses import replace

import numpy as np
import pytest

import brachis
from brachis.robot import dynamics


def test_an_excess_just_before_a_knot_is_seen(scara_urdf):
    limits = brachis.LimitSpec(torque=10.0, velocity=None)
    robot = brachis.Robot.from_urdf(scara_urdf, gravity=[0, 0, 0], limits=limits)
    task = {
        "brachis": 1,
        "start": {"joints": [0.5, -2.0, 2.0]},
        "task_space": ["x", "y"],
        "path": [{"line": {"by": [0.0, 1.0]}}],
        "redundant_joints": ["j1"],
        "spline": {"degree": 2, "intervals": 8, "rest": "velocity"},
    }
    result = brachis.plan(robot, task)
    assert result.verified
    finished = [
        candidate for candidate in result.candidates if np.isfinite(candidate.t_end)
    ]
    assert all(candidate.verified for candidate in finished), (
        "refinement should look at both sides of knots too"
    )
    motion = result.trajectory
    jumps = np.flatnonzero(np.any(motion.qddot_before != motion.qddot, axis=1))
    assert len(jumps) >= 6
    knot = jumps[len(jumps) // 2]
    before = np.array(motion.qddot_before)
    before[knot] *= 3.0
    (check,) = [
        c
        for c in brachis.verify_trajectory(replace(motion, qddot_before=before)).checks
        if c.name == "torque ratio"
    ]
    assert not check.passed
    assert check.time == motion.times[knot]
    # The grid beside the knot sees less than the torque on its left side, which this is.
    expected = dynamics.torque(
        robot, motion.q[[knot]], motion.qdot[[knot]], before[[knot]]
    )[0]
    assert check.value == pytest.approx(np.abs(expected / 10.0).max(), rel=1e-12)
