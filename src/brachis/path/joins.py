"""Checking that curves continue each other to the third derivative."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from brachis.path.protocol import Array, Curve

TOLERANCE = 1e-6
"""Largest relative mismatch of derivatives at a join: coordinates are given with six digits or more."""
_WORTH_MENTIONING = 0.01


@dataclass(frozen=True, eq=False)
class Join:
    """The place where segment `index` of the path ends and the next one begins, before blends.

    Attributes
    ----------
    index : int
        Index of the segment that ends.
    s : float
        Path coordinate.
    point : ndarray, shape (m,)
        Task coordinates.
    rows : tuple of str
        Rows of the task space.
    """

    index: int
    s: float
    point: Array
    rows: tuple[str, ...]

    @property
    def positions(self) -> int:
        """Number of position rows."""
        return len(self.rows) - ("yaw" in self.rows)

    @property
    def where(self) -> str:
        """Keys and place, for messages."""
        place = ", ".join(f"{row} = {value:.6g}" for row, value in zip(self.rows, self.point, strict=True))
        return f"path[{self.index}] to path[{self.index + 1}], at s = {self.s:.4g}, {place}"

    @property
    def blend_key(self) -> str:
        """The key that rounds the corner."""
        return f"path[{self.index}].blend"


def find_joins(curves: Sequence[Curve], rows: tuple[str, ...]) -> list[Join]:
    """Return the joins between consecutive curves."""
    ends = np.cumsum([curve.length for curve in curves])
    points = [curve.derivatives(np.zeros(1), 0)[0, 0] for curve in curves[1:]]
    return [Join(i, float(ends[i] / ends[-1]), point, rows) for i, point in enumerate(points)]


def mismatch(first: Curve, second: Curve, positions: int) -> str | None:
    """Return in words what jumps from one curve to the next, or None where three derivatives continue."""
    before = first.derivatives(np.array([first.length]))[:, 0]
    after = second.derivatives(np.zeros(1))[:, 0]
    # The k-th derivative times length^(k - 1) compares with the speed, which is about 1.
    lengths = min(first.length, second.length) ** np.arange(-1.0, 3.0)
    size = max(float(np.linalg.norm(before[1])), 1.0)
    jumps = np.linalg.norm(after - before, axis=1) * lengths / size
    if np.all(jumps <= TOLERANCE):
        return None
    if jumps[1] > TOLERANCE:
        corner = _angle(before[1], after[1])
        speed, new_speed = (float(np.linalg.norm(one[1])) for one in (before, after))
        # Splines change their speed at joins; what rounding turns the tangent by is then not worth a word.
        if corner > _WORTH_MENTIONING * abs(new_speed - speed):
            return f"a corner of {np.rad2deg(corner):.4g} degrees{_of_yaw(before, after, positions)}"
        return f"the parameter's speed changing from {speed:.6g} to {new_speed:.6g}"
    if jumps[2] > TOLERANCE:
        return f"a curvature jump of {np.linalg.norm(after[2] - before[2]):.4g} 1/m"
    return f"a jump of {np.linalg.norm(after[3] - before[3]):.4g} 1/m^2 in the third derivative"


def refuse_corners(joins: Sequence[tuple[Join, str]]) -> None:
    """Raise a `PathError` for the first of the joins that do not match, naming the others, if there are any."""
    if not joins:
        return
    join, found = joins[0]
    others = ", ".join(other.blend_key for other, _ in joins[1:])
    problem = "the path must be smooth to the third derivative"
    raise PathError(
        problem,
        s_interval=(join.s, join.s),
        found=found,
        allowed="segments that continue each other, or a blend",
        where=join.where,
        hint=f"Set {join.blend_key} (m) to round it" + (f"; likewise {others}" if others else ""),
    )


def _angle(one: Array, other: Array) -> float:
    """Return the angle between two vectors, accurate for small ones as well."""
    a, b = one * np.linalg.norm(other), other * np.linalg.norm(one)
    return float(2 * np.arctan2(np.linalg.norm(a - b), np.linalg.norm(a + b)))


def _of_yaw(before: Array, after: Array, positions: int) -> str:
    """Say that it is yaw's slope that jumps where the position goes straight on."""
    if before.shape[1] == positions or np.linalg.norm((after - before)[1, :positions]) > TOLERANCE:
        return ""
    return f" in yaw alone, which turns by {before[1, -1]:.4g} rad/m before and {after[1, -1]:.4g} rad/m after"
