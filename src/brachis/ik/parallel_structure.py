"""What the six joints around three parallel axes are to each other; see `parallel_axes` for the formulas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.arrays import cross
from brachis.ik.arm import Arm
from brachis.ik.factored_solver import Structure
from brachis.ik.factors import Factor
from brachis.ik.geometry import PosedScrews
from brachis.ik.pose_joints import PoseJoints
from brachis.ik.protocol import NotApplicableError
from brachis.ik.screws import Screw
from brachis.ik.vectors import dot, meeting_point

_LAST_FIRST = {1: 4, 2: 5}
"""Joints before the parallel ones, and the place of the first joint after them."""


@dataclass(frozen=True)
class ParallelStructure(Structure):
    """Roles of six joints, as places in their order.

    Attributes
    ----------
    joints
        See `Structure`.
    first : int
        Place of the first parallel joint, b; c and d follow it.
    turn, slide : int or None
        The revolute and the prismatic joint before them, a and p.
    """

    first: int
    turn: int | None
    slide: int | None

    @classmethod
    def of(cls, six: PoseJoints) -> ParallelStructure:
        """Find the roles, from the base to the tool or the other way round.

        Raises
        ------
        NotApplicableError
            The joints have not this structure; says what is missing.
        """
        triples = [first for first in range(4) if six.parallel(first, first + 1, first + 2)]
        if not triples:
            raise NotApplicableError("no three successive joints have parallel axes")
        found = [structure for order in (six, six.reversed()) for structure in _arrangements(order)]
        if found:
            return found[0]
        names = ", ".join(six.names[triples[0] : triples[0] + 3])
        raise NotApplicableError(
            f"{names} are parallel, but the others are neither one joint before and two after whose axes meet, "
            "nor a slide and a revolute joint before and one after, in this or the reverse order"
        )

    @property
    def factors(self) -> tuple[Factor, ...]:
        """See `Structure.factors`; of the alternatives shoulder, elbow, wrist, or of elbow, wrist, rail."""
        elbow = Factor(self._elbow, "the axes of two of {b}, {c}, {d} coincide", ("up", "down"))
        wrist = Factor(self._wrist, "the axes of {x}, {f}, {b} always are parallel to one plane", ("noflip", "flip"))
        if self.slide is None:
            way = "{a} does not move the point where the axes of {x} and {f} meet along the parallel axes"
            return Factor(self._shoulder, way, ("front", "back")), elbow, wrist
        rail = Factor(self._rail, "{p} never moves the arm along the parallel axes", ("left", "right"), (self.slide,))
        return elbow, wrist, rail

    @property
    def parallel(self) -> tuple[int, int, int]:
        """Places of b, c and d."""
        return self.first, self.first + 1, self.first + 2

    @property
    def elbow(self) -> int:
        """Slot of the elbow; that of the wrist follows."""
        return int(self.slide is None)

    @property
    def beside(self) -> int:
        """Place of the joint that spans the wrist's factor with the last one: e, or a where there is none."""
        return 4 if self.first == 1 or self.turn is None else self.turn

    def words(self) -> dict[str, str]:
        """See `Structure.words`; x is e or a."""
        places = {"a": self.turn, "p": self.slide, "f": 5, "x": self.beside}
        places |= zip("bcd", self.parallel, strict=True)
        return {letter: self.joints.names[place] for letter, place in places.items() if place is not None}

    def posed(self, posed: PosedScrews) -> Arm:
        """See `Structure.posed`."""
        return self.arm(self.joints.screws(posed))

    def arm(self, screws: tuple[Screw, ...]) -> Arm:
        """Put in P, as the centre."""
        e, f = screws[4:]
        centre = meeting_point(e.axis, e.point, f.axis, f.point) if self.first == 1 else f.point
        return Arm(screws, centre, centre)

    def _shoulder(self, arm: Arm) -> np.ndarray:
        """Velocity that a gives P along the parallel axes."""
        return dot(arm.screws[self.first].axis, arm.screws[self.turn or 0].velocity(arm.centre))

    def _elbow(self, arm: Arm) -> np.ndarray:
        """Velocity that c gives the axis of d away from that of b, times its distance."""
        b, c, d = (arm.screws[place] for place in self.parallel)
        return dot(d.point - b.point, c.velocity(d.point))

    def _wrist(self, arm: Arm) -> np.ndarray:
        """Volume spanned by two axes and n."""
        return dot(cross(arm.screws[self.beside].axis, arm.screws[5].axis), arm.screws[self.first].axis)

    def _rail(self, arm: Arm) -> np.ndarray:
        """Velocity that p gives the arm along the parallel axes."""
        return dot(arm.screws[self.first].axis, arm.screws[self.slide or 0].axis)


def _arrangements(six: PoseJoints) -> list[ParallelStructure]:
    """All ways to see the structure in one order of the joints."""
    structures = []
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
        structures.append(ParallelStructure(six, first, turn, slide))
    return structures
