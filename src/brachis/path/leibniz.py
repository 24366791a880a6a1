"""Exact higher derivatives of products, unit vectors, and sines, by Leibniz' rule.

A function of one parameter is given by its derivatives: an array whose first axis counts them, from the value on; shape
(order + 1, ...). Then ``f[1:]`` are the derivatives of f', and ``(f g)[k] = sum_i binomial(k, i) f[i] g[k - i]``.
"""

from __future__ import annotations

from math import comb
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from brachis.path.protocol import Array


def product(one: Array, other: Array, how: str) -> Array:
    """Return the derivatives of a product, as many as both factors have.

    Parameters
    ----------
    one, other : ndarray, shape (order + 1, ...)
        Derivatives of the factors.
    how : str
        The product of two values, in the notation of `numpy.einsum`, for example ``"...ij,...j->...i"``.
    """
    orders = range(min(len(one), len(other)))
    return np.stack([sum(comb(k, i) * np.einsum(how, one[i], other[k - i]) for i in range(k + 1)) for k in orders])


def unit(vector: Array) -> Array:
    """Return the derivatives of a vector divided by its length, shape (order + 1, ..., n).

    With the squared length n, ``y = n^(-1/2)`` solves ``n y' = -n' y / 2``, which gives one derivative after the other.
    """
    squared = product(vector, vector, "...i,...i->...")
    inverse = np.zeros_like(squared)
    inverse[0] = 1.0 / np.sqrt(squared[0])
    for k in range(len(vector) - 1):
        right = sum(comb(k, i) * squared[i + 1] * inverse[k - i] for i in range(k + 1)) / -2.0
        left = sum(comb(k, i) * squared[i] * inverse[k + 1 - i] for i in range(1, k + 1))
        inverse[k + 1] = (right - left) / squared[0]
    return product(vector, inverse, "...i,...->...i")


def sine_cosine(angle: Array) -> tuple[Array, Array]:
    """Return the derivatives of the sine and the cosine of an angle, shape (order + 1, ...)."""
    sine, cosine = np.zeros_like(angle), np.zeros_like(angle)
    sine[0], cosine[0] = np.sin(angle[0]), np.cos(angle[0])
    for k in range(len(angle) - 1):
        sine[k + 1] = sum(comb(k, i) * angle[i + 1] * cosine[k - i] for i in range(k + 1))
        cosine[k + 1] = -sum(comb(k, i) * angle[i + 1] * sine[k - i] for i in range(k + 1))
    return sine, cosine
