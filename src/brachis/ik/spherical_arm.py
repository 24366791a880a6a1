"""Six joints of which the last three have axes that meet in a point: their screws, and how they lie to each other.

What neighbours among the six are to each other, no motion of the six changes. Redundant joints between them may change
it, so that a relation counts as given if it holds at all of the random positions in `PoseJoints`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.ik.pose_joints import PoseJoints
from brachis.ik.screws import Screw
from brachis.ik.vectors import across, cross, dot

_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Anchor:
    """A point that stays at its place on the axis of one of the six joints.

    Attributes
    ----------
    joint : int
        Which of the six.
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
    """Screws of the six joints, while they are at zero or at postures.

    Attributes
    ----------
    screws : tuple of Screw
        Joints a, b, c, which move the point where the axes of the others meet; then these others, u, v, w.
    centre : (3, ...) ndarray
        This point, m.
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


def aligned(six: PoseJoints, i: int, j: int) -> bool:
    """Whether the directions of two joints, of whatever kind, are always parallel."""
    return bool(np.abs(cross(six.axes[:, i], six.axes[:, j])).max() < _TOLERANCE)


def perpendicular(six: PoseJoints, i: int, j: int) -> bool:
    """Whether the directions of two joints, of whatever kind, are always at a right angle."""
    return bool(np.abs(dot(six.axes[:, i], six.axes[:, j])).max() < _TOLERANCE)


def miss(six: PoseJoints, *joints: int) -> float:
    """Largest distance of the axes of revolute joints from the point where the first two come nearest, m."""
    gaps = across(six.axes[:, joints], _nearest(six, *joints[:2])[:, None] - six.points[:, joints])
    return float(np.sqrt(dot(gaps, gaps).max()))


def meeting(six: PoseJoints, *joints: int) -> Anchor | None:
    """Point in which the axes of joints always meet; None if there is none, or if it moves along all of them.

    Of two axes that coincide it is any point.
    """
    if not six.revolute[list(joints)].all() or miss(six, *joints) > _TOLERANCE:
        return None
    point = _nearest(six, *joints[:2])
    for joint in joints:
        offsets = dot(six.axes[:, joint], point - six.points[:, joint])
        if np.ptp(offsets) < _TOLERANCE:
            return Anchor(joint, float(offsets.mean()))
    return None


def _nearest(six: PoseJoints, i: int, j: int) -> np.ndarray:
    """Point (3, S) on the axis of i that is nearest to that of j; any one where they are parallel."""
    first, second = six.axes[:, i], six.axes[:, j]
    normal = cross(first, second)
    size = dot(normal, normal)
    along = dot(cross(six.points[:, j] - six.points[:, i], second), normal)
    return six.points[:, i] + first * (along / np.where(size < _TOLERANCE**2, np.inf, size))
