"""Closed forms of which the sign of det J_nr tells the branches apart.

The sign changes only where two answers meet. Divided by its largest size, the determinant is the branch margin. Some
families have several answers of one sign: along a motion continuity tells these apart.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.ik.protocol import IKSolver, NotApplicableError
from brachis.ik.screws import ChainGeometry
from brachis.ik.vectors import EXACT

SINGULAR = "J_nr is singular everywhere"
"""The reason against a decomposition whose determinant is zero in all postures."""


def largest_size(values: np.ndarray) -> float:
    """Return the largest size of det J_nr at random postures.

    Raises
    ------
    NotApplicableError
        J_nr is singular in all of them.
    """
    size = float(np.abs(values).max())
    if size < EXACT:
        raise NotApplicableError(SINGULAR)
    return size


class DeterminantSolver(IKSolver):
    """What closed forms have in common whose branches are the signs of det J_nr.

    Parameters
    ----------
    chain : ChainGeometry
    joints : sequence of int
        The non-redundant ones, ascending.
    name : str
        What the labels begin with.
    postures : (K, n) ndarray, optional
        Random ones, by which the determinant is sized up.
    """

    def __init__(
        self,
        chain: ChainGeometry,
        joints: Sequence[int],
        name: str = "determinant",
        postures: np.ndarray | None = None,
    ) -> None:
        self.branches: tuple[str, ...] = (f"{name}_positive", f"{name}_negative")
        self._chain = chain
        self._joints = list(joints)
        if postures is None:
            rng = np.random.default_rng(0)
            postures = rng.uniform(-np.pi, np.pi, (64, chain.n))
        self._random = self._determinants(postures)
        self._scale = largest_size(self._random)

    def _determinants(self, q: np.ndarray) -> np.ndarray:
        """Det J_nr, (K,), in postures (K, n)."""
        return self._chain.screws_at(q).determinant(self._joints)

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Return det J_nr, (K, 1), divided by its largest size, with the sign of the branch."""
        sign = 1.0 if branch == 0 else -1.0
        values = self._determinants(q)
        return sign * values[:, None] / self._scale
