"""What a closed-form inverse kinematics solver is, and how a family of them is declared."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from brachis.ik.screws import ChainGeometry
from brachis.robot import TaskMap


class IKSolver(ABC):
    """Solves for the non-redundant joints, for a batch of K samples at once.

    Attributes
    ----------
    branches : tuple of str
        Labels of the B branches, each different. A label names a geometric choice (elbow to one side or the other), so
        that a continuous joint curve keeps its label until a branch margin reaches zero.
    alternatives : int
        How many answers a branch may have, A: those that no geometric choice tells apart. Along a curve they are told
        apart by continuity alone. One, unless a family says otherwise.
    """

    branches: tuple[str, ...]
    alternatives: int = 1

    @abstractmethod
    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Non-redundant joints of every branch.

        Parameters
        ----------
        targets : (K, c) ndarray
            Task coordinates; see `TaskMap` (for poses c = 12: position, then the rotation matrix row by row).
        q_r : (K, r) ndarray
            Redundant joints, chain order.

        Returns
        -------
        (K, B, A, m) ndarray
            Chain order; angles in (-pi, pi] or any other turn; NaN without an answer, and after the last one.
        """

    def solve_branch(
        self, targets: np.ndarray, q_r: np.ndarray, branch: int
    ) -> np.ndarray:
        """Non-redundant joints of one branch, (K, A, m); see `solve`. Families to which this saves work override it."""
        return self.solve(targets, q_r)[:, branch]

    @abstractmethod
    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Smooth functions of the posture that are positive inside a branch and zero at its boundary.

        They must be analytic and accept complex postures: their derivatives are taken by complex steps.

        Parameters
        ----------
        q : (K, n) ndarray
            All joints; real or complex.
        branch : int
            Index into `branches`.

        Returns
        -------
        (K, k) ndarray
            Dimensionless, of the order of one in the middle of the branch.
        """


class NotApplicableError(Exception):
    """A family does not fit a decomposition; the message is the reason, shown to the user."""


Build = Callable[[ChainGeometry, TaskMap, tuple[int, ...]], IKSolver]


@dataclass(frozen=True)
class Family:
    """A family of closed forms.

    Attributes
    ----------
    name : str
    build : callable
        ``build(geometry, task_map, redundant)`` returns a solver for the redundant joints with these indices, or
        raises `NotApplicableError` with the reason.
    source : str
        Where the formulas come from.
    """

    name: str
    build: Build
    source: str


def ik_family(name: str, *, source: str) -> Callable[[Build], Family]:
    """Declare a function as a family (decorator).

    The result is handed to `brachis.ik.find`, or published by another package in the entry-point group ``brachis.ik``.
    """

    def declare(build: Build) -> Family:
        return Family(name, build, source)

    return declare


def margin_gradient(solver: IKSolver, q: np.ndarray, branch: int) -> np.ndarray:
    """Differentiate the branch margins with respect to all joints, exact by complex steps.

    Parameters
    ----------
    solver : IKSolver
    q : (K, n) ndarray
    branch : int

    Returns
    -------
    (K, k, n) ndarray
    """
    count, n = q.shape
    step = 1e-30
    stepped = np.repeat(q[None].astype(complex), n, axis=0)
    stepped[np.arange(n), :, np.arange(n)] += 1j * step
    margins = solver.branch_margins(stepped.reshape(n * count, n), branch)
    return np.moveaxis(margins.imag.reshape(n, count, -1) / step, 0, 2)
