"""The joints for which a closed form solves: the relations between their axes, and the points that they place.

The motion of two neighbouring joints does not change how their axes are related (parallel, meeting, perpendicular).
Redundant joints between them may change this relation. A relation is therefore accepted only if it holds at several
random positions of the redundant joints; the closed forms then treat the relation as exact.
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
    """A point that is fixed on the axis of a joint.

    Attributes
    ----------
    joint : int
        Index of the joint.
    offset : float
        Distance along the axis from the point of the joint's screw, m.
    """

    joint: int
    offset: float

    def at(self, screws: Sequence[Screw]) -> np.ndarray:
        """Return the position of the point, (3, ...)."""
        return screws[self.joint].point + screws[self.joint].axis * self.offset


@dataclass(frozen=True)
class RemainingJoints:
    """The J non-redundant joints, with their axes at S random positions of the redundant ones.

    Attributes
    ----------
    names : tuple of str
    joints : tuple of int
        Indices of these joints in the chain.
    revolute : (J,) bool ndarray
    axes, points : (3, J, S) ndarray
        As in `PosedScrews`, with these joints at zero.
    mirrored : bool
        Whether the joints are listed from the tool to the base.
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
        """Return the remaining joints, with the redundant joints at random positions.

        Raises
        ------
        NotApplicableError
            The number of remaining joints is not `count`.
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
        """Return the six remaining joints for a pose; raise NotApplicableError for a different task space or count."""
        if not isinstance(task_map, Pose):
            raise NotApplicableError("this family solves only for poses")
        return cls.of(geometry, redundant, 6)

    def reverse(self) -> RemainingJoints:
        """List the same joints in the reverse order, as seen from the tool, with reversed axes.

        The joint positions do not change.
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
        """Select these joints, in their order and sense, from the screws of a chain in K postures.

        Vectors are (3, ..., K), with `alternatives` axes of length one before the samples.
        """
        picked = screws.pick(self.joints, alternatives)
        return tuple(screw.inverse for screw in picked) if self.mirrored else picked

    def are_parallel(self, first: int, *compared: int) -> bool:
        """Tell whether the axes of joints, revolute or prismatic, are always parallel."""
        sines = cross(self.axes[:, [first]], self.axes[:, compared])
        return bool(np.abs(sines).max() < tolerances.LENGTH)

    def are_perpendicular(self, i: int, j: int) -> bool:
        """Tell whether the axes of two joints, revolute or prismatic, are always perpendicular."""
        return bool(
            np.abs(dot(self.axes[:, i], self.axes[:, j])).max() < tolerances.LENGTH
        )

    def miss(self, *places: int) -> float:
        """Return the largest distance of revolute axes from the point where the first two come closest, m."""
        gaps = across(
            self.axes[:, places],
            self._nearest(*places[:2])[:, None] - self.points[:, places],
        )
        return float(np.sqrt(dot(gaps, gaps).max()))

    def meeting(self, *places: int) -> Anchor | None:
        """Return the point where axes of joints always meet; None if there is none, or if it moves along all axes.

        If two axes coincide, it is any point on them.
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
        """Return the point, (3, S), on the axis of i closest to the axis of j; any point if the axes are parallel."""
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
    """Screws of the joints, at zero or in postures.

    Attributes
    ----------
    screws : tuple of Screw
        Joints a, b, c, which place a point; then the joints u, v, w of a wrist that turns about this point, if there is
        one. For three parallel axes, all joints in their order.
    centre : (3, ...) ndarray
        The point that is placed, m: the centre of the wrist, the tool, or a point that the joints after the parallel
        axes do not move.
    meeting : (3, ...) ndarray
        Point where the axes of two of the joints a, b, c meet, m; equal to `centre` if it is not used.
    """

    screws: tuple[Screw, ...]
    centre: np.ndarray
    meeting: np.ndarray

    @property
    def base(self) -> tuple[Screw, Screw, Screw]:
        """Joints a, b, c."""
        return self.screws[0], self.screws[1], self.screws[2]
