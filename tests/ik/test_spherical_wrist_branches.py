"""Branches of arms with a spherical wrist: their labels along curves, and where two of them meet."""

from __future__ import annotations

import numpy as np
import pytest

from support.factored_bench import Bench
from support.screw_arms import BASES, panda, screw_robot, seven_joints, wrist
from support.spatial import rail_arm

ALONG = (0.0, 0.0, 1.0)
# Robot, redundant joints, and the joint of every step with two answers.
SMOOTH = {
    "rail": (rail_arm, (0,), (1, 3, 5)),
    "joint 1": (rail_arm, (1,), (None, 3, 5)),
    "joint 2": (rail_arm, (2,), (0, 3, 5)),
    "joint 3, rail along": (lambda: rail_arm(ALONG), (3,), (1, 2, 5)),
    "seven joints": (seven_joints, (2,), (1, 3, 5)),
    "backwards": (panda, (6,), (4, 3, 1)),
    "meeting of the last": (panda, (3,), (4, 6, 1)),
    "slides": (
        lambda: screw_robot([*BASES["PR|P"], *wrist(np.random.default_rng(1))]),
        (),
        (0, 4),
    ),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_labels_follow_the_branch_along_smooth_curves(name):
    make, redundant, _ = SMOOTH[name]
    Bench(make(), redundant, postures=1).check_labels_along_curves()


@pytest.mark.parametrize("name", SMOOTH)
def test_margins_vanish_where_two_answers_meet(name):
    make, redundant, steps = SMOOTH[name]
    Bench(make(), redundant).check_boundaries(steps)
