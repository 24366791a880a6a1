"""Looking for the smallest value of a function along a curve."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from brachis.path.protocol import Array

_POINTS = 64


def smallest(function: Callable[[Array], Array], knots: Array) -> tuple[float, float]:
    """Return where a continuous function is smallest, and its value there.

    Parameters
    ----------
    function : callable
        Values, shape (K,), at K values of sigma. It is looked at 64 times between two knots, and then as often around
        the smallest value found.
    knots : ndarray, shape (n,)
        Values of sigma between which the function is smooth.
    """
    fractions = np.arange(_POINTS) / _POINTS
    grid = np.append((knots[:-1, None] + fractions * np.diff(knots)[:, None]).ravel(), knots[-1])
    near = int(np.argmin(function(grid)))
    fine = np.linspace(grid[max(near - 1, 0)], grid[min(near + 1, len(grid) - 1)], 2 * _POINTS + 1)
    values = function(fine)
    best = int(np.argmin(values))
    return float(fine[best]), float(values[best])
