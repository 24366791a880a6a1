"""The path coordinate over time, as a B-spline that does not decrease."""

from __future__ import annotations

import numpy as np

DEGREE = 3
_OFF = 2e-8
"""Root mean square of what the spline may differ from the path coordinates, as a part of the path."""


def coordinate_spline(t: np.ndarray, s: np.ndarray, *, at_rest: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return knots over [0, 1] and control points of s over normalised time.

    Its knots lie where s bends. Control points that do not decrease make a spline that does not.

    Parameters
    ----------
    t, s : (K,) ndarray
        Ascending; s from 0 to 1.
    at_rest : bool
        Whether ds/dt vanishes at both ends.
    """
    from scipy.interpolate import splrep  # noqa: PLC0415  (imports in 0.3 s)

    knots, control_points, _ = splrep(t / t[-1], s, k=DEGREE, s=len(s) * _OFF**2)
    control_points = control_points[: len(knots) - DEGREE - 1].clip(0.0, 1.0)
    control_points[[0, -1]] = 0.0, 1.0
    if at_rest:
        control_points[[1, -2]] = 0.0, 1.0
    return knots, np.maximum.accumulate(control_points)
