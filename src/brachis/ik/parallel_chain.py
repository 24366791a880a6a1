"""What the six joints around three parallel axes are to each other; see `parallel_axes` for the formulas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.arrays import cross
from brachis.ik.geometry import PosedScrews
from brachis.ik.pose_joints import PoseJoints
from brachis.ik.protocol import NotApplicableError
from brachis.ik.vectors import dot, meeting_point

_LAST_FIRST = {1: 4, 2: 5}
"""Joints before the parallel ones, and the place of the first joint after them."""


@dataclass(frozen=True)
class ParallelChain:
    """Roles of six joints, as places in their order, which is from the tool to the base if they are mirrored.

    Attributes
    ----------
    joints : tuple of int
        Places of the six in the robot's chain.
    names : tuple of str
    mirrored : bool
    first : int
        Place of the first parallel joint, b; c and d follow it.
    turn, slide : int or None
        The revolute and the prismatic joint before them, a and p.
    """

    joints: tuple[int, ...]
    names: tuple[str, ...]
    mirrored: bool
    first: int
    turn: int | None
    slide: int | None

    @classmethod
    def of(cls, six: PoseJoints) -> ParallelChain:
        """Find the roles.

        Raises
        ------
        NotApplicableError
            The joints have not this structure; says what is missing.
        """
        triples = [first for first in range(4) if six.parallel(first, first + 1, first + 2)]
        if not triples:
            raise NotApplicableError("no three successive joints have parallel axes")
        found = [chain for order in (six, six.reversed()) for chain in _arrangements(order)]
        if found:
            return found[0]
        names = ", ".join(six.names[triples[0] : triples[0] + 3])
        raise NotApplicableError(
            f"{names} are parallel, but the others are neither one joint before and two after whose axes meet, "
            "nor a slide and a revolute joint before and one after, in this or the reverse order"
        )

    @property
    def after(self) -> tuple[int, ...]:
        """Places of the joints after the parallel ones: e and f, or w."""
        return tuple(range(self.first + 3, 6))

    @property
    def slide_name(self) -> str:
        """Name of the prismatic joint p."""
        return "" if self.slide is None else self.names[self.slide]

    @property
    def slide_first(self) -> bool:
        """Whether a turning of a moves the slide's direction against the parallel axes: not if p comes after a."""
        return self.turn is not None and self.slide is not None and self.slide < self.turn

    def factors(self, posed: PosedScrews) -> dict[str, np.ndarray]:
        """Compute the factors (K,) of det J_nr by their names; analytic."""
        places = list(self.joints)
        axes = -posed.axes[:, places] if self.mirrored else posed.axes[:, places]
        points = posed.points[:, places]
        b, c, d = range(self.first, self.first + 3)
        n, one, two = axes[:, b], self.first + 3, 5
        parts: dict[str, np.ndarray] = {}
        if self.turn is not None and self.slide is None:
            meeting = meeting_point(axes[:, one], points[:, one], axes[:, two], points[:, two])
            parts["shoulder"] = dot(n, cross(axes[:, self.turn], meeting - points[:, self.turn]))
        parts["elbow"] = dot(points[:, d] - points[:, b], cross(axes[:, c], points[:, d] - points[:, c]))
        start = self.turn if one == two and self.turn is not None else one
        parts["wrist"] = dot(cross(axes[:, start], axes[:, two]), n)
        if self.slide is not None:
            parts["rail"] = dot(n, axes[:, self.slide])
        return parts


def _arrangements(six: PoseJoints) -> list[ParallelChain]:
    """All ways to see the structure in one order of the joints."""
    chains = []
    for first, one_after in _LAST_FIRST.items():
        before, after = range(first), range(one_after, 6)
        turns = [place for place in before if six.revolute[place]]
        slides = [place for place in before if not six.revolute[place]]
        if not six.parallel(first, first + 1, first + 2) or not six.revolute[list(after)].all():
            continue
        if first == 1 and not six.meet(4, 5):
            continue
        if first == 2 and len(turns) != 1:  # noqa: PLR2004
            continue
        turn, slide = turns[0] if turns else None, slides[0] if slides else None
        chains.append(ParallelChain(six.joints, six.names, six.mirrored, first, turn, slide))
    return chains
