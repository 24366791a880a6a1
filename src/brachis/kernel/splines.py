"""Splines without SciPy, whose import takes longer than an ordinary plan.

A control point of a spline is the blossom (polar form) of any polynomial piece that it belongs to, at the d knots
behind its first: c_i = b(t_{i+1}, ..., t_{i+d}). The value at t is b(t, ..., t). Both are found by de Boor's recursion
(Cohen, Lyche and Riesenfeld, 1980).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from brachis.kernel.library import as_contiguous, call, compute


@dataclass(frozen=True, eq=False)
class Spline:
    """A spline of degree d over L + d + 1 knots, which may repeat.

    Attributes
    ----------
    knots : (L + d + 1,) ndarray
        Ascending; the first and the last d + 1 are equal.
    control_points : (L, ...) ndarray
    degree : int
        d.
    """

    knots: np.ndarray
    control_points: np.ndarray
    degree: int

    @classmethod
    def through(cls, places: np.ndarray, values: np.ndarray, degree: int = 3) -> Spline:
        """Interpolate values, (P, ...), at ascending places, (P,); d is odd.

        The first and the last (d + 1) / 2 intervals are one polynomial each ("not a knot"). Between d places or fewer,
        lines are straight.

        Raises
        ------
        ValueError
            The places are too few, or do not ascend, or there are more or fewer values.
        """
        if len(places) <= degree:
            degree = 1
        if len(places) < 2 or not (np.diff(places) > 0.0).all():
            raise ValueError("the places of an interpolation are few, or do not ascend")
        if len(values) != len(places):
            raise ValueError(f"{len(values)} values for {len(places)} places")
        beside = (degree + 1) // 2
        inner = places[beside : len(places) - beside]
        outer = np.ones(degree + 1)
        knots = np.concatenate([places[0] * outer, inner, places[-1] * outer])
        piece = _find_piece(knots, degree, places)
        number = np.arange(len(places))[:, None]
        column = piece[:, None] + np.arange(-degree, 1)
        # Of d + 1 successive control points each has a column of its own.
        every = np.arange(len(places)) % (degree + 1)
        basis = cls(knots, np.eye(degree + 1)[every], degree)(places)
        matrix = np.zeros((len(places), 2 * degree + 1))
        matrix[number, column - number + degree] = basis[number, every[column]]
        points = np.array(values, dtype=float, order="C")
        columns = points.size // len(points)
        call("brachis_solve_band", len(points), degree, columns, matrix, points)
        return cls(knots, points, degree)

    def __call__(self, x: ArrayLike, nu: int = 0) -> np.ndarray:
        """Value, or derivative of the order `nu`, at x, of any shape; at a knot that just after it."""
        if nu > 0:
            return self.derivative(x, nu - 1)
        x = np.asarray(x, dtype=float)
        flat = x.ravel()
        piece = _find_piece(self.knots, self.degree, flat)
        points = self.control_points.reshape(len(self.control_points), -1)
        values = blossom(self.knots, points, piece, [flat] * self.degree)
        return values.reshape(x.shape + self.control_points.shape[1:])

    def derivatives(
        self, x: np.ndarray, order: int, rounding: float = 0.0
    ) -> np.ndarray:
        """Value and derivatives up to `order`, (order + 1, K, ...), at x, (K,); at knots those just after them.

        What is no more than `rounding` before a knot is at this knot.
        """
        shape = self.control_points.shape
        points = self.control_points.reshape(len(self.control_points), -1)
        sizes = {"o": order + 1, "g": self.degree}
        arrays = (self.knots, points, x, rounding)
        values = compute("brachis_spline_orders", *arrays, **sizes)
        return np.reshape(values, (order + 1, len(x), *shape[1:]))

    @cached_property
    def derivative(self) -> Spline:
        """The derivative as a spline; zero of steps."""
        points = self.control_points
        if self.degree == 0:
            return Spline(self.knots, np.zeros_like(points), 0)
        width = self.knots[self.degree + 1 : -1] - self.knots[1 : -self.degree - 1]
        # Where knots repeat so often that a control point matters nowhere, the width is zero.
        share = np.divide(self.degree, width, out=np.zeros_like(width), where=width > 0)
        slopes = np.diff(points, axis=0) * share.reshape(-1, *[1] * (points.ndim - 1))
        return Spline(self.knots[1:-1], slopes, self.degree - 1)


def collocation(
    knots: np.ndarray, degree: int, places: np.ndarray, nu: int = 0
) -> np.ndarray:
    """Matrix, (P, L), with ``matrix @ control_points`` the spline, or a derivative, at places, (P,)."""
    return Spline(knots, np.eye(len(knots) - degree - 1), degree)(places, nu)


def blossom(
    knots: np.ndarray,
    control_points: np.ndarray,
    piece: np.ndarray,
    arguments: Sequence[np.ndarray],
) -> np.ndarray:
    """Evaluate the blossoms of a spline's pieces; see the module.

    Parameters
    ----------
    knots : (L + d + 1,) ndarray
    control_points : (L, c) ndarray
    piece : (K,) int ndarray
        Numbers of the knots at which the pieces begin.
    arguments : sequence of d (K,) ndarray

    Returns
    -------
    (K, c) ndarray
    """
    degree = len(arguments)
    count = len(piece)
    points = len(knots) - degree - 1
    if count and not degree <= piece.min() <= piece.max() < points:
        raise ValueError(f"a piece does not exist; they are {degree} to {points - 1}")
    places = np.reshape(arguments, (degree, count))
    arrays = (knots, control_points, piece, places)
    values: np.ndarray = compute("brachis_blossoms", *arrays, g=degree, L=points)
    return values


def bernstein(coefficients: np.ndarray, piece: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Evaluate polynomials in Bernstein form by de Casteljau's algorithm.

    Parameters
    ----------
    coefficients : (m + 1, L, ...) ndarray
        Of L pieces.
    piece : (K,) int ndarray
    u : (K,) ndarray
        Places in the pieces, 0 to 1.

    Returns
    -------
    (K, ...) ndarray
    """
    width, count, *others = coefficients.shape
    if len(piece) and not 0 <= piece.min() <= piece.max() < count:
        raise ValueError(f"a piece does not exist; they are 0 to {count - 1}")
    columns = coefficients.reshape(width, count, math.prod(others))
    values = compute("brachis_bernstein", columns, piece, u)
    return np.reshape(values, (len(u), *others))


def _find_piece(knots: np.ndarray, degree: int, x: np.ndarray) -> np.ndarray:
    """Find the knot at which the piece of each x, (K,), begins; beyond the ends that of the outer piece."""
    piece = np.searchsorted(knots, x, side="right") - 1
    return np.clip(piece, degree, len(knots) - degree - 2)


class Basis:
    """Basis functions of splines, and their derivatives, that matter at K places.

    Parameters
    ----------
    values : (orders, K, w) ndarray
    first : (K,) int ndarray
        Number of the control point of the first of the w functions.
    """

    def __init__(self, values: np.ndarray, first: np.ndarray) -> None:
        orders, count, width = values.shape
        if first.shape != (count,):
            raise ValueError("first needs one number for each place")
        if count and first.min() < 0:
            raise ValueError("numbers of control points are negative")
        self._values = as_contiguous(values, (orders, count, width))
        self._first = first.astype("l", order="C", copy=False)
        self._needed = int(first.max(initial=0)) + width

    def sum(self, control_points: np.ndarray) -> np.ndarray:
        """Values of splines with control points, (c, L), and their derivatives, (orders, K, c)."""
        orders, count, width = self._values.shape
        curves, many = control_points.shape
        if count and many < self._needed:
            raise ValueError(f"a control point does not exist; there are {many}")
        # Shapes are known here, and this is called most often.
        values = np.empty((orders, count, curves))
        points = as_contiguous(control_points, (curves, many))
        basis = (orders, count, width, self._values, self._first)
        call("brachis_curves", *basis, curves, many, points, values)
        return values
