"""Three joints that place a point, and the three of a wrist that turn about it: how they lie to each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from brachis.arrays import cross
from brachis.ik.remaining_joints import RemainingJoints
from brachis.ik.screws import Screw
from brachis.ik.vectors import across, dot

_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Anchor:
    """A point that stays at its place on the axis of a joint.

    Attributes
    ----------
    joint : int
        Which of the joints.
    offset : float
        How far along the axis from the joint's own point, m.
    """

    joint: int
    offset: float

    def at(self, screws: Sequence[Screw]) -> np.ndarray:
        """Return its position (3, ...)."""
        return screws[self.joint].point + screws[self.joint].axis * self.offset


@dataclass(frozen=True)
class Arm:
    """Screws of the joints, while they are at zero or at postures.

    Attributes
    ----------
    screws : tuple of Screw
        Joints a, b, c, which place a point; then those of the wrist that turns about it, u, v, w, where there is one.
        Around three parallel axes in their order.
    centre : (3, ...) ndarray
        This point, m: the wrist's centre, or the tool; or one that the joints after parallel axes leave in place.
    meeting : (3, ...) ndarray
        Where the axes of two of a, b, c meet, m; the centre where no use is made of it.
    """

    screws: tuple[Screw, ...]
    centre: np.ndarray
    meeting: np.ndarray

    @property
    def base(self) -> tuple[Screw, Screw, Screw]:
        """Joints a, b, c."""
        return self.screws[0], self.screws[1], self.screws[2]

    @property
    def wrist(self) -> tuple[Screw, Screw, Screw]:
        """Joints u, v, w."""
        return self.screws[3], self.screws[4], self.screws[5]

    def with_axis(self, joint: int, axis: np.ndarray) -> Arm:
        """Turn the axis of one joint."""
        moved = replace(self.screws[joint], axis=axis)
        return replace(self, screws=(*self.screws[:joint], moved, *self.screws[joint + 1 :]))


def aligned(joints: RemainingJoints, i: int, j: int) -> bool:
    """Whether the directions of two joints, of whatever kind, are always parallel."""
    return bool(np.abs(cross(joints.axes[:, i], joints.axes[:, j])).max() < _TOLERANCE)


def perpendicular(joints: RemainingJoints, i: int, j: int) -> bool:
    """Whether the directions of two joints, of whatever kind, are always at a right angle."""
    return bool(np.abs(dot(joints.axes[:, i], joints.axes[:, j])).max() < _TOLERANCE)


def miss(joints: RemainingJoints, *places: int) -> float:
    """Largest distance of the axes of revolute joints from the point where the first two come nearest, m."""
    gaps = across(joints.axes[:, places], _nearest(joints, *places[:2])[:, None] - joints.points[:, places])
    return float(np.sqrt(dot(gaps, gaps).max()))


def meeting(joints: RemainingJoints, *places: int) -> Anchor | None:
    """Point in which the axes of joints always meet; None if there is none, or if it moves along all of them.

    Of two axes that coincide it is any point.
    """
    if not joints.revolute[list(places)].all() or miss(joints, *places) > _TOLERANCE:
        return None
    point = _nearest(joints, *places[:2])
    for place in places:
        offsets = dot(joints.axes[:, place], point - joints.points[:, place])
        if np.ptp(offsets) < _TOLERANCE:
            return Anchor(place, float(offsets.mean()))
    return None


def _nearest(joints: RemainingJoints, i: int, j: int) -> np.ndarray:
    """Point (3, S) on the axis of i that is nearest to that of j; any one where they are parallel."""
    first, second = joints.axes[:, i], joints.axes[:, j]
    normal = cross(first, second)
    size = dot(normal, normal)
    along = dot(cross(joints.points[:, j] - joints.points[:, i], second), normal)
    return joints.points[:, i] + first * (along / np.where(size < _TOLERANCE**2, np.inf, size))
