"""Branches of arms with a spherical wrist: their labels along curves, and where two of them meet."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import brentq

from support.screw_arms import BASES, panda, screw_robot, seven_joints, wrist
from support.spatial import rail_arm
from support.wrist_bench import Bench, wrapped

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
    "slides": (lambda: screw_robot([*BASES["PR|P"], *wrist(np.random.default_rng(1))]), (), (0, 4)),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_labels_follow_the_branch_along_smooth_curves(name):
    make, redundant, _ = SMOOTH[name]
    bench = Bench(make(), redundant, postures=1)
    rng, t = np.random.default_rng(11), np.linspace(0.0, 1.0, 2001)[:, None]
    n, changes, followed = bench.robot.n, 0, 0
    for _ in range(4):
        q = rng.uniform(-2.0, 2.0, n) + rng.uniform(0.5, 2.0, n) * np.sin(2.0 * np.pi * t * rng.uniform(0.3, 1.0, n))
        postures = bench.answers(q)
        for branch in range(postures.shape[1]):
            exists = np.isfinite(postures[:, branch]).all(axis=1)
            margin = np.full(len(t), -1.0)
            margin[exists] = bench.solver.branch_margins(postures[exists, branch], branch).min(axis=1)
            assert np.all(margin[exists] > -1e-7), "an answer lies outside its own branch"
            steps = np.diff(postures[:, branch][:, bench.rest], axis=0)
            inside = (margin[1:] > 0.15) & (margin[:-1] > 0.15)
            assert np.abs(wrapped(steps, bench.turning))[inside].max(initial=0.0) < 0.2, "the branch jumps"
            followed += np.count_nonzero(inside)
        crossings = np.diff(np.sign(bench.margins(q)[:, 0]), axis=0) != 0.0
        turned = np.diff(np.sign(bench.determinant(q))) != 0.0
        np.testing.assert_array_equal(turned, crossings.sum(axis=1) % 2 == 1)
        changes += np.count_nonzero(turned)
    assert changes >= 2, "no curve crossed a boundary: the test shows nothing"
    assert followed > 4000


def other_answer(bench, posture, kind):
    """The answer in the branch that one margin's sign tells apart from the posture's own."""
    margins = bench.margins(posture[None])[0]
    others = np.delete(margins, kind, axis=1)
    branch = np.flatnonzero((margins[:, kind] < 0.0) & (others > 0.0).all(axis=1))
    assert len(branch) == 1
    return bench.answers(posture[None])[0, branch[0]]


@pytest.mark.parametrize("name", SMOOTH)
def test_margins_vanish_where_two_answers_meet(name):
    make, redundant, steps = SMOOTH[name]
    bench = Bench(make(), redundant)
    assert bench.margins(bench.q[:1]).shape[2] == len(steps)
    largest, met = np.abs(bench.determinant(bench.q)).max(), [0] * len(steps)
    for (start, end), kind in itertools.product(itertools.pairwise(bench.q[:100] * 0.8), range(len(steps))):

        def margin(x, start=start, end=end, kind=kind):
            return bench.solver.branch_margins((start + x * (end - start))[None], 0)[0, kind]

        if margin(0.0) * margin(1.0) > 0.0:
            continue
        at = brentq(margin, 0.0, 1.0, xtol=1e-15)
        edge, beside = start + at * (end - start), start + (at + 1e-5) * (end - start)
        if np.abs(np.delete(bench.margins(edge[None])[0, 0], kind)).min() < 0.1 or abs(margin(at + 1e-5)) < 1e-6:
            continue
        assert np.abs(bench.determinant(edge[None])[0]) < 1e-12 * largest
        other, step = other_answer(bench, beside, kind), steps[kind]
        if step is None:  # the rail would have to go to infinity
            assert np.isnan(other[bench.rest]).all()
            met[kind] += 1
        else:  # or the step's joint moves nothing: then its two answers differ
            met[kind] += np.abs(wrapped(other - beside, turning=True))[step] < 1e-3
    assert min(met) >= 3, "some boundary was not visited"
