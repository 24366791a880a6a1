"""What a closed-form inverse kinematics solver is, and how a family of them is declared."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from brachis.ik.screws import ChainGeometry
from brachis.kernel import Formula, FormulaQuantity
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

    def branch_formula(self, branch: int, *counts: int) -> Formula | None:
        """Return the formula of `solve_branch`, of so many task coordinates and redundant joints.

        None but in `FormulaSolver`: the planner then asks `solve_branch`.
        """
        return None

    def margin_formulas(self, branch: int, n: int) -> FormulaQuantity | None:
        """Return the formulas of margins and slopes in postures of n joints.

        None but in `FormulaMargins`: the planner then asks `branch_margins` and `margin_gradient`.
        """
        return None

    def margin_gradient(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Differentiate the branch margins with respect to all joints, (K, k, n), exact by complex steps."""
        count, n = q.shape
        step = 1e-30
        stepped = np.repeat(q[None].astype(complex), n, axis=0)
        stepped[np.arange(n), :, np.arange(n)] += 1j * step
        margins = self.branch_margins(stepped.reshape(n * count, n), branch)
        return np.moveaxis(margins.imag.reshape(n, count, -1) / step, 0, 2)


class FormulaMargins(IKSolver):
    """Closed form whose margins are formulas, which the compiled library evaluates.

    They are written with NumPy, and recorded when they are first needed: see `brachis.kernel.formula` for what they may
    do.
    """

    @abstractmethod
    def margins(self, q: np.ndarray) -> np.ndarray:
        """Branch margins, (K, k), before they are multiplied by `margin_signs`."""

    @abstractmethod
    def margin_signs(self, branch: int) -> np.ndarray:
        """Signs of the margins in a branch, (k,)."""

    @cached_property
    def _formulas(self) -> dict[object, Formula]:
        return {}

    def _formula(
        self, key: object, make: Callable[..., Formula], *arguments: Any
    ) -> Formula:
        """Return the formula of a key; it is made if it has not been."""
        if key not in self._formulas:
            self._formulas[key] = make(*arguments)
        return self._formulas[key]

    def _values(self, n: int) -> Formula:
        return self._formula(("margins", n), Formula.of, self.margins, n)

    def _slopes(self, n: int) -> Formula:
        return self._formula(("slopes", n), Formula.gradient, self.margins, n)

    def margin_formulas(self, branch: int, n: int) -> FormulaQuantity | None:
        """Return margins and slopes with the branch's signs; None where a subclass computes one of them itself."""
        solver_type = type(self)
        if solver_type.branch_margins is not FormulaMargins.branch_margins:
            return None
        if solver_type.margin_gradient is not FormulaMargins.margin_gradient:
            return None
        values = self._values(n)
        signs = np.broadcast_to(self.margin_signs(branch), values.shape)
        return FormulaQuantity(values, self._slopes(n), signs)

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Evaluate the margins by their formula."""
        return self._values(q.shape[1])(q) * self.margin_signs(branch)

    def margin_gradient(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Evaluate the slopes of the margins."""
        return self._slopes(q.shape[1])(q) * self.margin_signs(branch)[:, None]


class FormulaSolver(FormulaMargins):
    """Closed form whose answers are formulas too."""

    @abstractmethod
    def answers(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Non-redundant joints, (K, B, A, m), as of `solve`; one of them is not finite where there is no answer."""

    def _of_all(self, *counts: int) -> Formula:
        make = partial(Formula.of, discards_incomplete=True)
        return self._formula(counts, make, self.answers, *counts)

    def _of_branch(self, branch: int, *counts: int) -> Formula:
        key = ("branch", branch, *counts)
        return self._formula(key, self._of_all(*counts).select, branch)

    def branch_formula(self, branch: int, *counts: int) -> Formula | None:
        """Return the part of a branch of the answers; None where a subclass has a `solve_branch` of its own."""
        if type(self).solve_branch is not FormulaSolver.solve_branch:
            return None
        return self._of_branch(branch, *counts)

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Evaluate the answers of all branches."""
        return self._of_all(targets.shape[1], q_r.shape[1])(targets, q_r)

    def solve_branch(
        self, targets: np.ndarray, q_r: np.ndarray, branch: int
    ) -> np.ndarray:
        """Evaluate the answers of one branch."""
        counts = targets.shape[1], q_r.shape[1]
        return self._of_branch(branch, *counts)(targets, q_r)


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
    return partial(Family, name, source=source)
