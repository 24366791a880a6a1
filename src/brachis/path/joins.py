"""Joins between curves of rows or of poses: whether consecutive curves match, and blends that round corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from math import floor
from typing import NamedTuple

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import with_like_signs
from brachis.errors import PathError
from brachis.path.context import place, stands_still
from brachis.path.curves import SplineCurve, septic
from brachis.path.pose import LEAST_QUALITY, least_quality, quaternion_curve, rotations
from brachis.path.protocol import Array, Curve
from brachis.path.rotations import angular_rates, quaternion_derivatives, rotation_of
from brachis.robot.plausibility import position_hint
from brachis.robot.task_map.protocol import joints_of, position_rows
from brachis.task.points.units import quaternions_of

_SHARPEST = np.radians(172.0)
"""Maximum corner that a blend can round, rad: above 172.1 degrees, the blend of two lines is too slow in the middle."""


@dataclass(frozen=True, eq=False)
class Join:
    """The place where one segment of the path ends and the next one begins, before blending.

    Attributes
    ----------
    first, second : Curve
        The two curves that meet at the join.
    index : int
        Index of the segment that ends.
    s : float
        Path coordinate of the join.
    rows : tuple of str
        Rows of the task space; for a pose, only the position rows.
    """

    first: Curve
    second: Curve
    index: int
    s: float
    rows: tuple[str, ...]

    @property
    def point(self) -> Array:
        """Task coordinates of the join, (m,); twelve for a pose."""
        return self.second.derivatives(np.zeros(1), 0)[0, 0]

    @property
    def shorter(self) -> float:
        """Length of the shorter of the two curves, sigma."""
        return min(self.first.length, self.second.length)

    def sides(self, distance: float = 0.0) -> tuple[Array, Array]:
        """Return the derivatives, (4, m), of both curves at a distance, in sigma, before and after the join."""
        before = self.first.derivatives(np.array([self.first.length - distance]))
        after = self.second.derivatives(np.array([distance]))
        return before[:, 0], after[:, 0]

    @property
    def positions(self) -> int:
        """Number of position rows among `rows`."""
        return len(position_rows(self.rows))

    @property
    def where(self) -> str:
        """Keys of both segments and the place of the join, for messages."""
        return f"path[{self.index}] to path[{self.index + 1}], at s = {self.s:.4g}, {place(self.rows, self.point)}"

    @property
    def blend_key(self) -> str:
        """Key of the blend that rounds the corner."""
        return f"path[{self.index}].blend"

    @property
    def rounding(self) -> str:
        """Setting that rounds the corner, if a blend can do so, or that makes the tool stop there."""
        before, after = (side[1, : self.positions] for side in self.sides())
        if angle_between(before, after) > _SHARPEST:
            return self.stopping
        return f"{self.blend_key} ({self.unit}) to round it, or {self.stopping}"

    @property
    def stopping(self) -> str:
        """Setting that makes the tool stop at the corner."""
        return f"path[{self.index}].stop: true to stop there"

    @property
    def unit(self) -> str:
        """Unit of lengths along the path."""
        return "rad, m" if joints_of(self.rows) else "m"

    def wrong_blend(
        self, problem: str, found: str, allowed: str, hint: str | None
    ) -> PathError:
        """Return the error for a corner that cannot be rounded."""
        return PathError(
            problem,
            s_interval=(self.s, self.s),
            found=found,
            allowed=allowed,
            where=f"{self.blend_key}: {self.where}",
            hint=hint,
        )


class Kink(NamedTuple):
    """A join where consecutive curves do not match, with the jump in words, and advice."""

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


def row_corner(join: Join) -> Kink | None:
    """Return the kink between two curves of rows, or None if the first three derivatives are continuous."""
    jump = _mismatch(join, *join.sides())
    return Kink(join, jump, f"Set {join.rounding}") if jump else None


def _mismatch(join: Join, before: Array, after: Array) -> str | None:
    """Describe the jump between derivatives, (4, m), or return None if the first three derivatives are continuous."""
    # The k-th derivative times length^(k - 1) is comparable with the speed, which is about 1.
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
        speed, new_speed = (
            np.linalg.norm(derivatives[1]) for derivatives in (before, after)
        )
        # The parameter's speed may change where splines join; rounding of the tangent's direction is then not
        # mentioned.
        if corner > 0.01 * abs(new_speed - speed):
            moved = np.linalg.norm((after - before)[1, : join.positions])
            alone = "" if moved > tolerances.WRITTEN else f" in {join.rows[-1]} alone"
            return f"a corner of {np.rad2deg(corner):.4g} degrees{alone}"
        return f"the parameter's speed changing from {speed:.6g} to {new_speed:.6g}"
    if jumps[2] > tolerances.WRITTEN:
        return f"a curvature jump of {np.linalg.norm(after[2] - before[2]):.4g} 1/m"
    return f"a jump of {np.linalg.norm(after[3] - before[3]):.4g} 1/m^2 in the third derivative"


def refuse_corners(corners: Sequence[Kink | None]) -> None:
    """Raise a `PathError` for the first corner, and name the others in it; do nothing if there are no corners."""
    refused = [corner for corner in corners if corner is not None]
    if not refused:
        return
    join, jump, advice = refused[0]
    further_keys = ", ".join(f"path[{later.index}]" for later, *_ in refused[1:])
    raise PathError(
        "the path must be smooth to the third derivative",
        s_interval=(join.s, join.s),
        found=jump,
        allowed="consecutive segments that match up to the third derivative",
        where=join.where,
        hint=advice + (f"; likewise {further_keys}" if further_keys else ""),
    )


def angle_between(first: Array, second: Array) -> float:
    """Return the angle between two vectors; accurate for small angles as well."""
    a = first * np.linalg.norm(second)
    b = second * np.linalg.norm(first)
    return float(2 * np.arctan2(np.linalg.norm(a - b), np.linalg.norm(a + b)))


def pose_corner(join: Join) -> Kink | None:
    """Return the kink between two curves of poses, or None if the first three derivatives are continuous."""
    on_the_spot = [
        stands_still(curve, join.positions) for curve in (join.first, join.second)
    ]
    if on_the_spot[0] != on_the_spot[1]:
        return Kink(
            join,
            "a stop: the position moves on one side, and the tool turns on the spot on the other",
            f"Turn the tool along a segment, by its orientation, or set {join.stopping}",
        )
    before, after = join.sides()
    jump = _mismatch(join, before[:, : join.positions], after[:, : join.positions])
    if jump:
        return Kink(join, jump, f"Set {join.rounding}")
    unit = "rad" if on_the_spot[0] else "m"
    jump = _turning_mismatch(join, before, after, unit)
    otherwise = join.stopping if on_the_spot[0] else join.rounding
    advice = f"Set profile: smooth where the tool turns, or {otherwise}"
    return Kink(join, jump, advice) if jump else None


def _turning_mismatch(join: Join, before: Array, after: Array, unit: str) -> str | None:
    """Describe the jump in the rotation of the tool, or return None if the first three derivatives are continuous.

    Parameters
    ----------
    join : Join
    before, after : ndarray, shape (4, c)
        Derivatives of the coordinates of the pose with respect to sigma at the join.
    unit : str
        Unit of the curves' parameter sigma.
    """
    old, new = (angular_rates(derivatives) for derivatives in (before, after))
    jumps = np.linalg.norm(new - old, axis=1)
    allowed = tolerances.WRITTEN * max(float(np.linalg.norm(old[0])), 1.0)
    large = np.flatnonzero(jumps * join.shorter ** np.arange(3.0) > allowed)
    if not large.size:
        return None
    k = int(large[0])
    what = ("", "'s slope", "'s second derivative")[k]
    jump = f"{jumps[k]:.4g} rad/{unit}^{k + 1}".removesuffix("^1")
    return f"the tool's turning rate{what} jumps by {jump}"


def blend_rows(join: Join, size: float) -> Curve:
    """Return the blend that replaces the last `size` of one curve and the first `size` of the next one.

    Parameters
    ----------
    join : Join
        Join where the curves meet.
    size : float
        Range of sigma that is replaced on each side, m.

    Raises
    ------
    PathError
        The blend is longer than half of a neighbouring segment, the tool would almost stop or reverse in it, or only an
        angle moves.
    """
    _check_neighbours(join, size)
    return _blend(join, *join.sides(size))


def blend_poses(join: Join, size: float) -> Curve:
    """Return the blend that replaces the last `size` of one curve of poses and the first `size` of the next.

    The blend is a polynomial of the position and the quaternion; the quaternion is then normalised. See `blend_rows`.

    Raises
    ------
    PathError
        As for `blend_rows`; or the tool turns too much in the blend.
    """
    _check_neighbours(join, size)
    start, end = map(_with_quaternion, join.sides(size))
    end[:, -4:] *= _sign(join, size)
    columns = _blend(join, start, end)
    _, least = least_quality(columns)
    if least < LEAST_QUALITY:
        raise join.wrong_blend(
            "the tool turns too much in the blend",
            f"quaternions interpolated with a quality of {least:.2g} out of 1",
            f"{LEAST_QUALITY} or more",
            "Shorten the blend, or turn the tool along longer segments",
        )
    return quaternion_curve(columns)


def _check_neighbours(join: Join, size: float) -> None:
    """Reject a blend that is too long, or that is next to a curve on which the position stands still.

    Raises
    ------
    PathError
    """
    stated_size = f"{size:g} {join.unit}"
    if any(stands_still(curve, join.positions) for curve in (join.first, join.second)):
        raise join.wrong_blend(
            "a blend needs motion of the position on both sides, but on one side the tool turns on the spot",
            stated_size,
            "no blend here",
            "Turn the tool along a line, or stop at the corner, with stop: true instead of the blend",
        )
    longest = join.shorter / 2 * (1.0 + tolerances.ROUNDING)
    if size > longest:
        raise join.wrong_blend(
            "the blend is longer than half of a neighbouring segment",
            stated_size,
            # Rounded down to micrometres, so that the blend named in the message is accepted.
            f"at most {floor(longest * 1e6) / 1e6:.10g} {join.unit}",
            position_hint(size, 0.0, longest, join.unit),
        )


def _blend(join: Join, start: Array, end: Array) -> SplineCurve:
    """Return the septic polynomial between derivatives, (4, m), after a check that the position does not stop.

    The length of the blend is the mean of the chord and of the polygon over the corner. This length keeps the speed
    close to 1.

    Raises
    ------
    PathError
    """
    rows = join.positions
    corners = [start[0, :rows], join.point[:rows], end[0, :rows]]
    before, chord, after = (
        float(np.linalg.norm(begin - finish))
        for begin, finish in combinations(corners, 2)
    )
    curve = septic(start, end, (chord + (before + after)) / 2)
    velocity = curve.derivatives(np.linspace(0.0, curve.length, 201), 1)[1]
    speed = np.linalg.norm(velocity[:, :rows], axis=1).min()
    slowest = 0.2  # the speed is 1 on a line
    if not speed > slowest:
        raise join.wrong_blend(
            "the corner is too sharp for a blend: the tool would almost stop and reverse",
            f"a smallest speed of {speed:.3g} relative to the segments",
            f"more than {slowest}",
            "Divide the corner into two, or use an arc; or stop at the corner, with stop: true instead of the blend",
        )
    return curve


def _with_quaternion(pose: Array) -> Array:
    """Return the derivatives of position and quaternion, (4, p + 4), from those of a pose, (4, p + 9)."""
    return np.concatenate([pose[:, :-9], quaternion_derivatives(pose)], axis=1)


def _sign(join: Join, size: float) -> float:
    """Return the sign that makes the quaternion at the end continue the one at the start along both curves."""
    steps = np.linspace(0.0, size, 9)
    poses = [
        join.first.derivatives(join.first.length - size + steps, 0)[0],
        join.second.derivatives(steps, 0)[0],
    ]
    quaternions = quaternions_of(rotation_of(rotations(np.concatenate(poses))))
    return float(np.sign(with_like_signs(quaternions)[-1] @ quaternions[-1]))
