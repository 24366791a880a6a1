"""Septic polynomials between given derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial, perm
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from brachis.path.protocol import Array

_DEGREE = 7


@dataclass(frozen=True, eq=False)
class SepticCurve:
    """A polynomial of degree 7 over sigma in [0, length].

    Attributes
    ----------
    coefficients : ndarray, shape (8, m)
        Coefficients of the powers of sigma / length.
    length : float
        Range of sigma.
    """

    coefficients: Array
    length: float

    @property
    def knots(self) -> Array:
        """Start and end: the polynomial is analytic."""
        return np.array([0.0, self.length])

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the polynomial and its derivatives by sigma, shape (order + 1, K, m)."""
        u = sigma / self.length
        return np.stack([_powers(u, k) @ self.coefficients / self.length**k for k in range(order + 1)])


def septic(start: Array, end: Array, length: float) -> SepticCurve:
    """Return the septic polynomial with given values and three derivatives at both ends.

    Parameters
    ----------
    start, end : ndarray, shape (4, m)
        Value, first, second and third derivative by sigma.
    length : float
        Range of sigma.
    """
    scale = length ** np.arange(4)[:, None]
    low = start * scale / np.array([factorial(k) for k in range(4)])[:, None]
    at_end = np.stack([_powers(np.ones(1), k)[0] for k in range(4)])
    high = np.linalg.solve(at_end[:, 4:], end * scale - at_end[:, :4] @ low)
    return SepticCurve(np.concatenate([low, high]), length)


def _powers(u: Array, order: int) -> Array:
    """Return the derivatives of the powers of the normalised parameter, shape (K, 8)."""
    exponents = np.arange(_DEGREE + 1)
    factors = np.array([perm(k, order) if k >= order else 0 for k in exponents], dtype=float)
    return factors * u[:, None] ** np.maximum(exponents - order, 0)
