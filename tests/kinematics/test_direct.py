"""The joint map without a path: the identity."""

from __future__ import annotations

import numpy as np

from brachis.limits.safeguards import build_branch_margins
from support.chains import planar_robot
from support.direct_map import DirectJointMap


def test_every_joint_is_a_curve():
    start = np.array([0.4, -0.2, 0.1])
    free = DirectJointMap(planar_robot("RRP"), start)
    y, ydot, yddot, ydddot = np.random.default_rng(0).normal(size=(4, 5, 3))
    state = free.state(y, ydot, yddot, ydddot, t=np.linspace(0.0, 1.0, 5), near=y + 7.0)
    pairs = (
        (state.q, y),
        (state.qdot, ydot),
        (state.qddot, yddot),
        (state.qdddot, ydddot),
        (free.postures(y), y),
    )
    for mine, given in pairs:
        np.testing.assert_allclose(mine, given, atol=1e-14)
    np.testing.assert_array_equal(state.gradient, [np.eye(3)] * 5)
    exact = free.derivatives(state)
    for part in (exact.qdot_y, exact.qddot_y, exact.qddot_ydot, state.qdddot_y):
        np.testing.assert_array_equal(part, np.zeros((5, 3, 3)))
    assert free.path is None
    assert free.r == 3
    np.testing.assert_array_equal(free.coordinates(0.0, start), start)


def test_nothing_guards_it():
    free = DirectJointMap(planar_robot("RRP"), np.zeros(3))
    assert build_branch_margins(free) == ()
    still = np.zeros((4, 3))
    state = free.state(still, still, still, still, t=np.linspace(0.0, 1.0, 4))
    by_q, by_s = free.margin_gradient(state)
    assert by_q.shape == (4, 0, 3)
    assert by_s is None
    assert free.margins(state).shape == (4, 0)
    assert free.start_margins().shape == (0,)
