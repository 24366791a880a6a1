"""The joints that a closed form solves for: how their axes lie to each other, and where they place a point.

What two neighbours are to each other (parallel, meeting, at a right angle) no motion of theirs changes. Redundant
joints between them may change it, so that a property counts as given if it holds at several random positions of these;
the closed forms then take it as exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import cross
from brachis.common.words import write_count
from brachis.ik.protocol import NotApplicableError
from brachis.ik.screws import ChainGeometry, PosedScrews, Screw
from brachis.ik.vectors import across, dot
from brachis.robot import TaskMap
from brachis.robot.joints import complement
from brachis.robot.task_map import Pose


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
    def of(
        cls, geometry: ChainGeometry, redundant: tuple[int, ...], count: int
    ) -> RemainingJoints:
        """Hold the redundant joints at random positions.

        Raises
        ------
        NotApplicableError
            Another number of joints than `count` is left over.
        """
        non_redundant = complement(geometry.n, redundant)
        if len(non_redundant) != count:
            raise NotApplicableError(
                f"{write_count(len(non_redundant), 'joint')} left to solve for, not {count}"
            )
        q_r = np.random.default_rng(0).uniform(-np.pi, np.pi, (8, len(redundant)))
        screws = geometry.screws_with(redundant, q_r)
        return cls(
            tuple(geometry.joint_names[i] for i in non_redundant),
            tuple(non_redundant),
            geometry.revolute[non_redundant],
            screws.axes[:, non_redundant],
            screws.points[:, non_redundant],
        )

    @classmethod
    def of_pose(
        cls, geometry: ChainGeometry, task_map: TaskMap, redundant: tuple[int, ...]
    ) -> RemainingJoints:
        """Take the six joints that are left over for a pose; raises NotApplicableError for other tasks or counts."""
        if not isinstance(task_map, Pose):
            raise NotApplicableError("this family solves only poses")
        return cls.of(geometry, redundant, 6)

    def reverse(self) -> RemainingJoints:
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

    def screws(self, screws: PosedScrews, alternatives: int = 0) -> tuple[Screw, ...]:
        """Pick these joints, in their order and sense, out of a chain's K postures.

        Vectors are (3, ..., K), with so many axes of length one before the samples as there are `alternatives`.
        """
        picked = screws.pick(self.joints, alternatives)
        return tuple(screw.inverse for screw in picked) if self.mirrored else picked

    def are_parallel(self, first: int, *compared: int) -> bool:
        """Whether the directions of joints, of whatever kind, are always parallel."""
        sines = cross(self.axes[:, [first]], self.axes[:, compared])
        return bool(np.abs(sines).max() < tolerances.LENGTH)

    def are_perpendicular(self, i: int, j: int) -> bool:
        """Whether the directions of two joints, of whatever kind, are always at a right angle."""
        return bool(
            np.abs(dot(self.axes[:, i], self.axes[:, j])).max() < tolerances.LENGTH
        )

    def miss(self, *places: int) -> float:
        """Largest distance of the axes of revolute joints from the point where the first two come nearest, m."""
        gaps = across(
            self.axes[:, places],
            self._nearest(*places[:2])[:, None] - self.points[:, places],
        )
        return float(np.sqrt(dot(gaps, gaps).max()))

    def meeting(self, *places: int) -> Anchor | None:
        """Point in which the axes of joints always meet; None without one, or if it moves along all of them.

        Of two axes that coincide it is any point.
        """
        if (
            not self.revolute[list(places)].all()
            or self.miss(*places) > tolerances.LENGTH
        ):
            return None
        point = self._nearest(*places[:2])
        for place in places:
            offsets = dot(self.axes[:, place], point - self.points[:, place])
            if np.ptp(offsets) < tolerances.LENGTH:
                return Anchor(place, float(offsets.mean()))
        return None

    def _nearest(self, i: int, j: int) -> np.ndarray:
        """Point (3, S) on the axis of i that is nearest to that of j; any one where they are parallel."""
        first = self.axes[:, i]
        second = self.axes[:, j]
        normal = cross(first, second)
        size = dot(normal, normal)
        along = dot(cross(self.points[:, j] - self.points[:, i], second), normal)
        return self.points[:, i] + first * (
            along / np.where(size < tolerances.LENGTH**2, np.inf, size)
        )


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
