"""Joints that are left over for the task, with their axes at random positions of the redundant ones.

What two of them are to each other (parallel, meeting, at a right angle) no motion of theirs changes if they are
neighbours. Redundant joints between them may change it, so that a property counts as given if it holds within 1e-9
(rad, or m) at all of these positions; the closed forms then take it as exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from brachis.ik.geometry import ChainGeometry, PosedScrews
from brachis.ik.screws import Screw
from brachis.robot.joint_space import complement

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
        q_r = np.random.default_rng(0).uniform(-np.pi, np.pi, (_SAMPLES, len(redundant)))
        held, kept = geometry.held(redundant, q_r), list(rest)
        names = tuple(geometry.joint_names[i] for i in rest)
        return cls(names, rest, geometry.revolute[kept], held.axes[:, kept], held.points[:, kept])

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
            Screw(axes[:, i][spread], posed.points[:, i][spread], bool(posed.revolute[i])) for i in self.joints
        )
