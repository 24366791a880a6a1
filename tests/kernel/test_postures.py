"""Postures along a path: which answer of a closed form goes on with a motion, and the turns of angles."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from brachis.kernel import Branch, Fault, Formula, PathMotion, Prescribed
from brachis.robot.chain import chain_of
from support.random_chains import random_model

TURN = 2.0 * np.pi
N = 3
ASKED = Prescribed((0, 1))
REDUNDANT, OTHERS = np.array([1]), np.array([0, 2])


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def prepare(answers, q_r, *, turns=(1, 0, 1), ranged=(0, 0, 0), start, **given):
    """A motion of three joints, of which joint 1 is redundant, with answers (K, A, 2)."""
    count = len(answers)
    masks = np.array([turns, ranged], dtype=bool)
    alternatives = answers.shape[1]
    branch = Branch(REDUNDANT, OTHERS, *masks, np.array(start), alternatives)
    zeros = np.zeros((count, 2))
    given = dict.fromkeys(("xi", "xi_ds", "xi_dds", "ydot", "yddot"), zeros) | given
    given |= {"y": np.column_stack([zeros[:, 0], q_r]), "rows": np.eye(N, N + 1)[[1]]}
    chain = chain_of(*random_model(N, 1))
    motion = PathMotion.prepare(chain, ASKED, given, branch=branch)
    motion.answers[:] = answers
    return motion


def test_turns_stay_where_an_answer_is_missing():
    answers = np.array([[[0.0, 7.0]], [[np.nan, 7.0]]])
    motion = prepare(answers, np.zeros(2), start=np.zeros(N))
    assert_array_equal(motion.find_postures()[:, OTHERS], answers[:, 0])


def test_the_answer_nearest_to_a_known_posture_is_taken(rng):
    answers = rng.uniform(-np.pi, np.pi, (20, 5, 2))
    answers[3, 1] = np.nan
    answers[7] = np.nan
    near = rng.uniform(-np.pi, np.pi, (20, N))
    gap = np.remainder(answers - near[:, None, OTHERS] + np.pi, TURN) - np.pi
    distance = np.nan_to_num(np.linalg.norm(gap, axis=2), nan=np.inf)
    known = answers[np.arange(20), distance.argmin(axis=1)]
    motion = prepare(answers, near[:, 1], start=np.zeros(N), near=near)
    found = motion.find_postures()[:, OTHERS]
    turned = np.remainder(found - known + np.pi, TURN) - np.pi
    kept = np.arange(20) != 7
    assert_allclose(turned[kept], 0.0, atol=1e-12)
    assert np.isnan(found[7]).all()


def test_each_answer_follows_the_one_before(rng):
    path = np.cumsum(rng.uniform(-0.1, 0.1, (30, 2)), axis=0)
    away = path[:, None] + np.array([0.0, 2.0, -2.5])[None, :, None]
    answers = np.take(away, [2, 0, 1], axis=1)
    answers[12] = np.nan  # one is missing
    start = np.array([path[0, 0], 0.0, path[0, 1]])
    motion = prepare(answers, np.zeros(30), turns=(0, 0, 0), start=start)
    found = motion.find_postures()[:, OTHERS]
    kept = np.arange(30) != 12
    assert_array_equal(found[kept], path[kept])
    assert np.isnan(found[12]).all()


def fast_motion(steps):
    """Times, angle, velocity and acceleration of a joint that turns several times, up to 9.4 rad a step of nine."""
    t = np.linspace(0.0, 1.0, steps)
    return t, 40.0 * t**2 + 1.0, 80.0 * t, np.full(steps, 80.0)


def turning(q, ranged):
    """A motion of joint 1 alone, the redundant one, whose turns are counted."""
    t, _, qdot, qddot = fast_motion(len(q))
    rates = {"ydot": np.column_stack([0.0 * t, qdot])}
    rates["yddot"] = np.column_stack([0.0 * t, qddot])
    still = np.full((len(q), 1, 2), 0.3)
    masks = {"turns": (0, 1, 0), "ranged": (0, ranged, 0), "start": (0.3, q[0], 0.3)}
    return prepare(still, np.remainder(q, TURN), **masks, t=t, **rates)


def test_turns_are_counted_by_velocities():
    _, q, _, _ = fast_motion(9)
    motion = turning(q, ranged=1)
    assert not motion.evaluate()
    assert_allclose(motion.qdot[:, 1], fast_motion(9)[2], atol=1e-9)
    assert_allclose(motion.q[:, 1], q, atol=1e-12)


@pytest.mark.parametrize("ranged, fault", [(1, Fault.TURNS_TOO_FAR), (0, None)])
def test_turns_that_are_not_certain(ranged, fault):
    _, q, _, _ = fast_motion(9)
    q[4:] += 0.4 * TURN
    assert turning(q, ranged).evaluate() is fault


def branch_of(redundant, others, *answers):
    mask = np.ones(N, dtype=bool)
    return Branch(redundant, others, mask, mask, np.zeros(N), *answers)


def test_a_branch_comes_back_from_another_process():
    branch = branch_of(REDUNDANT, OTHERS)
    assert branch.address
    again = pickle.loads(pickle.dumps(branch))  # noqa: S301  (our own)
    assert_array_equal(again.nonredundant, OTHERS)


def test_what_does_not_fit_is_an_error():
    with pytest.raises(ValueError, match="must be all joints"):
        _ = branch_of(REDUNDANT, REDUNDANT).address
    with pytest.raises(ValueError, match="no solutions to choose from"):
        _ = branch_of(REDUNDANT, OTHERS, 0).address
    formula = Formula.of(lambda a, b: np.stack([a[:, 0], b[:, 0]], axis=1), 2, 1)
    with pytest.raises(ValueError, match=r"the solutions have the shape \(2,\)"):
        _ = branch_of(REDUNDANT, OTHERS, 1, formula).address


def test_a_branch_of_another_chain_is_an_error():
    chain = chain_of(*random_model(4, 1))
    given = {"y": np.zeros((1, 2)), "rows": np.zeros((1, 4))}
    given["targets"] = np.zeros((1, 2))
    branch = branch_of(REDUNDANT, OTHERS)
    with pytest.raises(ValueError, match="has 3 joints, 1 redundant; needed: 4 and 1"):
        PathMotion.prepare(chain, Prescribed((0, 1, 2)), given, branch=branch)
    branch = branch_of(OTHERS, REDUNDANT)
    chain = chain_of(*random_model(N, 1))
    with pytest.raises(ValueError, match="has 3 joints, 2 redundant; needed: 3 and 1"):
        PathMotion.prepare(chain, ASKED, given, branch=branch)
    formula = Formula.of(lambda a: a[:, None, :2], 3)
    branch = branch_of(REDUNDANT, OTHERS, 1, formula)
    with pytest.raises(ValueError, match=r"takes \(3,\) numbers; needed: \(2, 1\)"):
        PathMotion.prepare(chain, ASKED, given, branch=branch)
