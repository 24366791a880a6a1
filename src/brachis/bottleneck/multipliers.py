"""Multipliers of a solved program: the solver's where they balance the gradient, otherwise least squares.

At an optimum the gradient of t_E is a combination of the slopes of the active rows and variable bounds,

    grad t_E = sum_i w_i p_i,    w_i >= 0,

with p_i the gradient of a row or variable at its lower bound, or minus that at its upper bound. The norm of what is
left over, relative to the gradient's, tells how far an answer is from being stationary.

If the bounds of the active rows give way at rates d_i >= 0, then dt_E = -sum_i w_i d_i. Where the slopes are linearly
dependent, many sets of multipliers balance the gradient, and the one that holds for a relaxation is the one that
promises the least (Gauvin and Tolle, SIAM J. Control Optim. 15, 1977): a linear program.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.bottleneck.linearised import rows_and_jacobian
from brachis.nlp import Program
from brachis.refine import Refined
from brachis.summary import Summary

ACTIVE = (1e-8, 1e-7, 1e-6, 1e-5)
"""Distances from a bound within which rows and variables press on it; dimensionless. The least that gives a balance
counts: solvers differ in how near they come, and a row that is near its bound without being active would count as one
that takes over within any step."""
_GOOD = 1e-5
"""The solver's multipliers with a smaller residual are taken as they are."""
_DEPENDENT = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class ActiveSet(Summary):
    """What presses on a point x.

    Attributes
    ----------
    slopes : (p, v) ndarray
        Gradients of active rows, then of active variables; negative ones at upper bounds.
    rows : (a,) int ndarray
        Rows to which the first a slopes belong.
    signs : (a,) ndarray
        1 at a lower bound, -1 at an upper one.
    """

    slopes: np.ndarray
    rows: np.ndarray
    signs: np.ndarray

    @classmethod
    def at(cls, program: Program, x: np.ndarray, near: float) -> ActiveSet:
        """Collect what presses on x, (v,): what is nearer to its bound than `near`, dimensionless.

        Raises
        ------
        UnreachableError
            A collocation point is out of the branch's reach.
        """
        values, jacobian = rows_and_jacobian(program, x)
        low = np.flatnonzero(values <= program.lower + near)
        high = np.flatnonzero(values >= program.upper - near)
        rows, signs = np.concatenate([low, high]), np.repeat([1.0, -1.0], [len(low), len(high)])
        slopes = signs[:, None] * jacobian[rows].toarray()
        pressing = slopes.any(axis=1)  # what holds at the given start posture holds whatever x
        unit = np.eye(len(x))
        bounds = unit[x <= program.x_lower + near], -unit[x >= program.x_upper - near]
        return cls(np.vstack([slopes[pressing], *bounds]), rows[pressing], signs[pressing])

    @property
    def dependent(self) -> bool:
        """True where several sets of multipliers may balance a gradient."""
        return bool(np.linalg.matrix_rank(self.slopes, tol=_DEPENDENT) < len(self.slopes))

    def stationarity_residual(self, gradient: np.ndarray, weights: np.ndarray) -> float:
        """Norm of the part of a gradient, (v,), that weights, (p,), do not balance; relative to the gradient's."""
        return float(np.linalg.norm(gradient - weights @ self.slopes) / np.linalg.norm(gradient))

    def weights_of(self, gradient: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """Weights, (p,), from a solver's multipliers of all rows, (c,); those of variables balance what they can."""
        of_rows = np.maximum(self.signs * multipliers[self.rows], 0.0)
        rest = gradient - of_rows @ self.slopes[: len(of_rows)]
        return np.concatenate([of_rows, np.maximum(self.slopes[len(of_rows) :] @ rest, 0.0)])

    def fitted_weights(self, gradient: np.ndarray) -> np.ndarray:
        """Weights, (p,), that balance a gradient best: non-negative least squares (Lawson and Hanson)."""
        from scipy.optimize import nnls  # noqa: PLC0415

        return np.asarray(nnls(self.slopes.T, gradient)[0]) if len(self.slopes) else np.empty(0)


@dataclass(frozen=True, eq=False, repr=False)
class Multipliers(Summary):
    """Multipliers at an answer, and how well they balance the gradient.

    Attributes
    ----------
    active_set : ActiveSet
    weights : (p,) ndarray
        Multipliers of the active_set, >= 0; s for a row, whose values are dimensionless.
    source : str
        ``"solver"`` or ``"least squares"``.
    residual : float
        See `ActiveSet.stationarity_residual`; 1 where nothing balances.
    unique : bool
        False where other multipliers balance the gradient as well.
    """

    active_set: ActiveSet
    weights: np.ndarray
    source: str
    residual: float
    unique: bool

    def change(self, relaxation: np.ndarray, side: float | None = None) -> float:
        """Directional derivative of t_E as bounds give way.

        Parameters
        ----------
        relaxation : (c,) ndarray
            Rates >= 0 at which the bounds of every row move outwards, dimensionless.
        side : {1, -1}, optional
            Only lower, or only upper bounds move.

        Returns
        -------
        float
            <= 0, s.
        """
        rates = relaxation[self.active_set.rows]
        if side is not None:
            rates = np.where(self.active_set.signs == side, rates, 0.0)
        active = self.weights[: len(rates)]
        if self.unique or not (rates @ active):
            return -float(rates @ active)
        return -self._least(np.concatenate([rates, np.zeros(len(self.weights) - len(rates))]))

    def _least(self, rates: np.ndarray) -> float:
        """Least of ``rates @ w`` over all weights that balance as much as `weights` do."""
        from scipy.optimize import linprog  # noqa: PLC0415

        slopes = self.active_set.slopes
        found = linprog(rates, A_eq=slopes.T, b_eq=self.weights @ slopes, bounds=(0.0, None), method="highs")
        best = self.weights if found.x is None else found.x
        return float(rates @ best)


def multipliers_of(program: Program, x: np.ndarray, given: np.ndarray | None = None) -> Multipliers:
    """Find the multipliers at an answer.

    Parameters
    ----------
    program : Program
    x : (v,) ndarray
    given : (c,) ndarray, optional
        The solver's own multipliers of the rows; L = t_E - given . rows.

    Returns
    -------
    Multipliers

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    tried: list[Multipliers] = []
    for near in ACTIVE:
        tried.append(_balancing(ActiveSet.at(program, x, near), program.gradient(x), given))
        if tried[-1].residual <= _GOOD:
            break
    return min(tried, key=lambda multipliers: multipliers.residual)


def _balancing(active_set: ActiveSet, gradient: np.ndarray, given: np.ndarray | None) -> Multipliers:
    """Choose the weights of active_set that balance a gradient, (v,), best."""
    candidates = [] if given is None else [("solver", active_set.weights_of(gradient, given))]
    if not candidates or active_set.stationarity_residual(gradient, candidates[0][1]) > _GOOD:
        candidates.append(("least squares", active_set.fitted_weights(gradient)))
    source, weights = min(candidates, key=lambda candidate: active_set.stationarity_residual(gradient, candidate[1]))
    residual = active_set.stationarity_residual(gradient, weights)
    return Multipliers(active_set, weights, source, residual, unique=not active_set.dependent)


def multipliers_of_answer(refined: Refined) -> Multipliers:
    """Find the multipliers of a refined answer, before its end time was lengthened."""
    report = refined.reports[-1]
    return multipliers_of(refined.program, report.x, report.multipliers)
