"""Motion along a path, its derivatives and the chain rule against NumPy's formulas, on random chains."""

import numpy as np
import pytest

from brachis.kernel import (
    Conditions,
    MotionSlopes,
    PathMotion,
    Prescribed,
    apply_chain_rule,
    find_entries,
    find_least_singular,
    largest_parts,
    tool_derivatives,
)
from brachis.robot.chain import chain_of
from support.random_chains import random_model

POINTS = 11
CASES = {
    "pose, r = 0": (6, Prescribed()),
    "pose, r = 2": (8, Prescribed()),
    "position, r = 4": (7, Prescribed((0, 1, 2))),
    "one row, r = 2": (3, Prescribed((2,))),
    "two rows and yaw, r = 1": (4, Prescribed((0, 2), 1, -1.0)),
}


def rates_of(asked, twists):
    """Prescribed rows, (K, m, n), of columns (6, K, n)."""
    if not asked.axes:
        return np.moveaxis(twists, 0, 1)
    rows = [*asked.axes]
    signs = [1.0] * len(rows)
    if asked.tool_axis >= 0:
        rows.append(3 + 3 - sum(asked.axes))
        signs.append(asked.sign)
    return np.moveaxis(twists[rows], 0, 1) * np.array(signs)[:, None]


@pytest.fixture(
    params=[(name, turns) for name in CASES for turns in (False, True)], ids=str
)
def case(request):
    """Everything that a motion is computed from, at random."""
    name, turns = request.param
    n, asked = CASES[name]
    rng = np.random.default_rng(n)
    chain = chain_of(*random_model(n, n))
    m = asked.count
    r = n - m
    path = tuple(rng.normal(size=(3, POINTS, m)))
    rows = rng.normal(size=(POINTS, r, n))
    conditions = Conditions(rows)
    if turns and r:
        turning = rng.normal(size=(2, POINTS, r, n))
        conditions = Conditions(rows, turning, rng.normal(size=(3, POINTS, r)))
    curves = tuple(rng.normal(size=(2, POINTS, 1 + r)))
    q = rng.normal(size=(POINTS, n))
    motion = PathMotion.of(chain, asked, q, path, conditions, curves)
    return chain, asked, q, path, conditions, curves, motion


def test_motion(case):
    chain, asked, q, (xi, xi_ds, _), conditions, (ydot, yddot), found = case
    m = asked.count
    _, _, twists = chain.tool(q, in_tool_axes=not asked.axes)
    np.testing.assert_allclose(found.twists, twists, atol=1e-12)
    augmented = np.concatenate([rates_of(asked, twists), conditions.rows], axis=1)
    inverse = np.linalg.inv(augmented)
    np.testing.assert_allclose(found.inverse, inverse, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.determinants, np.linalg.det(augmented), rtol=1e-10)
    inverse = found.inverse
    right = np.concatenate([xi, np.zeros((POINTS, len(q[0]) - m))], axis=1)
    if conditions.drift is not None:
        right[:, m:] = -conditions.drift[0]
    gradient = np.concatenate([inverse @ right[:, :, None], inverse[:, :, m:]], axis=2)
    np.testing.assert_allclose(found.gradient, gradient, atol=1e-10)
    qdot = np.einsum("kij,kj->ki", gradient, ydot)
    np.testing.assert_allclose(found.qdot, qdot, atol=1e-10)
    slopes = tool_derivatives(twists, qdot, 0.0 * qdot, in_tool_axes=not asked.axes)
    bias = np.einsum("kij,kj->ki", rates_of(asked, slopes[0]), qdot)
    sdot = ydot[:, :1]
    wanted = np.concatenate([xi_ds * sdot**2 - bias, 0.0 * right[:, m:]], axis=1)
    if conditions.turning is not None:
        turned = np.einsum("kij,kj->ki", conditions.turning[0], qdot)
        wanted[:, m:] = -2.0 * sdot * turned - conditions.drift[1] * sdot**2
    qddot = np.einsum("kij,kj->ki", gradient, yddot)
    qddot += np.einsum("kij,kj->ki", inverse, wanted)
    scale = np.abs(qddot).max()
    np.testing.assert_allclose(found.qddot / scale, qddot / scale, atol=1e-11)


def test_derivatives(case):
    """The module's formulas in NumPy."""
    _, asked, _, (_, xi_ds, xi_dds), conditions, (ydot, yddot), motion = case
    m = asked.count
    slopes = tool_derivatives(
        motion.twists, motion.qdot, motion.qddot, in_tool_axes=not asked.axes
    )
    V_q, A_q, A_v = (rates_of(asked, own) for own in slopes)  # noqa: N806  (the field's letters)
    gradient = motion.gradient
    upper = motion.inverse[:, :, :m]
    lower = motion.inverse[:, :, m:]
    sdot = ydot[:, :1]
    sddot = yddot[:, :1]

    right = -V_q @ gradient
    right[:, :, 0] += xi_ds * sdot
    qdot_y = upper @ right
    right = -A_v @ gradient
    right[:, :, 0] += 2.0 * xi_ds * sdot
    qddot_ydot = upper @ right
    if conditions.turning is not None:
        first, second = conditions.turning
        _, e_ds, e_dds = conditions.drift
        rows = first @ gradient * sdot[:, :, None]
        rows[:, :, 0] += np.einsum("kij,kj->ki", first, motion.qdot) + e_ds * sdot
        qdot_y -= lower @ rows
        qddot_ydot -= 2.0 * lower @ rows
    right = -A_q @ gradient - A_v @ qdot_y
    right[:, :, 0] += xi_dds * sdot**2 + xi_ds * sddot
    qddot_y = upper @ right
    if conditions.turning is not None:
        rows = 2.0 * sdot[:, :, None] * (first @ qdot_y)
        rows += (second * sdot[:, :, None] ** 2 + first * sddot[:, :, None]) @ gradient
        rows[:, :, 0] += np.einsum("kij,kj->ki", first, motion.qddot)
        rows[:, :, 0] += 2.0 * sdot * np.einsum("kij,kj->ki", second, motion.qdot)
        rows[:, :, 0] += e_dds * sdot**2 + e_ds * sddot
        qddot_y -= lower @ rows
    known = (qdot_y, qddot_y, qddot_ydot)
    for found, own in zip(motion.derivatives(), known, strict=True):
        scale = max(np.abs(own).max(), 1.0)
        np.testing.assert_allclose(found / scale, own / scale, atol=1e-11)


def test_singular_slopes(case):
    """The left singular vector, by the change of J_aug, by the right one."""
    _, asked, q, _, conditions, _, motion = case
    values, vectors = find_least_singular(motion.inverse)
    found, found_s = motion.singular_slopes(values, vectors)
    left = values[:, None] * np.einsum("kji,kj->ki", motion.inverse, vectors)
    rest = np.zeros_like(q)
    slopes, _, _ = tool_derivatives(
        motion.twists, vectors, rest, in_tool_axes=not asked.axes
    )
    m = asked.count
    known = np.einsum("ki,kij->kj", left[:, :m], rates_of(asked, slopes))
    np.testing.assert_allclose(found, known, atol=1e-11 * max(1.0, np.abs(known).max()))
    known = np.zeros(POINTS)
    if conditions.turning is not None:
        turned = np.einsum("kij,kj->ki", conditions.turning[0], vectors)
        known = np.sum(left[:, m:] * turned, axis=1)
    np.testing.assert_allclose(found_s, known, atol=1e-11)


def test_a_singular_matrix_has_determinant_zero():
    chain = chain_of(*random_model(3, 1))
    rows = np.zeros((1, 1, 3))
    ones = np.ones((1, 2))
    motion = PathMotion.of(
        chain,
        Prescribed((0, 1)),
        np.zeros((1, 3)),
        (ones, ones, ones),
        Conditions(rows),
        (ones, ones),
    )
    assert motion.determinants[0] == 0.0


def test_conditions_that_turn_need_their_drift():
    chain = chain_of(*random_model(3, 1))
    conditions = Conditions(np.zeros((1, 1, 3)), np.zeros((2, 1, 1, 3)))
    ones = np.ones((1, 2))
    rest = (Prescribed((0, 1)), np.zeros((1, 3)), (ones, ones, ones), conditions)
    with pytest.raises(ValueError, match="needed"):
        PathMotion.of(chain, *rest, (ones, ones))


def test_close_least_singular_values():
    """The value is right within 1e-5 of it, whatever mixture of both vectors is found."""
    matrices = np.diag([1.0, 1.0005, 2.0, 3.0])[None]
    values, _ = find_least_singular(np.linalg.inv(matrices))
    assert values[0] * (1.0 + 1e-12) >= 1.0
    assert values[0] < 1.0 + 1e-5


def test_least_singular_values():
    matrices = np.random.default_rng(3).normal(size=(POINTS, 7, 7))
    values, vectors = find_least_singular(np.linalg.inv(matrices))
    _, known, right = np.linalg.svd(matrices)
    np.testing.assert_allclose(values, known[:, -1], rtol=1e-12)
    along = np.abs(np.sum(vectors * right[:, -1], axis=1))
    np.testing.assert_allclose(along, 1.0, atol=1e-12)


@pytest.mark.parametrize("width", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("with_jerk", [False, True])
def test_the_chain_rule(with_jerk, width):
    rng = np.random.default_rng(8)
    n = 5
    parts = [rng.normal(size=(POINTS, n, width)) for _ in range(5)]
    gradient, qdot_y, qddot_y, qddot_ydot, qdddot_y = parts
    motion = MotionSlopes(*parts[:4], qdddot_y if with_jerk else None)
    first = [rng.normal(size=(POINTS, 4, n)) for _ in range(4 if with_jerk else 3)]
    first += [None] * (4 - len(first))
    constant = np.broadcast_to(rng.normal(size=(2, n)), (POINTS, 2, n))
    by_s = rng.normal(size=(POINTS, 2))
    groups = [(first, None), ((None, constant, None, None), by_s)]
    found = apply_chain_rule(groups, [4, 2], motion)
    p_q, p_v, p_a, p_j = first
    known = [
        p_q @ gradient + p_v @ qdot_y + p_a @ qddot_y,
        p_v @ gradient + p_a @ qddot_ydot,
        p_a @ gradient,
    ]
    if with_jerk:
        known[0] += p_j @ qdddot_y
        known[1] += 3.0 * p_j @ qddot_y
        known[2] += 3.0 * p_j @ qdot_y
        known.append(p_j @ gradient)
    for order, own in enumerate(known):
        np.testing.assert_allclose(found[order, :, :4], own, atol=1e-12)
    by_y = constant @ qdot_y
    by_y[:, :, 0] += by_s
    np.testing.assert_allclose(found[0, :, 4:], by_y, atol=1e-12)
    np.testing.assert_allclose(found[1, :, 4:], constant @ gradient, atol=1e-12)
    assert not found[2:, :, 4:].any()

    points = np.array([0, 0, 4, POINTS - 1])
    basis = rng.normal(size=(len(found), 4))
    curves = np.array([1, 0, 2, 1]) % width
    every = rng.normal(size=(2, len(found), POINTS, width))
    entries = find_entries(found, every, points, curves, basis)
    known = np.einsum("bokw,okcw->bkc", every, found).reshape(2 * POINTS, -1)
    np.testing.assert_allclose(entries[: 2 * POINTS], known, atol=1e-12)
    by_one = np.einsum("oz,zoc->zc", basis, found[:, points, :, curves])
    np.testing.assert_allclose(entries[2 * POINTS :], by_one, atol=1e-12)
    with pytest.raises(ValueError, match="point"):
        find_entries(found, every, points + 1, curves, basis)
    with pytest.raises(ValueError, match="curve"):
        find_entries(found, every, points, curves + width, basis)
    with pytest.raises(ValueError, match="as many"):
        find_entries(found, every, points, curves[:-1], basis)
    with pytest.raises(TypeError, match="cast"):
        find_entries(found, every, 1.0 * points, curves, basis)


def test_partials_by_the_jerk_need_its_slopes():
    parts = np.zeros((4, POINTS, 2, 3))
    partials = np.zeros((POINTS, 1, 2))
    with pytest.raises(ValueError, match="qdddot_y"):
        apply_chain_rule(
            [((None, None, None, partials), None)], [1], MotionSlopes(*parts)
        )


def test_largest_parts_of_steps():
    rng = np.random.default_rng(9)
    rows = rng.normal(size=(6, 4, 5))
    step = rng.normal(size=(POINTS, 5))
    origin = rng.integers(0, 6, POINTS)
    known = np.abs(np.einsum("eij,ej->ei", rows[origin], step)).max(axis=1)
    np.testing.assert_allclose(largest_parts(rows, step, origin), known, atol=1e-14)
    with pytest.raises(ValueError, match="nowhere"):
        largest_parts(rows, step, origin + 6)
