"""Splines of degree 2: the acceleration jumps at knots, and limits are checked on both sides."""

from dataclasses import replace

import numpy as np
import pytest

import brachis
from brachis.robot import dynamics
from support.checks import check_of


def test_the_verification_sees_an_excess_just_before_a_knot():
    result = brachis.plan(
        brachis.examples.scara_line,
        redundant_joints=["j1"],
        degree=2,
        intervals=8,
        rest="velocity",
    )
    assert result.verified
    ends = [candidate for candidate in result.candidates if candidate.t_end < np.inf]
    assert all(candidate.verified for candidate in ends), (
        "refinement should look at both sides of knots too"
    )
    motion = result.trajectory
    jumps = np.flatnonzero(np.any(motion.qddot_before != motion.qddot, axis=1))
    assert len(jumps) >= 6
    knot = jumps[len(jumps) // 2]
    before = np.array(motion.qddot_before)
    before[knot] *= 3.0
    verification = brachis.verify_trajectory(replace(motion, qddot_before=before))
    check = check_of(verification, "torque ratio")
    assert not check.passed
    assert check.time == motion.times[knot]
    # The grid beside the knot sees less than the torque on its left side, which this is.
    torque = dynamics.torque(
        motion.robot, motion.q[[knot]], motion.qdot[[knot]], before[[knot]]
    )
    assert check.value == pytest.approx(np.abs(torque / 10.0).max(), rel=1e-12)
