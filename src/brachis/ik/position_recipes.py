"""Which recipe of `placing` fits three joints, what its branches are called, and what it means if none fits.

Words follow the senses of the joint axes. On an industrial arm whose axes 1, 2, 3 are z, y, y, and with these three
joints left over to place a point (the wrist's centre, or the tool): ``front`` where it is on the side to which joint 1
faces, ``up`` where joint 3 bends forwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from brachis.ik import placing
from brachis.ik.arm import Anchor, Arm, aligned, meeting, perpendicular
from brachis.ik.factors import Factor
from brachis.ik.protocol import NotApplicableError
from brachis.ik.remaining_joints import RemainingJoints


@dataclass(frozen=True)
class Recipe:
    """A way to solve for three joints.

    Attributes
    ----------
    fits : callable
        Whether it applies to joints.
    meets : tuple of int or None
        Two joints whose axes meet in `Arm.meeting`.
    solve : callable
        Positions of a, b, c, with one or two answers along the alternatives `FRONT` and `UP`, from the screws while the
        joints are at zero and the target of their centre; NaN where there is none.
    factors : tuple of Factor
        Of these two alternatives.
    """

    fits: Callable[[RemainingJoints], bool]
    meets: tuple[int, int] | None
    solve: Callable[[Arm, np.ndarray], placing.Values]
    factors: tuple[Factor, Factor]


def coplanar(joints: RemainingJoints, i: int, j: int) -> bool:
    """Whether two joints move positions in planes of one and the same direction."""
    if joints.revolute[i] and joints.revolute[j]:
        return aligned(joints, i, j)
    if joints.revolute[i] or joints.revolute[j]:
        return perpendicular(joints, i, j)
    return not aligned(joints, i, j)


def meet(joints: RemainingJoints, i: int, j: int) -> bool:
    """Whether the axes of two joints meet in a fixed point of one of them."""
    return meeting(joints, i, j) is not None


def on_cylinder(joints: RemainingJoints) -> bool:
    """Whether the first joint slides along the second's axis, and the third's is perpendicular to it."""
    return joints.revolute[:3].tolist() == [False, True, True] and aligned(joints, 0, 1) and perpendicular(joints, 1, 2)


_FRONT, _UP = ("front", "back"), ("up", "down")
_OUT = "does not move {point} out of the plane in which"
_AWAY = "does not change the distance between {point} and the point where the axes of"

RECIPES = (
    Recipe(
        partial(coplanar, i=1, j=2),
        None,
        placing.plane_of_last,
        (
            Factor(placing.out_of_last_factor, f"{{a}} {_OUT} {{b}} and {{c}} do", _FRONT, (0,)),
            Factor(placing.within_last_factor, "{b} and {c} move {point} along one line", _UP, (1, 2)),
        ),
    ),
    Recipe(
        partial(coplanar, i=0, j=1),
        None,
        placing.plane_of_first,
        (
            Factor(placing.within_first_factor, "{a} and {b} move {point} along one line", _FRONT, (0, 1)),
            Factor(placing.out_of_first_factor, f"{{c}} {_OUT} {{a}} and {{b}} do", _UP, (2,)),
        ),
    ),
    Recipe(
        partial(meet, i=0, j=1),
        (0, 1),
        placing.meeting_of_first,
        (
            Factor(placing.along_first_factor, "{b} does not move {point} along the axis of {a}", _FRONT),
            Factor(placing.approach_of_last_factor, f"{{c}} {_AWAY} {{a}} and {{b}} meet", _UP),
        ),
    ),
    Recipe(
        partial(meet, i=1, j=2),
        (1, 2),
        placing.meeting_of_last,
        (
            Factor(placing.along_second_factor, "{c} does not move {point} along the axis of {b}", _FRONT),
            Factor(placing.approach_of_first_factor, f"{{a}} {_AWAY} {{b}} and {{c}} meet", _UP),
        ),
    ),
    Recipe(
        on_cylinder,
        None,
        placing.cylinder,
        (
            Factor(placing.in_front_factor, "{a} and {b} do not move {point} along the axis of {c}", _FRONT),
            Factor(placing.to_front_factor, f"{{c}} {_OUT} {{a}} and {{b}} do", _UP),
        ),
    ),
)


def recipe_for(joints: RemainingJoints, point: str) -> tuple[Recipe, Anchor | None]:
    """Find the recipe by which the first three joints place a point, and where two of their axes meet if it matters.

    Raises
    ------
    NotApplicableError
        None fits; says how the three lie to each other.
    """
    for recipe in RECIPES:
        if recipe.fits(joints):
            return recipe, meeting(joints, *recipe.meets) if recipe.meets else None
    relations = f"{_relation(joints, 0, 1)}, and {_relation(joints, 1, 2)}"
    raise NotApplicableError(f"no closed form moves {point} by {', '.join(joints.names[:3])}: {relations}")


def _relation(joints: RemainingJoints, i: int, j: int) -> str:
    """How two neighbours lie to each other."""
    first, second = joints.names[i], joints.names[j]
    if joints.revolute[i] and joints.revolute[j]:
        if aligned(joints, i, j):
            return f"the axes of {first} and {second} are parallel"
        apart = "are not parallel and do not meet in a fixed point of one of them"
        return f"the axes of {first} and {second} {'meet' if meet(joints, i, j) else apart}"
    manner = "along" if aligned(joints, i, j) else "across" if perpendicular(joints, i, j) else "at an angle to"
    if joints.revolute[i]:
        first, second = second, first
    return f"{first} slides {manner} the {'axis' if joints.revolute[[i, j]].any() else 'direction'} of {second}"
