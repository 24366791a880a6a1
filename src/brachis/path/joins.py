"""Checking that curves, of rows or of poses, continue each other to the third derivative."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from brachis.common import tolerances
from brachis.errors import PathError
from brachis.path.context import place, stands_still
from brachis.path.protocol import Array, Curve
from brachis.path.rotations import angular_rates
from brachis.robot.task_map.protocol import joints_of, position_rows

_SHARPEST = np.radians(172.0)
"""Largest corner, rad, that a blend rounds: beyond 172.1 degrees that of two lines falls below its least speed."""


@dataclass(frozen=True, eq=False)
class Join:
    """The place where one segment of the path ends and the next one begins, before blends.

    Attributes
    ----------
    first, second : Curve
        The curves that meet.
    index : int
        Index of the segment that ends.
    s : float
        Path coordinate.
    rows : tuple of str
        Rows of the task space; of a pose its position rows.
    """

    first: Curve
    second: Curve
    index: int
    s: float
    rows: tuple[str, ...]

    @property
    def point(self) -> Array:
        """Task coordinates, (m,); of a pose twelve."""
        return self.second.derivatives(np.zeros(1), 0)[0, 0]

    @property
    def shorter(self) -> float:
        """Length of the shorter curve, sigma."""
        return min(self.first.length, self.second.length)

    def sides(self, distance: float = 0.0) -> tuple[Array, Array]:
        """Return the derivatives, (4, m), of both curves at a distance before and after the join, sigma."""
        before = self.first.derivatives(np.array([self.first.length - distance]))
        after = self.second.derivatives(np.array([distance]))
        return before[:, 0], after[:, 0]

    @property
    def positions(self) -> int:
        """Number of position rows."""
        return len(position_rows(self.rows))

    @property
    def where(self) -> str:
        """Keys and place, for messages."""
        return f"path[{self.index}] to path[{self.index + 1}], at s = {self.s:.4g}, {place(self.rows, self.point)}"

    @property
    def blend_key(self) -> str:
        """The key that rounds the corner."""
        return f"path[{self.index}].blend"

    @property
    def rounding(self) -> str:
        """What to set to round the corner, if a blend can, or to stop at it."""
        before, after = (side[1, : self.positions] for side in self.sides())
        if angle_between(before, after) > _SHARPEST:
            return self.stopping
        return f"{self.blend_key} ({self.unit}) to round it, or {self.stopping}"

    @property
    def stopping(self) -> str:
        """What to set to stop at the corner."""
        return f"path[{self.index}].stop: true to stop there"

    @property
    def unit(self) -> str:
        """Unit of lengths along the path."""
        return "rad, m" if joints_of(self.rows) else "m"

    def wrong_blend(
        self, problem: str, found: str, allowed: str, hint: str | None
    ) -> PathError:
        """Return the error that the corner cannot be rounded."""
        return PathError(
            problem,
            s_interval=(self.s, self.s),
            found=found,
            allowed=allowed,
            where=f"{self.blend_key}: {self.where}",
            hint=hint,
        )


class Corner(NamedTuple):
    """A join where curves do not continue each other; what jumps, in words; what to try."""

    join: Join
    found: str
    advice: str


def find_joins(curves: Sequence[Curve], rows: tuple[str, ...]) -> list[Join]:
    """Return the joins between consecutive curves."""
    ends = np.cumsum([curve.length for curve in curves])
    return [
        Join(first, second, i, float(ends[i] / ends[-1]), rows)
        for i, (first, second) in enumerate(pairwise(curves))
    ]


def row_corner(join: Join) -> Corner | None:
    """Return what jumps from one curve of rows to the next, or None where three derivatives continue."""
    found = _mismatch(join, *join.sides())
    return Corner(join, found, f"Set {join.rounding}") if found else None


def _mismatch(join: Join, before: Array, after: Array) -> str | None:
    """Return in words what jumps between derivatives by sigma, (4, m), or None where three derivatives continue."""
    # The k-th derivative times length^(k - 1) compares with the speed, which is about 1.
    size = max(np.linalg.norm(before[1]), 1.0)
    jumps = (
        np.linalg.norm(after - before, axis=1)
        * join.shorter ** np.arange(-1.0, 3.0)
        / size
    )
    if np.all(jumps <= tolerances.WRITTEN):
        return None
    if jumps[1] > tolerances.WRITTEN:
        corner = angle_between(before[1], after[1])
        speed, new_speed = (np.linalg.norm(one[1]) for one in (before, after))
        # Splines change their speed at joins; what rounding turns the tangent by is then not worth a word.
        if corner > 0.01 * abs(new_speed - speed):
            moved = np.linalg.norm((after - before)[1, : join.positions])
            alone = "" if moved > tolerances.WRITTEN else f" in {join.rows[-1]} alone"
            return f"a corner of {np.rad2deg(corner):.4g} degrees{alone}"
        return f"the parameter's speed changing from {speed:.6g} to {new_speed:.6g}"
    if jumps[2] > tolerances.WRITTEN:
        return f"a curvature jump of {np.linalg.norm(after[2] - before[2]):.4g} 1/m"
    return f"a jump of {np.linalg.norm(after[3] - before[3]):.4g} 1/m^2 in the third derivative"


def refuse_corners(corners: Sequence[Corner | None]) -> None:
    """Raise a `PathError` for the first of the corners, naming the others, if there are any."""
    refused = [corner for corner in corners if corner is not None]
    if not refused:
        return
    join, found, advice = refused[0]
    others = ", ".join(f"path[{other.index}]" for other, *_ in refused[1:])
    raise PathError(
        "the path must be smooth to the third derivative",
        s_interval=(join.s, join.s),
        found=found,
        allowed="segments that continue each other",
        where=join.where,
        hint=advice + (f"; likewise {others}" if others else ""),
    )


def angle_between(one: Array, other: Array) -> float:
    """Return the angle between two vectors, accurate for small ones as well."""
    a = one * np.linalg.norm(other)
    b = other * np.linalg.norm(one)
    return float(2 * np.arctan2(np.linalg.norm(a - b), np.linalg.norm(a + b)))


def pose_corner(join: Join) -> Corner | None:
    """Return what jumps from one curve of poses to the next, or None where three derivatives continue."""
    on_the_spot = [
        stands_still(curve, join.positions) for curve in (join.first, join.second)
    ]
    if on_the_spot[0] != on_the_spot[1]:
        return Corner(
            join,
            "a stop: the position moves on one side, and the tool turns on the spot on the other",
            f"Turn the tool along a segment, by its orientation, or set {join.stopping}",
        )
    before, after = join.sides()
    jump = _mismatch(join, before[:, : join.positions], after[:, : join.positions])
    if jump:
        return Corner(join, jump, f"Set {join.rounding}")
    unit = "rad" if on_the_spot[0] else "m"
    jump = _turning_mismatch(join, before, after, unit)
    otherwise = join.stopping if on_the_spot[0] else join.rounding
    advice = f"Set profile: smooth where the tool turns, or {otherwise}"
    return Corner(join, jump, advice) if jump else None


def _turning_mismatch(join: Join, before: Array, after: Array, unit: str) -> str | None:
    """Return in words what jumps in the turning of the tool, or None where three derivatives continue.

    Parameters
    ----------
    join : Join
    before, after : ndarray, shape (4, c)
        Derivatives of the coordinates of the pose by sigma at the join.
    unit : str
        Unit of sigma.
    """
    old, new = (angular_rates(one) for one in (before, after))
    jumps = np.linalg.norm(new - old, axis=1)
    allowed = tolerances.WRITTEN * max(float(np.linalg.norm(old[0])), 1.0)
    large = np.flatnonzero(jumps * join.shorter ** np.arange(3.0) > allowed)
    if not large.size:
        return None
    k = int(large[0])
    what = ("", "'s slope", "'s second derivative")[k]
    jump = f"{jumps[k]:.4g} rad/{unit}^{k + 1}".removesuffix("^1")
    return f"the tool's turning rate{what} jumps by {jump}"
