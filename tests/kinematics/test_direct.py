"""The joint map without a path: the identity."""

from __future__ import annotations

import numpy as np

from brachis.limits.safeguards import build_branch_margins
from support.chains import planar_robot
from support.direct_map import DirectJointMap


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
