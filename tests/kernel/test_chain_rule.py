"""Values of limits, their slopes by curves, and entries of a Jacobian, against the formulas with NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from brachis.kernel import (
    CurvePattern,
    MotionSlopes,
    ScaledQuantity,
    ValueGroups,
    VariableSlopes,
    differentiate,
)
from kernel.test_chain import chain_of, random_model

POINTS = 9
N = 5


@pytest.fixture
def chain():
    return chain_of(*random_model(N, 1))


def test_what_does_not_fit_is_an_error(chain):
    with pytest.raises(ValueError, match="point"):
        CurvePattern(np.array([9]), np.array([0]), POINTS, 2)
    with pytest.raises(ValueError, match="curve"):
        CurvePattern(np.array([0]), np.array([2]), POINTS, 2)
    with pytest.raises(ValueError, match="as many"):
        CurvePattern(np.array([0, 1]), np.array([0]), POINTS, 2)
    with pytest.raises(TypeError, match="cast"):
        CurvePattern(np.array([0.0]), np.array([0]), POINTS, 2)
    none = np.zeros(0, dtype=int)
    variables = VariableSlopes(
        np.zeros((1, 3, POINTS, 2)),
        CurvePattern(none, none, POINTS, 2),
        np.zeros((3, 0)),
    )
    with pytest.raises(ValueError, match="other points"):
        variables.find_entries(np.zeros((3, POINTS, 1, 3)))
    motion = MotionSlopes(*np.zeros((4, POINTS, N, 3)))
    states = np.zeros((3, POINTS, N))
    groups = ValueGroups([None], [1])
    partials = [((np.zeros((POINTS, 1, N)), None, None, None), None)]
    with pytest.raises(ValueError, match="other points"):
        differentiate(groups, motion, states, partials, variables)
    one = np.ones(1)
    beyond = ScaledQuantity("q", np.array([N]), one, one, chain)
    with pytest.raises(ValueError, match="joint"):
        ValueGroups([beyond], [1])
    first = np.zeros(1, dtype=int)
    torque = ScaledQuantity("torque", first, one, one, chain)
    groups = ValueGroups([torque], [1])
    with pytest.raises(ValueError, match="needs the torque"):
        groups.values(states)
    with pytest.raises(ValueError, match=r"has 3 joints; needed: 5"):
        groups.values(states[:, :, :3], states[0, :, :3])
    fewer = MotionSlopes(*np.zeros((4, POINTS, 3, 3)))
    with pytest.raises(ValueError, match=r"has 3 joints; needed: 5"):
        differentiate(groups, fewer, states[:, :, :3], [])
    other = chain_of(*random_model(3, 1))
    with pytest.raises(ValueError, match="different numbers"):
        ValueGroups([torque, ScaledQuantity("q", first, one, one, other)], [1, 1])
    again = chain_of(*random_model(N, 2))
    with pytest.raises(ValueError, match="more than one chain"):
        ValueGroups([torque, ScaledQuantity("torque", first, one, one, again)], [1, 1])


def test_partials_by_the_jerk_need_its_slopes(chain):
    motion = MotionSlopes(*np.zeros((4, POINTS, N, 3)))
    states = np.zeros((3, POINTS, N))
    partials = np.zeros((POINTS, 1, N))
    with pytest.raises(ValueError, match="qdddot_y"):
        differentiate(
            ValueGroups([None], [1]),
            motion,
            states,
            [((None, None, None, partials), None)],
        )
    one = np.ones(1)
    jerk = ScaledQuantity("qdddot", np.zeros(1, dtype=int), one, one, chain)
    with pytest.raises(ValueError, match="qdddot_y"):
        differentiate(ValueGroups([jerk], [1]), motion, states, [])
    with pytest.raises(ValueError, match="qdddot"):
        ValueGroups([jerk], [1]).values(states)
