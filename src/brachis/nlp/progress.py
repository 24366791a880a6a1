"""Rows that keep ds/dt >= 0 at all times: the control points of s do not decrease."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.nlp.boundary import BoundarySpline


@dataclass(frozen=True, eq=False)
class Progress:
    """Differences of successive control points of s, those that bounds on single variables do not take care of.

    Attributes
    ----------
    offset : (p,) ndarray
        What the rows are besides.
    row, variable : (z,) int ndarray
        Entries of the Jacobian, which is constant, each place once; variables of the phase, the duration among them.
    weight : (z,) ndarray
    """

    offset: np.ndarray
    row: np.ndarray
    variable: np.ndarray
    weight: np.ndarray

    @classmethod
    def of(cls, spline: BoundarySpline, first: int) -> Progress:
        """Take the differences of a spline whose free variables begin at `first`; the duration is variable 0."""
        point, entry = np.nonzero(spline.variable >= 0)
        variable, weight = first + spline.variable[point, entry], spline.weight[point, entry]
        every = np.arange(len(spline.rate))
        point, variable = np.append(point, every), np.append(variable, np.zeros_like(every))
        weight = np.append(weight, spline.rate)
        # Control point i is in difference i - 1, and with the other sign in difference i.
        number = np.concatenate([point - 1, point])
        places = number * (first + spline.free) + np.tile(variable, 2)
        unique, place = np.unique(places[(number >= 0) & (number < len(every) - 1)], return_inverse=True)
        signed = np.concatenate([weight, -weight])[(number >= 0) & (number < len(every) - 1)]
        total = np.bincount(place, weights=signed)
        unique, total = unique[total != 0.0], total[total != 0.0]
        number, variable = np.divmod(unique, first + spline.free)
        several = np.bincount(number, minlength=len(every) - 1) > 1
        kept = several[number]
        row = np.cumsum(several) - 1
        return cls(np.diff(spline.fixed)[several], row[number[kept]], variable[kept], total[kept])

    @classmethod
    def none(cls) -> Progress:
        """Return no rows, where there is no path."""
        nothing = np.empty(0, dtype=int)
        return cls(np.empty(0), nothing, nothing, np.empty(0))

    def values(self, x: np.ndarray) -> np.ndarray:
        """Values of the rows, (p,)."""
        parts = np.bincount(self.row, weights=self.weight * x[self.variable], minlength=len(self.offset))
        return np.asarray(self.offset + parts)
