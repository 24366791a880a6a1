"""Values of limits, their slopes by curves, and entries of a Jacobian, against the formulas with NumPy."""

import copy

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.kernel import (
    CurvePattern,
    Formula,
    FormulaQuantity,
    MotionSlopes,
    ScaledQuantity,
    ValueGroups,
    VariableSlopes,
    differentiate,
    formula,
)
from kernel.test_chain import chain_of, random_model

POINTS = 9
N = 5


@pytest.fixture
def chain():
    return chain_of(*random_model(N, 1))


def one_value(quantity, chain, joint=0):
    one = np.ones(1)
    return ScaledQuantity(quantity, np.array([joint]), one, one, chain)


def slopes_of(partials, parts, with_jerk):
    """Chain rule for partials by q, qdot, qddot and qdddot."""
    gradient, qdot_y, qddot_y, qddot_ydot, qdddot_y = parts
    p_q, p_v, p_a, p_j = partials
    found = [
        p_q @ gradient + p_v @ qdot_y + p_a @ qddot_y,
        p_v @ gradient + p_a @ qddot_ydot,
        p_a @ gradient,
    ]
    if with_jerk:
        found[0] = found[0] + p_j @ qdddot_y
        found[1] = found[1] + 3.0 * p_j @ qddot_y
        found[2] = found[2] + 3.0 * p_j @ qdot_y
        found.append(p_j @ gradient)
    return np.array(found)


@pytest.mark.parametrize("width", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("with_jerk", [False, True])
def test_the_chain_rule(with_jerk, width):
    rng = np.random.default_rng(8)
    parts = list(rng.normal(size=(5, POINTS, N, width)))
    motion = MotionSlopes(*parts[:4], parts[4] if with_jerk else None)
    states = rng.normal(size=(3, POINTS, N))
    first = rng.normal(size=(4, POINTS, 4, N))
    given = [*first[:3], first[3] if with_jerk else None]
    constant = np.broadcast_to(rng.normal(size=(2, N)), (POINTS, 2, N))
    by_s = rng.normal(size=(POINTS, 2))
    partials = [(given, None), ((None, constant, None, None), by_s)]
    groups = ValueGroups([None, None], [4, 2])
    found, entries = differentiate(groups, motion, states, partials)
    assert not entries.size
    known = slopes_of(first, parts, with_jerk)
    assert_allclose(found[:, :, :4], known, atol=1e-12)
    zero = np.zeros_like(constant)
    known = slopes_of((zero, constant, zero, zero), parts, with_jerk)
    known[0, :, :, 0] += by_s
    assert_allclose(found[:, :, 4:], known, atol=1e-12)

    points = np.array([0, 0, 4, POINTS - 1])
    basis = rng.normal(size=(len(found), 4))
    curves = np.array([1, 0, 2, 1]) % width
    every = rng.normal(size=(2, len(found), POINTS, width))
    places = CurvePattern(points, curves, POINTS, width)
    variables = VariableSlopes(every, places, basis)
    entries = variables.find_entries(found)
    known = np.einsum("bokw,okcw->bkc", every, found).reshape(2 * POINTS, -1)
    assert_allclose(entries[: 2 * POINTS], known, atol=1e-12)
    by_one = np.einsum("oz,zoc->zc", basis, found[:, points, :, curves])
    assert_allclose(entries[2 * POINTS :], by_one, atol=1e-12)
    again = differentiate(groups, motion, states, partials, variables)
    assert_array_equal(again[0], found)
    assert_array_equal(again[1], entries)


def test_orders_that_values_do_not_depend_on_are_left_out():
    rng = np.random.default_rng(2)
    found = rng.normal(size=(3, POINTS, 2, 2))
    places = CurvePattern(np.array([3]), np.array([1]), POINTS, 2)
    shared = rng.normal(size=(1, 4, POINTS, 2))
    basis = rng.normal(size=(4, 1))
    whole = VariableSlopes(shared, places, basis).find_entries(found)
    part = VariableSlopes(shared[:, :3], places, basis[:3]).find_entries(found)
    assert_array_equal(whole, part)
    fewer = VariableSlopes(shared[:, :2], places, basis[:2]).find_entries(found)
    known = VariableSlopes(shared[:, :2], places, basis[:2]).find_entries(found[:2])
    assert_array_equal(fewer, known)


@pytest.mark.parametrize("quantity", ["q", "qdot", "qddot", "qdddot", "torque"])
def test_scaled_quantities(chain, quantity):
    """Each is its partials, which are rows of the unit matrix or derivatives of the torque, times the factors."""
    rng = np.random.default_rng(5)
    joints = np.array([3, 0, 3])
    offsets, factors = rng.normal(size=(2, 3))
    scaled = ScaledQuantity(quantity, joints, offsets, factors, chain)
    states = rng.normal(size=(4, POINTS, N))
    parts = list(rng.normal(size=(5, POINTS, N, 3)))
    torque = chain.torques(*states[:3])
    quantities = dict(zip(("q", "qdot", "qddot", "qdddot"), states, strict=True))
    quantities["torque"] = torque
    groups = ValueGroups([scaled], [3])
    (values,) = groups.values(states, torque)
    known = (quantities[quantity][:, joints] - offsets) * factors
    assert_array_equal(values, known)

    partials = np.zeros((4, POINTS, N, N))
    if quantity == "torque":
        partials[:3] = chain.torque_derivatives(*states[:3])
    else:
        partials[list(quantities).index(quantity)] = np.eye(N)
    partials = partials[:, :, joints] * factors[:, None]
    has_jerk = quantity == "qdddot"
    motion = MotionSlopes(*parts[:4], parts[4] if has_jerk else None)
    found, _ = differentiate(groups, motion, states[:3], [])
    known = slopes_of(partials, parts, has_jerk)
    assert_allclose(found, known, atol=1e-11 * np.abs(known).max())


def test_formulas_of_the_posture():
    """Margins are such: numbers of a formula, times signs."""
    rng = np.random.default_rng(7)
    states = rng.normal(size=(3, POINTS, N))

    def function(q):
        return np.stack([q[:, 0] * q[:, 2], formula.sin(q[:, 4])], axis=1)

    factors = np.array([2.0, -1.0])
    margins = FormulaQuantity(
        Formula.of(function, N), Formula.gradient(function, N), factors
    )
    groups = ValueGroups([None, margins], [1, 2])
    values = groups.values(states)[1]
    assert_allclose(values, function(states[0]) * factors, atol=1e-14)
    parts = rng.normal(size=(5, POINTS, N, 3))
    by_q = margins.slopes_of(states[0]) * factors[:, None]
    zero = np.zeros_like(by_q)
    given = [((np.zeros((POINTS, 1, N)), None, None, None), None)]
    motion = MotionSlopes(*parts[:4])
    found, _ = differentiate(groups, motion, states, given)
    known = slopes_of((by_q, zero, zero, zero), parts, with_jerk=False)
    assert_allclose(found[:, :, 1:], known, atol=1e-13)
    with pytest.raises(ValueError, match="have the shapes"):
        ValueGroups([margins], [3])


def test_groups_can_be_sent_to_another_process(chain):
    groups = ValueGroups([one_value("torque", chain, 2)], [1])
    states = np.random.default_rng(7).normal(size=(3, POINTS, N))
    again = copy.deepcopy(groups)  # as another process gets it
    torque = np.random.default_rng(8).normal(size=(POINTS, N))
    (known,) = groups.values(states, torque)
    del groups
    (found,) = again.values(states, torque)
    assert_array_equal(found, known)


def test_what_does_not_fit_is_refused(chain):
    for points, curve, kind, message in (
        ([9], 0, ValueError, "point"),
        ([0], 2, ValueError, "curve"),
        ([0, 1], 0, ValueError, "as many"),
        ([0.0], 0, TypeError, "cast"),
    ):
        with pytest.raises(kind, match=message):
            CurvePattern(np.array(points), np.array([curve]), POINTS, 2)
    none = np.zeros(0, dtype=int)
    variables = VariableSlopes(
        np.zeros((1, 3, POINTS, 2)),
        CurvePattern(none, none, POINTS, 2),
        np.zeros((3, 0)),
    )
    with pytest.raises(ValueError, match="different points"):
        variables.find_entries(np.zeros((3, POINTS, 1, 3)))
    motion = MotionSlopes(*np.zeros((4, POINTS, N, 3)))
    states = np.zeros((3, POINTS, N))
    groups = ValueGroups([None], [1])
    partials = [((np.zeros((POINTS, 1, N)), None, None, None), None)]
    with pytest.raises(ValueError, match="different points"):
        differentiate(groups, motion, states, partials, variables)
    with pytest.raises(ValueError, match="joint"):
        ValueGroups([one_value("q", chain, N)], [1])
    torque = one_value("torque", chain)
    groups = ValueGroups([torque], [1])
    with pytest.raises(ValueError, match="needs the torque"):
        groups.values(states)
    with pytest.raises(ValueError, match=r"has 3 joints; needed: 5"):
        groups.values(states[:, :, :3], states[0, :, :3])
    fewer = MotionSlopes(*np.zeros((4, POINTS, 3, 3)))
    with pytest.raises(ValueError, match=r"has 3 joints; needed: 5"):
        differentiate(groups, fewer, states[:, :, :3], [])
    shorter = one_value("q", chain_of(*random_model(3, 1)))
    with pytest.raises(ValueError, match="different numbers"):
        ValueGroups([torque, shorter], [1, 1])
    elsewhere = one_value("torque", chain_of(*random_model(N, 2)))
    with pytest.raises(ValueError, match="more than one chain"):
        ValueGroups([torque, elsewhere], [1, 1])


def test_partials_by_the_jerk_need_its_slopes(chain):
    motion = MotionSlopes(*np.zeros((4, POINTS, N, 3)))
    states = np.zeros((3, POINTS, N))
    partials = np.zeros((POINTS, 1, N))
    given = [((None, None, None, partials), None)]
    with pytest.raises(ValueError, match="qdddot_y"):
        differentiate(ValueGroups([None], [1]), motion, states, given)
    jerk = one_value("qdddot", chain)
    with pytest.raises(ValueError, match="qdddot_y"):
        differentiate(ValueGroups([jerk], [1]), motion, states, [])
    with pytest.raises(ValueError, match="qdddot"):
        ValueGroups([jerk], [1]).values(states)
