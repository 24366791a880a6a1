"""How much of its neighbours a blend may take so that it stays near the corner that it rounds."""

from __future__ import annotations

from math import cos, sin

_MIDDLE = 11.0 / 64.0
"""Weight of the first derivatives, of opposite signs, in the middle of the septic polynomial between two points."""
_OF_NEIGHBOUR = 0.45


def blend_size(angle: float, distance: float, shortest: float) -> float:
    """Return what a blend takes from either side, m, that passes a corner of straight lines at a distance, m.

    With `size` from either side and unit tangents a, b the ends lie at -size a and size b of the corner, and the
    blend's parameter has the length ``size (1 + cos(angle / 2))``, see `brachis.path.blend`. Its middle is
    ``(b - a) (size / 2 - 11/64 length)`` away, and ``|b - a| = 2 sin(angle / 2)``.

    Parameters
    ----------
    angle : float
        Change of direction, rad.
    distance : float
    shortest : float
        Length of the shorter neighbour, m.
    """
    of_size = 2.0 * sin(angle / 2.0) * (0.5 - _MIDDLE * (1.0 + cos(angle / 2.0)))
    return min(distance / of_size, _OF_NEIGHBOUR * shortest)
