"""The Hessian of the Lagrangian of a problem that knows a part of it.

A mean of squares over the motion is curved in as many directions as there are variables; an approximation from the last
few steps learns too few of them. First derivatives give its Gauss-Newton part K. The rest A follows from successive
iterates (J. E. Dennis, D. M. Gay, R. E. Welsch, An adaptive nonlinear least-squares algorithm, ACM Transactions on
Mathematical Software 7, 1981): if the gradient of the Lagrangian changes by y in a step s, A is scaled down to what
that step shows, and updated so that

    A s = y - K s.

Negative eigenvalues of K + A change their sign: subproblems are convex, and steps along such directions short.
"""

from __future__ import annotations

import numpy as np

from brachis.optimise.backends.protocol import Curvature, Problem

_LITTLE = 0.01
"""Part of the first guess of K, by its trace, below which K is too little."""
_SMALL = 1e-8
"""Cosine between s and y below which a step does not change A."""


class SecantHessian:
    """The Hessian of one problem's Lagrangian, updated from call to call.

    Parameters
    ----------
    problem : Problem
    known : Curvature
    """

    def __init__(self, problem: Problem, known: Curvature) -> None:
        self._problem = problem
        self._known = known
        self._multipliers = known.multipliers
        self._least: float | None = None
        count = len(problem.x_lower)
        self._rest = np.zeros((count, count))
        self._last: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    def __call__(
        self, x: np.ndarray, objective_multiplier: float, multipliers: np.ndarray
    ) -> np.ndarray:
        """Return the Hessian at an iterate.

        Parameters
        ----------
        x : (v,) ndarray
        objective_multiplier : float
            0 in a restoration.
        multipliers : (c,) ndarray
            L = objective_multiplier objective - multipliers . rows.

        Returns
        -------
        (v, v) ndarray
            Symmetric, without negative eigenvalues.
        """
        known = self._known.hessian(x, multipliers)
        if self._least is None:
            self._least = _LITTLE * np.trace(self._known.hessian(x, self._multipliers))
        if np.trace(known) < self._least:
            # Steps without curvature would lead far away: the last multipliers that gave some do for now.
            multipliers = self._multipliers
            known = self._known.hessian(x, multipliers)
        if objective_multiplier > 0.0:
            self._multipliers = multipliers
            here = (x, self._problem.gradient(x), self._problem.jacobian(x))
            if self._last is not None:
                factors = objective_multiplier, multipliers
                change = self._slopes(*here[1:], *factors)
                change = change - self._slopes(*self._last[1:], *factors)
                self._update(x - self._last[0], change, known)
            self._last = here
        values, vectors = np.linalg.eigh(known + self._rest)
        return np.asarray((vectors * np.abs(values)) @ vectors.T)

    def _slopes(
        self,
        gradient: np.ndarray,
        jacobian: np.ndarray,
        objective_multiplier: float,
        multipliers: np.ndarray,
    ) -> np.ndarray:
        """Gradient of the Lagrangian, (v,)."""
        problem = self._problem
        terms = jacobian * multipliers[problem.jacobian_rows]
        of_rows = np.bincount(problem.jacobian_columns, terms, len(gradient))
        return np.asarray(objective_multiplier * gradient - of_rows)

    def _update(self, s: np.ndarray, y: np.ndarray, known: np.ndarray) -> None:
        """Update A after a step."""
        curved = s @ y
        if not curved > _SMALL * np.linalg.norm(s) * np.linalg.norm(y):
            return
        left = y - known @ s
        before = abs(s @ self._rest @ s)
        if before > 0.0:
            self._rest = self._rest * min(1.0, abs(s @ left) / before)
        miss = left - self._rest @ s
        both = np.outer(miss, y) / curved
        total = (miss @ s) * np.outer(y, y) / curved**2
        self._rest = self._rest + both + both.T - total
