"""What a fit says of itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.cam.points import Array

_MOST = 400


@dataclass(frozen=True)
class CornerRemark:
    """A corner that was found.

    Attributes
    ----------
    row : int
        Line of the file, or index, of the nearest point.
    angle : float
        Change of direction, rad.
    distance : float
        Along the path from its first point, m.
    blend : float
        What its blend takes from either side, m.
    """

    row: int
    angle: float
    distance: float
    blend: float


@dataclass(frozen=True)
class Report:
    """Where a path comes from, and how near it is to the points; as it stands for a path through all of them.

    Attributes
    ----------
    source : str
    points : int
    length : float
        m.
    position_error, position_rms, position_tolerance : float
        Largest and root mean square distance of the points from the curve, and what was allowed, m.
    orientation_error, orientation_tolerance : float
        Largest angle, and what was allowed, rad.
    intervals : int
        Knot intervals of the spline, or of all of them.
    corners : tuple of CornerRemark
    told : tuple of str
        What was found out about the data.
    doubt : str or None
        What of the data is hardly meant.
    profile : tuple of (float, float, float)
        Along the path, m: the largest distance, m, and angle, rad, of the points there.
    """

    source: str
    points: int
    length: float
    position_error: float = 0.0
    position_rms: float = 0.0
    position_tolerance: float = 0.0
    orientation_error: float = 0.0
    orientation_tolerance: float = 0.0
    intervals: int = 0
    corners: tuple[CornerRemark, ...] = ()
    told: tuple[str, ...] = ()
    doubt: str | None = None
    profile: tuple[tuple[float, float, float], ...] = ()


def profile_of(along: Array, distances: Array, angles: Array) -> tuple[tuple[float, float, float], ...]:
    """Return the largest errors of successive groups of points, at most a few hundred groups."""
    starts = np.unique(np.linspace(0, len(along), min(len(along), _MOST), endpoint=False).astype(int))
    largest = (np.maximum.reduceat(values, starts).tolist() for values in (along, distances, angles))
    return tuple(zip(*largest, strict=True))
