"""Motion along a path, its derivatives and the chain rule against NumPy's formulas, on random chains."""

import copy
import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.kernel import (
    Fault,
    PathMotion,
    Prescribed,
    find_largest_products,
    find_least_singular,
    tool_derivatives,
)
from brachis.robot.chain import chain_of
from support.random_chains import random_model

POINTS = 11
PLANAR_CHAIN = chain_of(*random_model(3, 1))
PLACE = Prescribed((0, 1))
LAST_STAYS = np.eye(3, 4)[[2]]
CURVES_AND_PATH = ("y", "ydot", "yddot", "xi", "xi_ds", "xi_dds")
CASES = {
    "pose, r = 0": (6, Prescribed((0, 1, 2), 3, in_tool_axes=True)),
    "pose, r = 2": (8, Prescribed((0, 1, 2), 3, in_tool_axes=True)),
    "position, r = 4": (7, Prescribed((0, 1, 2))),
    "one row, r = 2": (3, Prescribed((2,))),
    "two rows and pitch, r = 1": (
        4,
        Prescribed((0, 2), 1, heading=(1, 0, 2), sign=-1.0),
    ),
    "three rows and yaw, r = 0": (4, Prescribed((2, 0, 1), 1)),
    "two rows and orientation, r = 1": (6, Prescribed((2, 0), 3)),
    "orientation, r = 2": (5, Prescribed((), 3)),
}


def motion_in(chain, asked, q, path, tables, curves):
    """Motion in known postures; `tables` are [C, p] and, or not, its derivatives."""
    given = dict(zip(("xi", "xi_ds", "xi_dds"), path, strict=True))
    given |= dict(zip(("ydot", "yddot"), curves, strict=True))
    given["y"] = np.zeros_like(curves[0])
    given |= dict(zip(("rows", "row_derivatives"), tables, strict=False))
    motion = PathMotion.prepare(chain, asked, given)
    motion.q[:] = q
    motion.evaluate()
    return motion


def prepare(rows, count=1, **options):
    """Motion of three joints in a plane under a condition, (k, 4), whose curves and path are ones."""
    given = dict.fromkeys(CURVES_AND_PATH, np.ones((count, 2))) | {"rows": rows}
    return PathMotion.prepare(PLANAR_CHAIN, PLACE, given, **options)


def rates_of(asked, twists):
    """Prescribed rows, (K, m, n), of columns (6, K, n)."""
    turning = [3, 4, 5]
    if asked.turns == 1:
        turning = [6 - sum(asked.heading[1:])]
    rows = [*asked.axes, *turning[: asked.turns]]
    return np.moveaxis(twists[rows], 0, 1)


def slopes_of(asked, twists, qdot, qddot):
    """Derivatives of the prescribed rates and of theirs."""
    slopes = tool_derivatives(twists, qdot, qddot, in_tool_axes=asked.in_tool_axes)
    return [rates_of(asked, own) for own in slopes]


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
    tables = [rng.normal(size=(POINTS, r, n + 1))]
    q = rng.normal(size=(POINTS, n))
    conditions = SimpleNamespace(rows=tables[0][..., :n], turning=None, drift=None)
    if turns and r:
        tables.append(rng.normal(size=(3, POINTS, r, n + 1)))
        conditions.turning = tables[1][:2, ..., :n]
        drift = np.einsum("okij,kj->oki", tables[1][..., :n], q)
        conditions.drift = drift - tables[1][..., n]
    curves = tuple(rng.normal(size=(2, POINTS, 1 + r)))
    motion = motion_in(chain, asked, q, path, tables, curves)
    return chain, asked, q, path, conditions, curves, motion


def test_motion(case):
    chain, asked, q, (xi, xi_ds, _), conditions, (ydot, yddot), found = case
    m = asked.count
    _, _, twists = chain.tool(q, in_tool_axes=asked.in_tool_axes)
    assert_allclose(found.twists, twists, atol=1e-12)
    augmented = np.concatenate([rates_of(asked, twists), conditions.rows], axis=1)
    inverse = np.linalg.inv(augmented)
    assert_allclose(found.inverse, inverse, rtol=1e-9, atol=1e-9)
    assert_allclose(found.determinants, np.linalg.det(augmented), rtol=1e-10)
    inverse = found.inverse
    right = np.concatenate([xi, np.zeros((POINTS, len(q[0]) - m))], axis=1)
    if conditions.drift is not None:
        right[:, m:] = -conditions.drift[0]
    gradient = np.concatenate([inverse @ right[:, :, None], inverse[:, :, m:]], axis=2)
    assert_allclose(found.gradient, gradient, atol=1e-10)
    qdot = np.einsum("kij,kj->ki", gradient, ydot)
    assert_allclose(found.qdot, qdot, atol=1e-10)
    slopes, *_ = slopes_of(asked, twists, qdot, 0.0 * qdot)
    bias = np.einsum("kij,kj->ki", slopes, qdot)
    sdot = ydot[:, :1]
    wanted = np.concatenate([xi_ds * sdot**2 - bias, 0.0 * right[:, m:]], axis=1)
    if conditions.turning is not None:
        turned = np.einsum("kij,kj->ki", conditions.turning[0], qdot)
        wanted[:, m:] = -2.0 * sdot * turned - conditions.drift[1] * sdot**2
    qddot = np.einsum("kij,kj->ki", gradient, yddot)
    qddot += np.einsum("kij,kj->ki", inverse, wanted)
    scale = np.abs(qddot).max()
    assert_allclose(found.qddot / scale, qddot / scale, atol=1e-11)


def test_derivatives(case):
    """The module's formulas in NumPy."""
    _, asked, _, (_, xi_ds, xi_dds), conditions, (ydot, yddot), motion = case
    m = asked.count
    V_q, A_q, A_v = slopes_of(asked, motion.twists, motion.qdot, motion.qddot)  # noqa: N806  (the field's letters)
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
        assert_allclose(found / scale, own / scale, atol=1e-11)


def test_singular_slopes(case):
    """The left singular vector, by the change of J_aug, by the right one."""
    _, asked, q, _, conditions, _, motion = case
    values, vectors = find_least_singular(motion.inverse)
    found, found_s = motion.singular_slopes(values, vectors)
    left = values[:, None] * np.einsum("kji,kj->ki", motion.inverse, vectors)
    slopes, *_ = slopes_of(asked, motion.twists, vectors, 0.0 * q)
    m = asked.count
    known = np.einsum("ki,kij->kj", left[:, :m], slopes)
    assert_allclose(found, known, atol=1e-11 * max(1.0, np.abs(known).max()))
    known = np.zeros(POINTS)
    if conditions.turning is not None:
        turned = np.einsum("kij,kj->ki", conditions.turning[0], vectors)
        known = np.sum(left[:, m:] * turned, axis=1)
    assert_allclose(found_s, known, atol=1e-11)


def test_rows_that_are_the_same_everywhere_are_given_once():
    n, asked = 7, Prescribed((0, 1, 2), 3, in_tool_axes=True)
    rng = np.random.default_rng(4)
    chain = chain_of(*random_model(n, n))
    row = rng.normal(size=(1, n + 1))
    q = rng.normal(size=(POINTS, n))
    path = tuple(rng.normal(size=(3, POINTS, 6)))
    curves = tuple(rng.normal(size=(2, POINTS, 2)))
    many = np.broadcast_to(row, (POINTS, 1, n + 1))
    motions = [
        motion_in(chain, asked, q, path, [rows], curves)
        for rows in (many.copy(), many, row)
    ]
    for name in ("gradient", "qdot", "qddot", "determinants"):
        first, *others = (getattr(own, name) for own in motions)
        for own in others:
            assert_array_equal(own, first)


@pytest.mark.parametrize(
    "row, side, fault",
    [
        ([0.0, 0.0, 0.0], 0.0, Fault.SINGULAR),
        ([0.0, 0.0, 1.0], 0.0, None),
        ([0.0, 0.0, -1.0], 1.0, Fault.SINGULAR),
        ([0.0, 0.0, -1.0], -1.0, None),
    ],
)
def test_what_is_singular_or_on_the_other_side_is_said(row, side, fault):
    upright = prepare(LAST_STAYS)
    upright.q[:] = 0.3
    upright.evaluate()
    side *= np.sign(upright.determinants[0])
    motion = prepare(np.array([[*row, 0.0]]), side=side)
    motion.q[:] = 0.3
    assert motion.evaluate() is fault


def test_what_is_not_finite_is_no_posture():
    motion = prepare(LAST_STAYS)
    motion.q[:] = np.nan
    assert motion.evaluate() is Fault.NO_POSTURE


POSITIONS = {"y": np.ones((1, 2))}
ROWS = {"rows": np.zeros((1, 4))}


@pytest.mark.parametrize(
    "given, message",
    [
        (
            {"rows": np.zeros((1, 1, 4)), "row_derivatives": np.zeros((2, 1, 1, 4))},
            "needed",
        ),
        ({}, "rows of the motion is missing"),
        (ROWS | {"reference": np.zeros((1, 7))}, "targets of the motion is missing"),
    ],
)
def test_what_the_library_would_read_beyond_its_end_is_refused(given, message):
    with pytest.raises(ValueError, match=message):
        PathMotion.prepare(PLANAR_CHAIN, PLACE, POSITIONS | given)


def test_a_motion_without_rates_is_not_evaluated():
    motion = PathMotion.prepare(PLANAR_CHAIN, PLACE, POSITIONS | ROWS)
    with pytest.raises(ValueError, match="ydot, yddot, xi, xi_ds, xi_dds of the"):
        motion.evaluate()


def test_derivatives_are_those_of_the_last_evaluation(case):
    *_, motion = case
    known = copy.deepcopy(motion.derivatives())
    q = motion.q.copy()
    motion.q[:] = q + 0.1
    motion.evaluate()
    assert np.abs(motion.derivatives()[0] - known[0]).max() > 1e-3
    motion.q[:] = q
    motion.evaluate()
    for own, first in zip(motion.derivatives(), known, strict=True):
        assert_array_equal(own, first)


@pytest.mark.parametrize(
    "send",
    [copy.copy, copy.deepcopy, lambda own: pickle.loads(pickle.dumps(own))],  # noqa: S301  (our own)
)
def test_a_motion_can_be_copied_and_sent(case, send):
    *_, motion = case
    again = send(motion)
    for name in ("q", "qdot", "gradient", "inverse"):
        assert_array_equal(getattr(again, name), getattr(motion, name))
    for own, other in zip(again.derivatives(), motion.derivatives(), strict=True):
        assert_array_equal(own, other)


def test_no_points_give_no_motion():
    motion = prepare(LAST_STAYS, count=0)
    assert motion.evaluate() is None
    assert motion.derivatives()[0].shape == (0, 3, 2)


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
    assert_allclose(values, known[:, -1], rtol=1e-12)
    along = np.abs(np.sum(vectors * right[:, -1], axis=1))
    assert_allclose(along, 1.0, atol=1e-12)


def test_largest_products_of_steps():
    rng = np.random.default_rng(9)
    rows = rng.normal(size=(6, 4, 5))
    step = rng.normal(size=(POINTS, 5))
    origin = rng.integers(0, 6, POINTS)
    known = np.abs(np.einsum("eij,ej->ei", rows[origin], step)).max(axis=1)
    assert_allclose(find_largest_products(rows, step, origin), known, atol=1e-14)
    with pytest.raises(ValueError, match="a point that does not exist"):
        find_largest_products(rows, step, origin + 6)
