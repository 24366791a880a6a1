"""Where joints with Coulomb friction reverse, against motions whose reversals are known; and plans under it."""

from dataclasses import replace

import numpy as np
import pytest

import brachis
from brachis.kinematics import JointState
from brachis.optimise.refine import reversals
from brachis.robot import Friction

COUNT = 61


def swinging(phases, offset=0.0):
    """Velocities sin(2 pi t + phase) + offset of n joints at grid times in [0, 1]."""
    t = np.linspace(0.0, 1.0, COUNT)
    angle = 2.0 * np.pi * t[:, None] + np.array(phases)
    qdot, qddot = np.sin(angle) + offset, 2.0 * np.pi * np.cos(angle)
    empty = dict.fromkeys(JointState.__dataclass_fields__)
    return t, JointState(**(empty | {"qdot": qdot, "qddot": qddot}))


def rubbing(n, width, coulomb=1.0):
    return Friction(
        armature=np.zeros(n),
        viscous=np.zeros(n),
        coulomb=np.full(n, coulomb),
        v_eps=np.full(n, width),
    )


@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-6])
def test_every_width_around_every_reversal(width):
    phases = [0.3, 1.7]
    times = reversals(rubbing(2, width), *swinging(phases))
    steps = np.array([-7.0, -4.5, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.5, 7.0])
    expected = steps * width / (2.0 * np.pi)
    for phase in phases:
        for zero in (0.5 - phase / (2.0 * np.pi), 1.0 - phase / (2.0 * np.pi)):
            near = times[np.abs(times - zero) < 2.0 * width] - zero
            np.testing.assert_allclose(near, expected, atol=0.01 * width + 1e-8)
    assert len(times) == 44


def test_a_velocity_that_only_touches_zero():
    width = 1e-3
    t, state = swinging([0.3], offset=1.0 + 4.0 * width)  # at least 4 widths
    found = reversals(rubbing(1, width), t, state)
    lowest = 0.75 - 0.3 / (2.0 * np.pi)
    assert np.abs(found - lowest).min() < 1e-3
    far = swinging([0.3], offset=1.0 + 20.0 * width)[1]
    assert not len(reversals(rubbing(1, width), t, far))


def test_joints_without_coulomb_friction_are_not_looked_at():
    t, state = swinging([0.3, 1.7])
    assert not len(reversals(rubbing(2, 1e-3, coulomb=0.0), t, state))
    one = replace(rubbing(2, 1e-3), coulomb=np.array([0.0, 1.0]))
    assert len(reversals(one, t, state)) == 22


@pytest.mark.parametrize("width", [1e-3, 1e-5])
def test_plans_under_narrow_friction_are_verified_by_refinement_alone(width):
    """The refinement sees the peaks itself: the verification finds nothing that it has missed."""
    result = brachis.plan(
        brachis.examples.scara_line,
        friction={
            "coulomb": [0.6, 0.4, 0.3],
            "coulomb_velocity": width,
            "viscous": 0.1,
        },
        path=brachis.Line(length=0.8, angle_deg=180),
        effort="single",
    )
    assert result.verified
    assert result.candidate.refinement_rounds >= 2
    assert result.verification.worst_ratio - 1.0 <= result.candidate.violation + 1e-5
