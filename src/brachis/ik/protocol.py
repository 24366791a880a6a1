"""The protocol of solvers for closed-form inverse kinematics, and the declaration of families of solvers."""

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
        Labels of the B branches, all different. A label names a geometric choice (the elbow on one side or the other).
        A continuous joint curve keeps its label until a branch margin reaches zero.
    alternatives : int
        Maximum number of solutions in a branch, A. No geometric choice distinguishes these solutions; along a curve,
        they are distinguished only by continuity. Default: 1.
    """

    branches: tuple[str, ...]
    alternatives: int = 1

    @abstractmethod
    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Solve for the non-redundant joints in every branch.

        Parameters
        ----------
        targets : (K, c) ndarray
            Task coordinates; see `TaskMap` (for poses c = 12: position, then the rotation matrix row by row).
        q_r : (K, r) ndarray
            Positions of the redundant joints, in chain order.

        Returns
        -------
        (K, B, A, m) ndarray
            Non-redundant joints, in chain order. Angles may include any number of whole turns. Entries without a
            solution are NaN; in each branch, they come last.
        """

    def solve_branch(
        self, targets: np.ndarray, q_r: np.ndarray, branch: int
    ) -> np.ndarray:
        """Solve for one branch, (K, A, m); see `solve`. Override this method if it saves work."""
        return self.solve(targets, q_r)[:, branch]

    @abstractmethod
    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Return smooth functions of the posture that are positive inside a branch and zero at its boundary.

        The functions must be analytic and accept complex postures, because their derivatives are computed by complex
        steps.

        Parameters
        ----------
        q : (K, n) ndarray
            Positions of all joints; real or complex.
        branch : int
            Index of the branch in `branches`.

        Returns
        -------
        (K, k) ndarray
            Dimensionless margins, of the order of one in the middle of the branch.
        """

    def branch_formula(self, branch: int, *counts: int) -> Formula | None:
        """Return the formula of `solve_branch`, for given numbers of task coordinates and redundant joints.

        The result is None except in a `FormulaSolver`; if it is None, the planner calls `solve_branch`.
        """
        return None

    def margin_formulas(self, branch: int, n: int) -> FormulaQuantity | None:
        """Return the formulas of the margins and their slopes in postures of n joints.

        The result is None except in `FormulaMargins`; if it is None, the planner calls `branch_margins` and
        `margin_gradient`.
        """
        return None

    def margin_gradient(self, q: np.ndarray, branch: int) -> np.ndarray:
        """Differentiate the branch margins with respect to all joints, (K, k, n), exactly, by complex steps."""
        count, n = q.shape
        step = 1e-30
        stepped = np.repeat(q[None].astype(complex), n, axis=0)
        stepped[np.arange(n), :, np.arange(n)] += 1j * step
        margins = self.branch_margins(stepped.reshape(n * count, n), branch)
        return np.moveaxis(margins.imag.reshape(n, count, -1) / step, 0, 2)


class FormulaMargins(IKSolver):
    """Closed form whose margins are formulas that the compiled library evaluates.

    The formulas are written with NumPy and are recorded when they are first needed. See `brachis.kernel.formula` for
    the allowed operations.
    """

    @abstractmethod
    def margins(self, q: np.ndarray) -> np.ndarray:
        """Compute the branch margins, (K, k), before the multiplication by `margin_signs`."""

    @abstractmethod
    def margin_signs(self, branch: int) -> np.ndarray:
        """Return the signs of the margins in a branch, (k,)."""

    @cached_property
    def _formulas(self) -> dict[object, Formula]:
        return {}

    def _formula(
        self, key: object, make: Callable[..., Formula], *arguments: Any
    ) -> Formula:
        """Return the formula of a key, which is recorded if necessary."""
        if key not in self._formulas:
            self._formulas[key] = make(*arguments)
        return self._formulas[key]

    def _values(self, n: int) -> Formula:
        return self._formula(("margins", n), Formula.of, self.margins, n)

    def _slopes(self, n: int) -> Formula:
        return self._formula(("slopes", n), Formula.gradient, self.margins, n)

    def margin_formulas(self, branch: int, n: int) -> FormulaQuantity | None:
        """Return margins and slopes with the signs of a branch; None if a subclass computes either of them itself."""
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
        """Evaluate the slopes of the margins by their formula."""
        return self._slopes(q.shape[1])(q) * self.margin_signs(branch)[:, None]


class FormulaSolver(FormulaMargins):
    """Closed form whose solutions, like its margins, are formulas."""

    @abstractmethod
    def answers(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Compute the joints as in `solve`, (K, B, A, m); if there is no solution, at least one joint is not finite."""

    def _of_all(self, *counts: int) -> Formula:
        make = partial(Formula.of, discards_incomplete=True)
        return self._formula(counts, make, self.answers, *counts)

    def _of_branch(self, branch: int, *counts: int) -> Formula:
        key = ("branch", branch, *counts)
        return self._formula(key, self._of_all(*counts).select, branch)

    def branch_formula(self, branch: int, *counts: int) -> Formula | None:
        """Return the formula of the solutions in one branch; None if a subclass overrides `solve_branch`."""
        if type(self).solve_branch is not FormulaSolver.solve_branch:
            return None
        return self._of_branch(branch, *counts)

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Evaluate the solutions of all branches."""
        return self._of_all(targets.shape[1], q_r.shape[1])(targets, q_r)

    def solve_branch(
        self, targets: np.ndarray, q_r: np.ndarray, branch: int
    ) -> np.ndarray:
        """Evaluate the solutions of one branch."""
        counts = targets.shape[1], q_r.shape[1]
        return self._of_branch(branch, *counts)(targets, q_r)


class NotApplicableError(Exception):
    """A family does not fit a decomposition. The message is the reason, which is shown to the user."""


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
        Publication or module that gives the formulas.
    """

    name: str
    build: Build
    source: str


def ik_family(name: str, *, source: str) -> Callable[[Build], Family]:
    """Declare a function as a family (decorator).

    Pass the result to `brachis.ik.find`, or publish it from another package in the entry-point group ``brachis.ik``.
    """
    return partial(Family, name, source=source)
