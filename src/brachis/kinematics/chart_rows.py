"""The linear functions of the joints that measure self-motion in a chart: sigma = C(s) q - p(s)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ORDERS = 4
"""Value and three derivatives by s."""
DEGREE = 5


@dataclass(frozen=True, eq=False)
class ChartRows:
    """Rows C (r, n) and offsets p (r,), constant or B-splines of s.

    Attributes
    ----------
    coefficients : (B, r, n + 1) ndarray
        Of [C, p]: one where they are constant, else the control points of splines of degree 5.
    knots : (B + 6,) ndarray or None
        None where they are constant.
    """

    coefficients: np.ndarray
    knots: np.ndarray | None = None

    @classmethod
    def constant(cls, rows: np.ndarray) -> ChartRows:
        """Take the same rows, (r, n), along the whole path, and p = 0."""
        return cls(np.concatenate([rows, np.zeros((len(rows), 1))], axis=1)[None])

    @classmethod
    def along(cls, s: np.ndarray, rows: np.ndarray, reference: np.ndarray) -> ChartRows:
        """Lead splines through rows, (S, r, n), and C q_ref = p, with reference postures (S, n), at S places."""
        from scipy.interpolate import make_interp_spline  # noqa: PLC0415  (imports in 0.3 s)

        offset = np.einsum("sij,sj->si", rows, reference)
        spline = make_interp_spline(s, np.concatenate([rows, offset[:, :, None]], axis=2), k=DEGREE)
        return cls(np.asarray(spline.c), np.asarray(spline.t))

    @classmethod
    def of_arrays(cls, coefficients: np.ndarray, knots: np.ndarray) -> ChartRows:
        """Read what `arrays` gave."""
        return cls(coefficients, knots if len(knots) else None)

    @property
    def r(self) -> int:
        """Number of rows."""
        return int(self.coefficients.shape[1])

    @property
    def closes(self) -> bool:
        """Whether postures that are the same at both ends of the path have the same sigma there."""
        return self.knots is None

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Coefficients and knots as they are saved: no knots where the rows are constant."""
        return self.coefficients, np.empty(0) if self.knots is None else self.knots

    @property
    def selected(self) -> tuple[int, ...]:
        """The joints that the rows select, ascending; none where they are other rows than unit rows."""
        rows = self.coefficients[0, :, :-1]
        unit = self.knots is None and bool(np.all((rows == 0.0) | (rows == 1.0)) and np.all(rows.sum(axis=1) == 1.0))
        return tuple(int(joint) for joint in np.argmax(rows, axis=1)) if unit else ()

    def _orders(self, s: np.ndarray, orders: int) -> np.ndarray:
        """[C, p] and its derivatives, (orders, K, r, n + 1)."""
        if self.knots is None:
            values = np.zeros((orders, len(s), *self.coefficients.shape[1:]))
            values[0] = self.coefficients[0]
            return values
        from scipy.interpolate import BSpline  # noqa: PLC0415

        spline = BSpline(self.knots, self.coefficients, DEGREE)
        return np.array([spline(s, nu=order) for order in range(orders)])

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """C, (K, r, n), and p, (K, r), at path coordinates (K,)."""
        (values,) = self._orders(s, 1)
        return values[:, :, :-1], values[:, :, -1]

    def values(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Sigma, (K, r), in postures (K, n) at path coordinates (K,)."""
        rows, offset = self.at(s)
        return np.einsum("kij,kj->ki", rows, q) - offset

    def orders(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """C and three derivatives by s, (4, K, r, n), and the derivatives of C q - p by s alone, (3, K, r)."""
        values = self._orders(s, ORDERS)
        rows = values[..., :-1]
        return rows, np.einsum("okij,kj->oki", rows[1:], q) - values[1:, ..., -1]
