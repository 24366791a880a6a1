"""Multipliers of a program at its solution, and how well they balance the gradient.

At an optimum the gradient of t_E is a combination of the slopes of the active rows and variable bounds,

    grad t_E = sum_i w_i p_i,    w_i >= 0,

where p_i is the gradient of a row or variable at its lower bound, or the negative gradient at its upper bound. The norm
of the remainder, divided by the norm of the gradient, measures how far a solution is from being stationary. The
multipliers are those of the solver if they balance the gradient; otherwise they are found by least squares.

If the slopes are linearly dependent, many sets of multipliers balance the gradient. The set that is valid for a
relaxation is the one that promises the least gain (Gauvin and Tolle, SIAM J. Control Optim. 15, 1977). A linear program
finds it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from brachis.optimise.program import Program

NEAR = (1e-8, 1e-7, 1e-6, 1e-5)
"""Distances from a bound, dimensionless, within which rows and variables count as active, in the order in which they
are tried. A row that is close to its bound but not active would count as a row that becomes active within any step."""
LOOSE = (1e-4, 1e-3)
"""The same for a solver that ended early. They serve if only other parts of a problem than the bounds change."""
_INDEPENDENT = 1e-9
"""Length below which a slope, or the part of it that is independent of earlier slopes, counts as a rounding error."""


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """Rows and variables at their bounds at a point x.

    Attributes
    ----------
    slopes : (p, v) ndarray
        Gradients of active rows, then of active variables; at upper bounds, the negative gradients.
    rows : (a,) int ndarray
        Numbers of the rows to which the first a slopes belong.
    signs : (a,) ndarray
        1 at a lower bound, -1 at an upper one.
    equalities : int
        Number of rows and variables that are at both of their bounds; each has two slopes.
    """

    slopes: np.ndarray
    rows: np.ndarray
    signs: np.ndarray
    equalities: int = 0

    @classmethod
    def at(cls, program: Program, x: np.ndarray, near: float) -> ActiveSet:
        """Collect rows and variables that are closer to their bounds than `near`, dimensionless, at x, (v,).

        Rows that no variable changes, such as those at a given start posture, are left out.

        Raises
        ------
        UnreachableError
            A collocation point is outside the branch.
        """
        from scipy import sparse

        values = program.rows(x)
        places = (program.jacobian_rows, program.jacobian_columns)
        shape = (len(values), len(x))
        entries = (program.jacobian(x), places)
        jacobian = sparse.coo_array(entries, shape=shape).tocsr()
        low = np.flatnonzero(values <= program.lower + near)
        high = np.flatnonzero(values >= program.upper - near)
        rows = np.concatenate([low, high])
        signs = np.repeat([1.0, -1.0], [len(low), len(high)])
        slopes = signs[:, None] * jacobian[rows].toarray()
        is_movable = np.abs(slopes).max(axis=1, initial=0.0) > _INDEPENDENT
        unit = np.eye(len(x))
        at_lower = x <= program.x_lower + near
        at_upper = x >= program.x_upper - near
        slopes = np.vstack([slopes[is_movable], unit[at_lower], -unit[at_upper]])
        rows = rows[is_movable]
        twice = len(rows) - len(np.unique(rows)) + int((at_lower & at_upper).sum())
        return cls(slopes, rows, signs[is_movable], twice)

    @cached_property
    def dependent(self) -> bool:
        """Whether several sets of multipliers may balance a gradient; for equalities they may have either sign."""
        # A slope that depends on earlier slopes leaves a zero on the diagonal.
        diagonal = np.diag(np.linalg.qr(self.slopes.T, mode="r"))
        remaining = np.count_nonzero(np.abs(diagonal) > _INDEPENDENT)
        return bool(remaining < len(self.slopes) - self.equalities)

    def weights_of(
        self, gradient: np.ndarray, multipliers: np.ndarray | None
    ) -> np.ndarray:
        """Return weights, (p,), from a solver's multipliers of all rows, (c,); weights of variables balance the rest.

        Without multipliers, these are the weights that balance the gradient best, from non-negative least squares
        (Lawson and Hanson).
        """
        if multipliers is not None:
            of_rows = np.maximum(self.signs * multipliers[self.rows], 0.0)
            unbalanced = gradient - of_rows @ self.slopes[: len(of_rows)]
            of_variables = np.maximum(self.slopes[len(of_rows) :] @ unbalanced, 0.0)
            return np.concatenate([of_rows, of_variables])
        from scipy.optimize import nnls

        if not len(self.slopes):
            return np.empty(0)
        try:
            return np.asarray(nnls(self.slopes.T, gradient)[0])
        except RuntimeError:  # too many iterations
            return np.zeros(len(self.slopes))


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Multipliers at a solution, and how well they balance the gradient.

    Attributes
    ----------
    active_set : ActiveSet
    weights : (p,) ndarray
        Multipliers of the active set, >= 0; for rows, whose values are dimensionless, in s.
    source : str
        ``"solver"`` or ``"least squares"``.
    residual : float
        Norm of the part of the gradient that the weights do not balance, divided by the norm of the gradient; 1 if
        nothing is balanced.
    """

    active_set: ActiveSet
    weights: np.ndarray
    source: str
    residual: float

    def change(self, relaxation: np.ndarray, side: float | None = None) -> float:
        """Return the directional derivative of t_E for a relaxation of bounds.

        The residual is the fraction of the gradient that the weights do not balance. Multipliers that contribute no
        more than this fraction to the balanced gradient cannot be distinguished from zero, and count as 0.

        Parameters
        ----------
        relaxation : (c,) ndarray
            Rate, >= 0, at which the bounds of each row move outwards, dimensionless.
        side : {1, -1}, optional
            If given, only lower (1) or only upper (-1) bounds move.

        Returns
        -------
        float
            The derivative, <= 0, s.
        """
        rates = np.zeros(len(self.weights))
        of_rows = relaxation[self.active_set.rows]
        if side is not None:
            of_rows = np.where(self.active_set.signs == side, of_rows, 0.0)
        rates[: len(of_rows)] = of_rows
        slopes = self.active_set.slopes
        balanced = np.linalg.norm(self.weights @ slopes)
        by_these = np.linalg.norm(np.where(rates > 0.0, self.weights, 0.0) @ slopes)
        if by_these <= self.residual * balanced:
            return 0.0
        saved = float(rates @ self.weights)
        if not self.active_set.dependent:
            return -saved
        from scipy.optimize import linprog
        from scipy.sparse import csc_array

        # Of all weights that balance the gradient equally well, use those that promise the least gain. The type stubs
        # do not cover sparse matrices.
        columns = csc_array(slopes.T)
        modest = linprog(rates, A_eq=columns, b_eq=self.weights @ slopes).x  # type: ignore[call-overload]
        return -float(rates @ (self.weights if modest is None else modest))


def multipliers_of(
    program: Program,
    x: np.ndarray,
    of_solver: np.ndarray | None = None,
    distances: Sequence[float] = NEAR,
) -> Multipliers:
    """Find the multipliers at a solution.

    Parameters
    ----------
    program : Program
    x : (v,) ndarray
    of_solver : (c,) ndarray, optional
        The solver's multipliers of the rows; the Lagrangian is L = t_E - of_solver . rows.
    distances : sequence of float, optional
        See `NEAR`.

    Returns
    -------
    Multipliers

    Raises
    ------
    UnreachableError
        A collocation point is outside the branch.
    """
    gradient = program.gradient(x)
    sources = {"solver": of_solver, "least squares": None}
    if of_solver is None:
        del sources["solver"]
    tried = []
    for near in distances:
        active_set = ActiveSet.at(program, x, near)
        for source, of_rows in sources.items():
            weights = active_set.weights_of(gradient, of_rows)
            unbalanced = np.linalg.norm(gradient - weights @ active_set.slopes)
            residual = float(unbalanced / np.linalg.norm(gradient))
            multipliers = Multipliers(active_set, weights, source, residual)
            if residual <= 1e-5:
                return multipliers
            tried.append(multipliers)
    return min(tried, key=lambda multipliers: multipliers.residual)
