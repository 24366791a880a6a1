"""The rows and variables of a problem that are at their bounds, and the multipliers that balance the gradient there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from brachis.optimise.backends.protocol import Problem

if TYPE_CHECKING:
    from scipy import sparse


def jacobian_matrix(problem: Problem, entries: np.ndarray) -> sparse.csr_array:
    """Return the Jacobian of a problem's rows as a matrix, (c, v), from the entries on its pattern, (nnz,)."""
    from scipy import sparse

    places = (problem.jacobian_rows, problem.jacobian_columns)
    shape = (len(problem.lower), len(problem.x_lower))
    return sparse.coo_array((entries, places), shape=shape).tocsr()


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """Rows and variables at their bounds at a point x.

    Attributes
    ----------
    slopes : (p, v) ndarray
        Gradients of active rows, then of active variables; negative ones at upper bounds.
    rows : (a,) int ndarray
        Rows to which the first a slopes belong.
    signs : (a,) ndarray
        1 at a lower bound, -1 at an upper one.
    equalities : int
        Number of rows and variables that are at both bounds, each with two slopes.
    """

    slopes: np.ndarray
    rows: np.ndarray
    signs: np.ndarray
    equalities: int = 0

    @classmethod
    def at(cls, program: Problem, x: np.ndarray, near: float) -> ActiveSet:
        """Collect rows and variables that are nearer to their bounds than `near`, dimensionless, at x, (v,).

        Rows that no variable changes, such as those at a given start posture, are left out.

        Raises
        ------
        UnreachableError
            A collocation point is out of the branch's reach.
        """
        values = program.rows(x)
        jacobian = jacobian_matrix(program, program.jacobian(x))
        low = np.flatnonzero(values <= program.lower + near)
        high = np.flatnonzero(values >= program.upper - near)
        rows = np.concatenate([low, high])
        signs = np.repeat([1.0, -1.0], [len(low), len(high)])
        slopes = signs[:, None] * jacobian[rows].toarray()
        kept = slopes.any(axis=1)
        unit = np.eye(len(x))
        at_lower = x <= program.x_lower + near
        at_upper = x >= program.x_upper - near
        slopes = np.vstack([slopes[kept], unit[at_lower], -unit[at_upper]])
        rows = rows[kept]
        twice = len(rows) - len(np.unique(rows)) + int((at_lower & at_upper).sum())
        return cls(slopes, rows, signs[kept], twice)

    @cached_property
    def dependent(self) -> bool:
        """Whether several sets of multipliers may balance a gradient; those of equalities have either sign."""
        count = len(self.slopes) - self.equalities
        return bool(np.linalg.matrix_rank(self.slopes, tol=1e-9) < count)

    def weights_of(
        self, gradient: np.ndarray, multipliers: np.ndarray | None
    ) -> np.ndarray:
        """Weights, (p,), from a solver's multipliers of all rows, (c,); those of variables balance what they can.

        Without multipliers, the weights that balance the gradient best: non-negative least squares (Lawson and Hanson).
        """
        if multipliers is not None:
            of_rows = np.maximum(self.signs * multipliers[self.rows], 0.0)
            rest = gradient - of_rows @ self.slopes[: len(of_rows)]
            of_variables = np.maximum(self.slopes[len(of_rows) :] @ rest, 0.0)
            return np.concatenate([of_rows, of_variables])
        from scipy.optimize import nnls

        if not len(self.slopes):
            return np.empty(0)
        return np.asarray(nnls(self.slopes.T, gradient)[0])
