"""Splines whose first and last control points are fixed or tied by the boundary conditions.

For a clamped spline, zero velocity at an end means that the first two control points there are equal, and zero
acceleration besides that the first three are. Boundary conditions therefore need no rows in the NLP: the control
points are ``tie @ free + fixed`` with fewer free variables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse


@dataclass(frozen=True)
class TiedSpline:
    """A scalar spline over normalised time with boundary conditions built in.

    Attributes
    ----------
    knots : (N + 2 d + 1,) ndarray
    degree : int
        d.
    tie : (N + d, free) csr_array
    fixed : (N + d,) ndarray
        Control points are ``tie @ free + fixed``.
    """

    knots: np.ndarray
    degree: int
    tie: sparse.csr_array
    fixed: np.ndarray

    @classmethod
    def resting(
        cls, knots: np.ndarray, degree: int, *, derivatives: int, start: float | None, end: float | None
    ) -> TiedSpline:
        """Build a spline at rest at both ends.

        Parameters
        ----------
        knots, degree
            See the attributes.
        derivatives : int
            How many derivatives vanish at each end: 1 for velocity, 2 for acceleration too.
        start, end : float or None
            Value at the end in question, None where free.
        """
        count = len(knots) - degree - 1
        still = derivatives + 1
        fixed = np.zeros(count)
        column = np.concatenate([np.zeros(still), np.arange(1, count - 2 * still + 1), np.full(still, count - 2 * still + 1)])
        kept = np.ones(count, dtype=bool)
        for value, ends in ((start, slice(None, still)), (end, slice(count - still, None))):
            if value is not None:
                fixed[ends] = value
                kept[ends] = False
        rows = np.flatnonzero(kept)
        _, columns = np.unique(column[kept], return_inverse=True)
        free = int(columns.max()) + 1
        tie = sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(count, free))
        return cls(knots, degree, tie, fixed)

    @property
    def free(self) -> int:
        """Number of free variables."""
        return int(self.tie.shape[1])

    @property
    def greville(self) -> np.ndarray:
        """Greville abscissae (N + d,): the normalised times to which the control points belong."""
        d = self.degree
        return np.array([self.knots[i + 1 : i + d + 1].mean() for i in range(len(self.fixed))])

    def control_points(self, free: np.ndarray) -> np.ndarray:
        """Control points (N + d,) from the free variables."""
        return np.asarray(self.tie @ free + self.fixed)

    def free_from(self, control_points: np.ndarray) -> np.ndarray:
        """Free variables that come nearest to given control points (mean over tied ones)."""
        counts = self.tie.sum(axis=0)
        return np.asarray(self.tie.T @ (control_points - self.fixed)) / counts


@dataclass(frozen=True)
class SampledSpline:
    """A `TiedSpline` seen at K times: value and two derivatives, linear in its free variables.

    Attributes
    ----------
    matrices : tuple of three (K, free) csr_array
    offsets : (3, K) ndarray
        The derivative of order i is ``matrices[i] @ free + offsets[i]``, per unit of normalised time.
    point, column : (z,) int ndarray
        Common sparsity pattern: time index and free variable.
    entries : (3, z) ndarray
        The matrices' entries on that pattern.
    """

    matrices: tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array]
    offsets: np.ndarray
    point: np.ndarray
    column: np.ndarray
    entries: np.ndarray

    @classmethod
    def of(cls, spline: TiedSpline, bases: Sequence[sparse.csr_array]) -> SampledSpline:
        """Sample a spline through the basis matrices (K, N + d) of its value and two derivatives."""
        matrices = [sparse.csr_array(basis @ spline.tie) for basis in bases]
        pattern = sparse.coo_array(abs(matrices[0]) + abs(matrices[1]) + abs(matrices[2]))
        point, column = pattern.coords
        entries = np.array([matrix[point, column] for matrix in matrices])
        offsets = np.array([basis @ spline.fixed for basis in bases])
        return cls((matrices[0], matrices[1], matrices[2]), offsets, point, column, entries)

    def values(self, free: np.ndarray) -> np.ndarray:
        """Value and two derivatives, (3, K)."""
        return np.array([matrix @ free for matrix in self.matrices]) + self.offsets
