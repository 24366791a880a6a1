"""The inverse kinematics of poses as one equation: six joints' motions E_1 ... E_6 make a known displacement D.

With redundant joints held at q_r and all others zero the tool is at M(q_r), and the target T asks for

    E_1(q_1) E_2(q_2) ... E_6(q_6) = D = T M(q_r)^-1,

where E_i turns about, or slides along, the screw axis of the i-th non-redundant joint as the held joints have placed
it. Redundant joints may stand anywhere in the chain: before, between and after the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.ik.screws import ChainGeometry, Screw
from brachis.ik.vectors import apply, apply_inverse
from brachis.robot.joints import complement


@dataclass(frozen=True)
class Displacement:
    """K equations E_1 ... E_6 = D; vectors have their components along the first axis (see `vectors`).

    Attributes
    ----------
    axes : (3, 6, K) ndarray
        Unit directions of rotation or translation.
    points : (3, 6, K) ndarray
        A point on each axis of rotation, m.
    revolute : (6,) bool ndarray
    rotation : (3, 3, K) ndarray
        Of D.
    translation : (3, K) ndarray
        Of D, m: D moves a point x to ``rotation x + translation``.
    """

    axes: np.ndarray
    points: np.ndarray
    revolute: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray

    @classmethod
    def of(
        cls,
        geometry: ChainGeometry,
        redundant: Sequence[int],
        targets: np.ndarray,
        q_r: np.ndarray,
        *,
        mirrored: bool = False,
    ) -> Displacement:
        """State the equations for pose targets, (K, 12), and redundant joints at q_r, (K, r), or the reversed ones."""
        held = geometry.held(redundant, q_r)
        rest = complement(geometry.n, redundant)
        wanted = np.moveaxis(targets[:, 3:].reshape(-1, 3, 3), 0, 2)
        rotation = np.stack(
            [apply(wanted, held.tool_rotation[row]) for row in range(3)], axis=1
        )
        translation = targets[:, :3].T - apply(rotation, held.tool_position)
        equation = cls(
            held.axes[:, rest],
            held.points[:, rest],
            geometry.revolute[rest],
            rotation,
            translation,
        )
        return equation.reversed() if mirrored else equation

    def reversed(self) -> Displacement:
        """Return the equations E_6^-1 ... E_1^-1 = D^-1: the same joint positions in the reverse order."""
        return Displacement(
            axes=-self.axes[:, ::-1],
            points=self.points[:, ::-1],
            revolute=self.revolute[::-1],
            rotation=np.swapaxes(self.rotation, 0, 1),
            translation=-apply_inverse(self.rotation, self.translation),
        )

    def screws(self) -> tuple[Screw, ...]:
        """Screws of the joints: (3, 1, 1, 1, K), with room for three alternatives."""
        axes, points = (
            array[:, :, None, None, None] for array in (self.axes, self.points)
        )
        return tuple(
            Screw(axes[:, i], points[:, i], bool(turns))
            for i, turns in enumerate(self.revolute)
        )
