"""Closed forms whose answers nothing but the sign of det J_nr tells apart.

The sign changes only where two answers merge; within a sign continuity alone tells the alternatives apart. They are put
in order by their angles, without repetitions. The order means nothing: it is there so that equal questions get equal
answers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.ik.arm import determinant
from brachis.ik.protocol import IKSolver
from brachis.ik.screws import ChainGeometry
from brachis.robot.joints import TURN

_SAME = 1e-5
"""Answers whose angles (rad) and slides (m, in proportion to their size) differ by less are the same."""
_CELLS = 1024
"""Answers are put in order by angles in so many parts of a turn, so that rounding seldom changes it."""


class SignSolver(IKSolver):
    """What such closed forms have in common.

    Parameters
    ----------
    chain : ChainGeometry
    joints : sequence of int
        The non-redundant ones, ascending.
    scale : float
        Largest size of det J_nr.
    alternatives : int
        Largest number of answers of a sign.
    """

    branches = ("determinant_positive", "determinant_negative")

    def __init__(
        self,
        chain: ChainGeometry,
        joints: Sequence[int],
        scale: float,
        alternatives: int,
    ) -> None:
        self.alternatives = alternatives
        self._chain = chain
        self._joints = tuple(joints)
        self._scale = scale

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """See `IKSolver.branch_margins`: det J_nr, divided by its largest size."""
        sign = 1.0 if branch == 0 else -1.0
        return (
            sign
            * determinant(self._chain.posed(q), self._joints)[:, None]
            / self._scale
        )

    def _arranged(
        self, joints: np.ndarray, samples: np.ndarray, negative: np.ndarray, count: int
    ) -> np.ndarray:
        """Arrange answers, angles in (-pi, pi].

        Parameters
        ----------
        joints : (N, m) ndarray
        samples : (N,) int ndarray
            To which of the samples they belong.
        negative : (N,) bool ndarray
            Whether det J_nr is negative.
        count : int
            Number of samples.

        Returns
        -------
        (count, 2, A, m) ndarray
            NaN where there is no further answer.
        """
        revolute = self._chain.revolute[list(self._joints)]
        marks = 0.5 + np.where(
            revolute, joints / TURN, 0.5 * joints / (1.0 + np.abs(joints))
        )
        keys = np.zeros(len(joints), dtype=np.int64)
        for cell in np.floor(_CELLS * marks[:, revolute]).astype(np.int64).T:
            keys = keys * (_CELLS + 1) + cell
        groups = 2 * samples + negative
        order = np.lexsort((keys, groups))
        order = order[~_repeated(marks[order], groups[order])]
        groups = groups[order]
        places = np.arange(len(groups)) - np.searchsorted(groups, groups)
        fits = places < self.alternatives
        table = np.full((2 * count, self.alternatives, joints.shape[1]), np.nan)
        table[groups[fits], places[fits]] = joints[order[fits]]
        return table.reshape(count, 2, *table.shape[1:])


def _repeated(marks: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Whether an answer, (N,), is one before it in the same group; marks (N, m) are in turns."""
    repeated = np.zeros(len(marks), dtype=bool)
    for behind in range(1, len(marks)):
        together = np.flatnonzero(groups[behind:] == groups[:-behind])
        if len(together) == 0:
            break
        gap = np.abs(marks[together + behind] - marks[together])
        repeated[together + behind] |= (
            np.minimum(gap, 1.0 - gap).max(axis=1) < _SAME / TURN
        )
    return repeated
