"""Motion along a path on random chains: what is refused, copied and kept; `tests/kinematics` has the differences."""

import copy
import pickle

import numpy as np
import pytest

from brachis.kernel import (
    Fault,
    PathMotion,
    Prescribed,
    find_least_singular,
    largest_parts,
)
from brachis.robot.chain import chain_of
from support.random_chains import random_model

POINTS = 11
CURVES_AND_PATH = ("y", "ydot", "yddot", "xi", "xi_ds", "xi_dds")
CASES = {
    "pose, r = 0": (6, Prescribed((0, 1, 2), 3, in_tool_axes=True)),
    "position, r = 4": (7, Prescribed((0, 1, 2))),
    "two rows and pitch, r = 1": (
        4,
        Prescribed((0, 2), 1, heading=(1, 0, 2), sign=-1.0),
    ),
}


def motion_in(chain, asked, q, path, tables, curves):
    """Motion in known postures; `tables` are [C, p] and, or not, its derivatives."""
    given = dict(zip(("xi", "xi_ds", "xi_dds"), path, strict=True))
    given |= dict(zip(("ydot", "yddot"), curves, strict=True))
    given["y"] = np.zeros_like(curves[0])
    given |= dict(zip(("rows", "turning"), tables, strict=False))
    motion = PathMotion.prepare(chain, asked, given)
    motion.q[:] = q
    motion.evaluate()
    return motion


@pytest.fixture(
    params=[(name, turns) for name in CASES for turns in (False, True)], ids=str
)
def motion(request):
    """From everything that a motion is computed from, at random."""
    name, turns = request.param
    n, asked = CASES[name]
    rng = np.random.default_rng(n)
    chain = chain_of(*random_model(n, n))
    r = n - asked.count
    path = tuple(rng.normal(size=(3, POINTS, asked.count)))
    tables = [rng.normal(size=(POINTS, r, n + 1))]
    if turns and r:
        tables.append(rng.normal(size=(3, POINTS, r, n + 1)))
    q = rng.normal(size=(POINTS, n))
    curves = tuple(rng.normal(size=(2, POINTS, 1 + r)))
    return motion_in(chain, asked, q, path, tables, curves)


@pytest.mark.parametrize(
    ("row", "side", "fault"),
    [
        ([0.0, 0.0, 0.0], 0.0, Fault.SINGULAR),
        ([0.0, 0.0, 1.0], 0.0, None),
        ([0.0, 0.0, -1.0], 1.0, Fault.SINGULAR),
        ([0.0, 0.0, -1.0], -1.0, None),
    ],
)
def test_singular_postures_and_other_sides_are_faults(row, side, fault):
    chain = chain_of(*random_model(3, 1))
    given = dict.fromkeys(CURVES_AND_PATH, np.ones((1, 2)))
    given["rows"] = np.array([[*row, 0.0]])
    asked = Prescribed((0, 1))
    upright = PathMotion.prepare(chain, asked, given | {"rows": np.eye(3, 4)[[2]]})
    upright.q[:] = 0.3
    upright.evaluate()
    side *= np.sign(upright.determinants[0])
    motion = PathMotion.prepare(chain, asked, given, side=side)
    motion.q[:] = 0.3
    assert motion.evaluate() is fault


def test_what_is_not_finite_is_no_posture():
    chain = chain_of(*random_model(3, 1))
    given = dict.fromkeys(CURVES_AND_PATH, np.ones((1, 2)))
    given["rows"] = np.eye(3, 4)[[2]]
    motion = PathMotion.prepare(chain, Prescribed((0, 1)), given)
    motion.q[:] = np.nan
    assert motion.evaluate() is Fault.NO_POSTURE


def test_conditions_of_other_shapes_are_errors():
    chain = chain_of(*random_model(3, 1))
    ones = np.ones((1, 2))
    given = {"y": ones, "rows": np.zeros((1, 1, 4)), "turning": np.zeros((2, 1, 1, 4))}
    with pytest.raises(ValueError, match="needed"):
        PathMotion.prepare(chain, Prescribed((0, 1)), given)


def test_what_the_library_would_read_beyond_its_end_is_an_error():
    chain = chain_of(*random_model(3, 1))
    asked = Prescribed((0, 1))
    ones = np.ones((1, 2))
    given = {"y": ones, "rows": np.zeros((1, 4))}
    with pytest.raises(ValueError, match="rows of the motion is missing"):
        PathMotion.prepare(chain, asked, {"y": ones})
    with pytest.raises(ValueError, match="targets of the motion is missing"):
        PathMotion.prepare(chain, asked, given | {"reference": np.zeros((1, 7))})
    with pytest.raises(ValueError, match="ydot, yddot, xi, xi_ds, xi_dds of the"):
        PathMotion.prepare(chain, asked, given).evaluate()


def test_derivatives_are_those_of_the_last_evaluation(motion):
    known = [own.copy() for own in motion.derivatives()]
    q = motion.q.copy()
    motion.q[:] = q + 0.1
    motion.evaluate()
    assert np.abs(motion.derivatives()[0] - known[0]).max() > 1e-3
    motion.q[:] = q
    motion.evaluate()
    for own, first in zip(motion.derivatives(), known, strict=True):
        np.testing.assert_array_equal(own, first)


@pytest.mark.parametrize(
    "send",
    [copy.copy, copy.deepcopy, lambda own: pickle.loads(pickle.dumps(own))],  # noqa: S301  (our own)
)
def test_a_motion_can_be_copied_and_sent(motion, send):
    again = send(motion)
    for name in ("q", "qdot", "gradient", "inverse"):
        np.testing.assert_array_equal(getattr(again, name), getattr(motion, name))
    for own, other in zip(again.derivatives(), motion.derivatives(), strict=True):
        np.testing.assert_array_equal(own, other)


def test_no_points_give_no_motion():
    chain = chain_of(*random_model(3, 1))
    given = dict.fromkeys(CURVES_AND_PATH, np.zeros((0, 2)))
    given["rows"] = np.eye(3, 4)[[2]]
    motion = PathMotion.prepare(chain, Prescribed((0, 1)), given)
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
    np.testing.assert_allclose(values, known[:, -1], rtol=1e-12)
    along = np.abs(np.sum(vectors * right[:, -1], axis=1))
    np.testing.assert_allclose(along, 1.0, atol=1e-12)


def test_largest_parts_of_steps():
    rng = np.random.default_rng(9)
    rows = rng.normal(size=(6, 4, 5))
    step = rng.normal(size=(POINTS, 5))
    origin = rng.integers(0, 6, POINTS)
    known = np.abs(np.einsum("eij,ej->ei", rows[origin], step)).max(axis=1)
    np.testing.assert_allclose(largest_parts(rows, step, origin), known, atol=1e-14)
    with pytest.raises(ValueError, match="nowhere"):
        largest_parts(rows, step, origin + 6)
