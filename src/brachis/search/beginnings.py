"""Postures at the beginning of a path whose start is free."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.kinematics import Newton
from brachis.problem import Decomposition, Problem
from brachis.robot.joint_space import complement
from brachis.search.cells import Cells

_REACH = 10.0
"""Half of what is drawn of a slide without a range, m."""


def beginnings(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    newton: Newton,
    cells_per_turn: int,
    count: int,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Find postures all over the self-motion manifold at the path's beginning, ranges left out of account.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
        Their closed forms give the postures, on all branches.
    newton : Newton
        Brings random postures to the beginning where there is no closed form.
    cells_per_turn : int
        Spacing of a single redundant joint; see `Cells`.
    count : int
        Choices of several redundant joints, or random postures.
    rng : Generator

    Returns
    -------
    q : (K, n) ndarray
        rad or m.
    seeds : (K,) int ndarray
        Which of the decompositions gave it; -1 where chance did.
    """
    target = problem.path.sample(np.zeros(1)).target
    if not decompositions:
        drawn = _drawn(problem, count, rng)
        q = newton.nearest(np.repeat(target, count, axis=0), drawn)
        q = q[np.isfinite(q).all(axis=1)]
        return q, np.full(len(q), -1)
    found = []
    for decomposition in decompositions:
        cells = Cells.of(decomposition, cells_per_turn, None)
        q_r = cells.positions(cells.everywhere(count, rng))
        answers = decomposition.match.solver.solve(np.repeat(target, len(q_r), axis=0), q_r)
        q = np.empty((*answers.shape[:3], problem.robot.n))
        q[..., list(decomposition.redundant)] = q_r[:, None, None]
        q[..., complement(problem.robot.n, decomposition.redundant)] = answers
        found.append(q[np.isfinite(q).all(axis=3)])
    return np.concatenate(found), np.repeat(np.arange(len(found)), [len(q) for q in found])


def _drawn(problem: Problem, count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw postures, (count, n), from the ranges; of joints without one from a turn or from twice the reach."""
    limits, reach = problem.robot.limits, np.where(problem.robot.revolute, np.pi, _REACH)
    lower, upper = limits.position_lower, limits.position_upper
    low = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper, reach) - 2.0 * reach)
    high = np.where(np.isfinite(upper), upper, low + 2.0 * reach)
    return rng.uniform(low, high, (count, problem.robot.n))
