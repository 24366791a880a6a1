"""Three joints that place a point, and the three of a wrist that turn about it: how they lie to each other.

Joints that are left over for the task, with their axes at random positions of the redundant ones.

What two of them are to each other (parallel, meeting, at a right angle) no motion of theirs changes if they are
neighbours. Redundant joints between them may change it, so that a property counts as given if it holds within 1e-9
(rad, or m) at all of these positions; the closed forms then take it as exact.

Which of the six joints that are left over for a pose are parallel or meet, whatever the redundant ones do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from brachis.common.arrays import cross
from brachis.errors import write_count
from brachis.ik.protocol import NotApplicableError
from brachis.ik.screws import ChainGeometry, PosedScrews, Screw
from brachis.ik.vectors import across, dot
from brachis.robot import TaskMap
from brachis.robot.joints import complement
from brachis.robot.task_map import Pose

_SAMPLES = 8


@dataclass(frozen=True)
class RemainingJoints:
    """The J non-redundant joints, with their axes at S random positions of the redundant ones.

    Attributes
    ----------
    names : tuple of str
    joints : tuple of int
        Their places in the chain.
    revolute : (J,) bool ndarray
    axes, points : (3, J, S) ndarray
        As in `PosedScrews`, while they are at zero.
    mirrored : bool
        Whether they are listed from the tool to the base.
    """

    names: tuple[str, ...]
    joints: tuple[int, ...]
    revolute: np.ndarray
    axes: np.ndarray
    points: np.ndarray
    mirrored: bool = False

    @classmethod
    def beside(cls, geometry: ChainGeometry, redundant: tuple[int, ...]) -> Self:
        """Hold the redundant joints at random positions."""
        rest = tuple(complement(geometry.n, redundant))
        q_r = np.random.default_rng(0).uniform(
            -np.pi, np.pi, (_SAMPLES, len(redundant))
        )
        held = geometry.held(redundant, q_r)
        kept = list(rest)
        names = tuple(geometry.joint_names[i] for i in rest)
        return cls(
            names,
            rest,
            geometry.revolute[kept],
            held.axes[:, kept],
            held.points[:, kept],
        )

    def reversed(self) -> Self:
        """List the same joints in the reverse order: what they do seen from the tool, with their senses turned round.

        Their positions stay as they are.
        """
        return replace(
            self,
            names=self.names[::-1],
            joints=self.joints[::-1],
            revolute=self.revolute[::-1],
            axes=-self.axes[:, ::-1],
            points=self.points[:, ::-1],
            mirrored=not self.mirrored,
        )

    def screws(self, posed: PosedScrews, alternatives: int = 0) -> tuple[Screw, ...]:
        """Pick these joints, in their order and sense, out of a chain's K postures.

        Vectors are (3, ..., K), with so many axes of length one before the samples as there are `alternatives`.
        """
        axes = -posed.axes if self.mirrored else posed.axes
        spread = (slice(None), *[None] * alternatives)
        return tuple(
            Screw(
                axes[:, i][spread], posed.points[:, i][spread], bool(posed.revolute[i])
            )
            for i in self.joints
        )


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
        return replace(
            self, screws=(*self.screws[:joint], moved, *self.screws[joint + 1 :])
        )


def aligned(joints: RemainingJoints, i: int, j: int) -> bool:
    """Whether the directions of two joints, of whatever kind, are always parallel."""
    return bool(np.abs(cross(joints.axes[:, i], joints.axes[:, j])).max() < _TOLERANCE)


def perpendicular(joints: RemainingJoints, i: int, j: int) -> bool:
    """Whether the directions of two joints, of whatever kind, are always at a right angle."""
    return bool(np.abs(dot(joints.axes[:, i], joints.axes[:, j])).max() < _TOLERANCE)


def miss(joints: RemainingJoints, *places: int) -> float:
    """Largest distance of the axes of revolute joints from the point where the first two come nearest, m."""
    gaps = across(
        joints.axes[:, places],
        _nearest(joints, *places[:2])[:, None] - joints.points[:, places],
    )
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
    first = joints.axes[:, i]
    second = joints.axes[:, j]
    normal = cross(first, second)
    size = dot(normal, normal)
    along = dot(cross(joints.points[:, j] - joints.points[:, i], second), normal)
    return joints.points[:, i] + first * (
        along / np.where(size < _TOLERANCE**2, np.inf, size)
    )


_JOINTS = 6
_POSTURES = 256
_TOLERANCE_POSE_JOINTS = 1e-9
_SINGULAR = 1e-9


@dataclass(frozen=True)
class PoseJoints(RemainingJoints):
    """The six non-redundant joints of a pose; see `RemainingJoints`."""

    @classmethod
    def of(
        cls, geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
    ) -> PoseJoints:
        """Hold the redundant joints at random positions.

        Raises
        ------
        NotApplicableError
            No pose is prescribed, or other than six joints are left over.
        """
        if not isinstance(task_map, Pose):
            raise NotApplicableError("only for poses")
        if geometry.n - len(redundant) != _JOINTS:
            raise NotApplicableError(
                f"{write_count(geometry.n - len(redundant), 'joint')} would be left over, not six"
            )
        return cls.beside(geometry, redundant)

    def parallel(self, *places: int) -> bool:
        """Whether joints are revolute and all their axes parallel."""
        first = self.axes[:, places[0]]
        sines = [
            np.abs(cross(first, self.axes[:, place])).max() for place in places[1:]
        ]
        return (
            bool(self.revolute[list(places)].all())
            and max(sines) < _TOLERANCE_POSE_JOINTS
        )

    def meet(self, first: int, second: int) -> bool:
        """Whether two joints are revolute and their axes meet in one point."""
        return meeting(self, first, second) is not None and not aligned(
            self, first, second
        )


def random_postures(geometry: ChainGeometry) -> PosedScrews:
    """Screws at random postures, by which branch margins are made dimensionless."""
    return geometry.posed(
        np.random.default_rng(1).uniform(-np.pi, np.pi, (_POSTURES, geometry.n))
    )


def determinant(posed: PosedScrews, joints: Sequence[int]) -> np.ndarray:
    """Det J_nr (K,) of six joints for a pose, or of three for a position; real or complex, and analytic."""
    return np.linalg.det(
        np.moveaxis(posed.jacobian_columns(joints)[: len(joints)], 2, 0)
    )


def largest_determinant(posed: PosedScrews, joints: Sequence[int]) -> float:
    """Largest size of det J_nr.

    Raises
    ------
    NotApplicableError
        J_nr is singular in all postures.
    """
    scale = float(np.abs(determinant(posed, joints)).max())
    if scale < _SINGULAR:
        raise NotApplicableError("J_nr is singular everywhere")
    return scale
