"""Splines without SciPy, because importing SciPy takes longer than an ordinary plan.

A control point belongs to several polynomial pieces. It is the blossom (polar form) b of any of them, evaluated at the
d knots after its first: c_i = b(t_{i+1}, ..., t_{i+d}). The value at t is b(t, ..., t). Both are computed by de Boor's
recursion (Cohen, Lyche and Riesenfeld, 1980).
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from brachis.kernel.library import (
    Structured,
    address,
    as_contiguous,
    call,
    call_checked,
    declare_fields,
)


@dataclass(frozen=True, eq=False)
class Spline:
    """A spline of degree d over L + d + 1 knots, which may repeat.

    Attributes
    ----------
    knots : (L + d + 1,) ndarray
        Knots, ascending; the first d + 1 are equal, and so are the last d + 1.
    control_points : (L, ...) ndarray
    degree : int
        d.
    """

    knots: np.ndarray
    control_points: np.ndarray
    degree: int

    @classmethod
    def through(cls, places: np.ndarray, values: np.ndarray, degree: int = 3) -> Spline:
        """Interpolate values, (P, ...), at ascending places, (P,), with an odd degree d.

        The first (d + 1) / 2 intervals share one polynomial, and so do the last ("not a knot"). With d places or fewer,
        the spline consists of straight lines.

        Raises
        ------
        ValueError
            There are too few places, the places do not ascend, or there are more or fewer values than places.
        """
        if len(places) <= degree:
            degree = 1
        if len(places) < 2 or not (np.diff(places) > 0.0).all():
            raise ValueError(
                "the places of an interpolation are too few, or do not ascend"
            )
        if len(values) != len(places):
            raise ValueError(f"{len(values)} values for {len(places)} places")
        beside = (degree + 1) // 2
        inner = places[beside : len(places) - beside]
        outer = np.ones(degree + 1)
        knots = np.concatenate([places[0] * outer, inner, places[-1] * outer])
        span = _find_spans(knots, degree, places)
        number = np.arange(len(places))[:, None]
        column = span[:, None] + np.arange(-degree, 1)
        # Each of d + 1 successive control points has its own column.
        every = np.arange(len(places)) % (degree + 1)
        basis = cls(knots, np.eye(degree + 1)[every], degree)(places)
        matrix = np.zeros((len(places), 2 * degree + 1))
        matrix[number, column - number + degree] = basis[number, every[column]]
        points = np.array(values, dtype=float, order="C")
        columns = points.size // len(points)
        call("brachis_solve_band", len(points), degree, columns, matrix, points)
        return cls(knots, points, degree)

    def __call__(self, x: ArrayLike, nu: int = 0) -> np.ndarray:
        """Evaluate the spline, or its derivative of order `nu`, at x of any shape; at a knot, just after the knot."""
        if nu > 0:
            return self.derivative(x, nu - 1)
        x = np.asarray(x, dtype=float)
        flat = x.ravel()
        spans = _find_spans(self.knots, self.degree, flat)
        points = self.control_points.reshape(len(self.control_points), -1)
        values = blossom(self.knots, points, spans, [flat] * self.degree)
        return values.reshape(x.shape + self.control_points.shape[1:])

    def derivatives(
        self, x: np.ndarray, order: int, rounding: float = 0.0
    ) -> np.ndarray:
        """Return value and derivatives up to `order`, (order + 1, K, ...), at x, (K,), or just after x if x is a knot.

        An x at most `rounding` before a knot is treated as at this knot.
        """
        shape = self.control_points.shape
        points = self.control_points.reshape(len(self.control_points), -1)
        values = call_checked(
            "brachis_spline_orders",
            self.knots,
            points,
            x,
            rounding,
            o=order + 1,
            g=self.degree,
        )
        return np.reshape(values, (order + 1, len(x), *shape[1:]))

    @cached_property
    def derivative(self) -> Spline:
        """The derivative as a spline; zero for degree 0."""
        points = self.control_points
        if self.degree == 0:
            return Spline(self.knots, np.zeros_like(points), 0)
        width = self.knots[self.degree + 1 : -1] - self.knots[1 : -self.degree - 1]
        # Where knots repeat so often that a control point has no effect, the width is zero.
        share = np.divide(self.degree, width, out=np.zeros_like(width), where=width > 0)
        slopes = np.diff(points, axis=0) * share.reshape(-1, *[1] * (points.ndim - 1))
        return Spline(self.knots[1:-1], slopes, self.degree - 1)


def collocation(
    knots: np.ndarray, degree: int, places: np.ndarray, nu: int = 0
) -> np.ndarray:
    """Return a matrix, (P, L). ``matrix @ control_points`` is the spline, or a derivative, at places, (P,)."""
    return Spline(knots, np.eye(len(knots) - degree - 1), degree)(places, nu)


def blossom(
    knots: np.ndarray,
    control_points: np.ndarray,
    spans: np.ndarray,
    arguments: Sequence[np.ndarray],
) -> np.ndarray:
    """Evaluate the blossoms of a spline's polynomials; see the docstring of the module.

    Parameters
    ----------
    knots : (L + d + 1,) ndarray
    control_points : (L, c) ndarray
    spans : (K,) int ndarray
        Indices of the knots at which the spans of the polynomials begin.
    arguments : sequence of d (K,) ndarray

    Returns
    -------
    (K, c) ndarray
    """
    degree = len(arguments)
    count = len(spans)
    points = len(knots) - degree - 1
    if count and not degree <= spans.min() <= spans.max() < points:
        raise ValueError(
            f"a piece does not exist; the pieces are {degree} to {points - 1}"
        )
    places = np.reshape(arguments, (degree, count))
    values: np.ndarray = call_checked(
        "brachis_blossoms", knots, control_points, spans, places, g=degree, L=points
    )
    return values


def bernstein(coefficients: np.ndarray, spans: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Evaluate polynomials in Bernstein form by de Casteljau's algorithm.

    Parameters
    ----------
    coefficients : (m + 1, L, ...) ndarray
        Coefficients of L pieces.
    spans : (K,) int ndarray
    u : (K,) ndarray
        Positions in the pieces, 0 to 1.

    Returns
    -------
    (K, ...) ndarray
    """
    width, count, *shape = coefficients.shape
    if len(spans) and not 0 <= spans.min() <= spans.max() < count:
        raise ValueError(f"a piece does not exist; the pieces are 0 to {count - 1}")
    columns = coefficients.reshape(width, count, math.prod(shape))
    values = call_checked("brachis_bernstein", columns, spans, u)
    return np.reshape(values, (len(u), *shape))


def _find_spans(knots: np.ndarray, degree: int, x: np.ndarray) -> np.ndarray:
    """Find the knot at which the span of each x, (K,), begins. An x outside the knots belongs to the outer span."""
    spans = np.searchsorted(knots, x, side="right") - 1
    return np.clip(spans, degree, len(knots) - degree - 2)


class _Basis(ctypes.Structure):
    """The structure `basis` of splines.c."""

    _fields_ = declare_fields("l orders count width; p values first")


@dataclass(frozen=True, eq=False)
class Basis(Structured):
    """Basis functions of splines and their derivatives at K places. Functions that are zero there are left out.

    Attributes
    ----------
    values : (orders, K, w) ndarray
    first : (K,) int ndarray
        Index of the control point that belongs to the first of the w functions.
    """

    values: np.ndarray
    first: np.ndarray

    def __post_init__(self) -> None:
        """Raise an error if indices of control points are impossible."""
        if self.first.shape != (self.values.shape[1],):
            raise ValueError("`first` must have one index for each place")
        if self.first.min(initial=0) < 0:
            raise ValueError("indices of control points are negative")

    @cached_property
    def _needed(self) -> int:
        """Number of control points that a curve needs."""
        return int(self.first.max(initial=0)) + self.values.shape[2]

    def _make_structure(self) -> _Basis:
        values = as_contiguous(self.values, self.values.shape)
        first = self.first.astype("l", order="C", copy=False)
        structure = _Basis(*values.shape, address(values), address(first))
        structure.arrays = values, first
        return structure

    def sum(self, control_points: np.ndarray) -> np.ndarray:
        """Compute values and derivatives, (orders, K, c), of splines with control points, (c, L)."""
        orders, count, _ = self.values.shape
        curves, point_count = control_points.shape
        if count and point_count < self._needed:
            raise ValueError(f"a control point does not exist; there are {point_count}")
        # The shapes are known, so the slower `call_checked` is not needed. No function is called more often.
        values = np.empty((orders, count, curves))
        points = as_contiguous(control_points, (curves, point_count))
        call("brachis_curves", self.address, curves, point_count, points, values)
        return values
