"""The Hessian of a program's Lagrangian, of which a part is known.

A mean of squares over the motion is curved in as many directions as there are variables. An approximation from the last
few steps captures too few of these directions. First derivatives give the Gauss-Newton part B, and a matrix A
approximates the rest of the Hessian. Let the gradient of the Lagrangian change by y in a step s, and let B belong to
the new point. A is first scaled by min(1, |s.(y - B s)| / |s.A s|). A symmetric update of rank two then changes A so
that

    A s = y - B s.

Scaling and update are those of J. E. Dennis, D. M. Gay and R. E. Welsch, An adaptive nonlinear least-squares algorithm,
ACM Transactions on Mathematical Software 7, 1981. They require a different A s, because their problems have residuals
only. Here, other rows are curved as well.

Negative eigenvalues of A + B are replaced by positive ones, so that subproblems are convex and steps along the
corresponding directions are short.
"""

from __future__ import annotations

import numpy as np

from brachis.optimise.backends.protocol import Curvature, NonlinearProgram

_ENOUGH = 0.01
"""Trace of B, relative to the one with the guessed multipliers, above which the solver's multipliers are used."""
_LEAST_COSINE = 1e-8
"""Cosine between s and y below which A is not updated, because the update divides by s.y."""


class SecantHessian:
    """The Hessian of one program's Lagrangian, updated from call to call.

    Parameters
    ----------
    program : NonlinearProgram
    known : Curvature
    learnt : (v, v) ndarray, optional
        Initial matrix A; zero by default.

    Attributes
    ----------
    learnt : (v, v) ndarray
        The matrix A, as updated so far.
    """

    def __init__(
        self,
        program: NonlinearProgram,
        known: Curvature,
        learnt: np.ndarray | None = None,
    ) -> None:
        self._program = program
        self._known = known
        self._multipliers = known.multipliers
        self._least_trace: float | None = None
        count = len(program.x_lower)
        self.learnt = np.zeros((count, count)) if learnt is None else learnt
        self._last: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    @classmethod
    def of(
        cls, program: NonlinearProgram, x: np.ndarray, learnt: np.ndarray | None
    ) -> SecantHessian | None:
        """Create the Hessian for a solve from x, (v,); return None if no part of the program's Hessian is known."""
        known = program.curvature(x)
        return None if known is None else cls(program, known, learnt)

    def __call__(
        self, x: np.ndarray, objective_multiplier: float, multipliers: np.ndarray
    ) -> np.ndarray:
        """Return the Hessian at an iterate.

        Parameters
        ----------
        x : (v,) ndarray
        objective_multiplier : float
            Multiplier of the objective; 0 in a restoration.
        multipliers : (c,) ndarray
            Multipliers of the rows, with L = objective_multiplier objective - multipliers . rows.

        Returns
        -------
        (v, v) ndarray
            Symmetric matrix without negative eigenvalues.
        """
        known = self._known.hessian(x, objective_multiplier, multipliers)
        if self._least_trace is None:
            guess = self._known.hessian(x, 1.0, self._multipliers)
            self._least_trace = float(_ENOUGH * np.trace(guess))
        if np.trace(known) < self._least_trace:
            # Without curvature, steps would be too long: use the last multipliers that gave enough curvature.
            multipliers = self._multipliers
            factor = objective_multiplier or 1.0
            known = self._known.hessian(x, factor, multipliers)
            if objective_multiplier == 0.0:
                # In a restoration, more curvature would make steps short, but feasible points may be far away.
                known *= self._least_trace / np.trace(known)
        if objective_multiplier > 0.0:
            self._multipliers = multipliers
            self._learn(x, objective_multiplier, multipliers, known)
        values, vectors = np.linalg.eigh(known + self.learnt)
        return (vectors * np.abs(values)) @ vectors.T

    def _learn(
        self,
        x: np.ndarray,
        objective_multiplier: float,
        multipliers: np.ndarray,
        known: np.ndarray,
    ) -> None:
        """Update A after the step from the last iterate to x."""
        gradient = self._program.gradient(x)
        jacobian = self._program.jacobian(x)
        if self._last is not None:
            last_x, last_gradient, last_jacobian = self._last
            by_rows = self._sum_rows(jacobian - last_jacobian, multipliers)
            change = objective_multiplier * (gradient - last_gradient) - by_rows
            self._update(x - last_x, change, known)
        self._last = x, gradient, jacobian

    def _sum_rows(self, jacobian: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """Add up the rows of a Jacobian, (nnz,), weighted by multipliers; return (v,)."""
        terms = jacobian * multipliers[self._program.jacobian_rows]
        columns = self._program.jacobian_columns
        return np.bincount(columns, terms, len(self.learnt))

    def _update(self, s: np.ndarray, y: np.ndarray, known: np.ndarray) -> None:
        """Update A after a step s with a change y of the Lagrangian's gradient, (v,) each; see the module docstring."""
        s_y = s @ y
        if not s_y > _LEAST_COSINE * np.linalg.norm(s) * np.linalg.norm(y):
            return
        target = y - known @ s
        s_a_s = abs(s @ self.learnt @ s)
        if s_a_s > 0.0:
            self.learnt = self.learnt * min(1.0, abs(s @ target) / s_a_s)
        error = target - self.learnt @ s
        outer = np.outer(error, y) / s_y
        correction = (error @ s) * np.outer(y, y) / s_y**2
        self.learnt = self.learnt + outer + outer.T - correction
