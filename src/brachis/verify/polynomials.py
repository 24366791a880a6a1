"""Roots of polynomials in Bernstein form, many at a time: where a motion turns, peaks or crosses a value.

A polynomial of degree m is monotone between the roots of its derivative, which has degree m - 1; so the roots follow
one degree after the other, from the linear case on, each between neighbouring ones of the degree below. A polynomial
whose Bernstein coefficients do not change their sign has no root at all, which decides nearly every case.
"""

from __future__ import annotations

import math

import numpy as np

_STEPS = 60
_ROUNDING = 1e-14


def values_of(coefficients: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Evaluate F polynomials, (m + 1, F, ...), each at its own u in [0, 1], (F,)."""
    degree = len(coefficients) - 1
    factors = np.array([math.comb(degree, k) for k in range(degree + 1)], dtype=float)
    up, down = np.ones((degree + 1, len(u))), np.ones((degree + 1, len(u)))
    np.cumprod(np.broadcast_to(u, (degree, len(u))), axis=0, out=up[1:])
    np.cumprod(np.broadcast_to(1.0 - u, (degree, len(u))), axis=0, out=down[1:])
    return np.einsum("k,kf,kf,kf...->f...", factors, up, down[::-1], coefficients)


def roots(coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the places in (0, 1) at which polynomials change their sign.

    Parameters
    ----------
    coefficients : (m + 1, F) ndarray
        Bernstein coefficients of F polynomials of degree m >= 1.

    Returns
    -------
    column : (Z,) int ndarray
        Polynomial of every root, ascending.
    u : (Z,) ndarray
        Root; ascending within a polynomial.
    """
    kept = np.flatnonzero((coefficients.min(axis=0) < 0.0) & (coefficients.max(axis=0) > 0.0))
    c = coefficients[:, kept]
    if len(c) == 2:  # noqa: PLR2004  (linear)
        return kept, c[0] / (c[0] - c[1])
    turns, at = roots(np.diff(c, axis=0))
    every = np.arange(len(kept))
    column = np.concatenate([every, turns, every])
    u = np.concatenate([np.zeros(len(kept)), at, np.ones(len(kept))])
    order = np.lexsort((u, column))
    column, u = column[order], u[order]
    value = values_of(c[:, column], u)
    crossing = np.flatnonzero((column[1:] == column[:-1]) & (value[1:] * value[:-1] < 0.0))
    found = _between(c[:, column[crossing]], u[crossing], u[crossing + 1], value[crossing], value[crossing + 1])
    exact = (value == 0.0) & (u > 0.0) & (u < 1.0)
    column, u = np.concatenate([column[crossing], column[exact]]), np.concatenate([found, u[exact]])
    order = np.lexsort((u, column))
    return kept[column[order]], u[order]


def _between(c: np.ndarray, a: np.ndarray, b: np.ndarray, at_a: np.ndarray, at_b: np.ndarray) -> np.ndarray:
    """Find the root between a and b, where monotone polynomials have values of opposite sign (the Illinois method)."""
    enough = _ROUNDING * np.abs(c).max(axis=0, initial=0.0)
    powers = _powers(c)
    u = a
    for _ in range(_STEPS if len(a) else 0):
        u = np.clip((a * at_b - b * at_a) / (at_b - at_a), a, b)
        value = powers[-1]
        for coefficient in powers[-2::-1]:
            value = value * u + coefficient
        if np.all((np.abs(value) <= enough) | (b - a <= _ROUNDING)):
            break
        left = value * at_a > 0.0  # the root lies right of u; the value that stays is halved
        a, b = np.where(left, u, a), np.where(left, b, u)
        at_a, at_b = np.where(left, value, 0.5 * at_a), np.where(left, 0.5 * at_b, value)
    return u


def _powers(c: np.ndarray) -> np.ndarray:
    """Coefficients of the powers of u, (m + 1, F), of polynomials in Bernstein form."""
    return np.array([math.comb(len(c) - 1, k) * np.diff(c, n=k, axis=0)[0] for k in range(len(c))])


def turns(coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find where polynomials, (m + 1, F), turn within (0, 1).

    Returns
    -------
    column : (Z,) int ndarray
    u, value : (Z,) ndarray
    """
    column, u = roots(np.diff(coefficients, axis=0))
    return column, u, values_of(coefficients[:, column], u)
