"""Which recipe of `positioning` fits six joints, what its branches are called, and what it means if none fits.

Words follow the senses of the joint axes. On an industrial arm whose axes 1, 2, 3 are z, y, y, and with the first six
joints left over: ``front`` where the wrist is on the side to which joint 1 faces, ``up`` where joint 3 bends forwards.
A step in which all joints slide has one answer; if its factor changes sign with the redundant joints, ``left`` and
``right`` are two branches of which one exists at a time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from brachis.ik import positioning
from brachis.ik.pose_joints import PoseJoints
from brachis.ik.spherical_arm import Arm, aligned, meeting, perpendicular
from brachis.ik.vectors import cross, dot


@dataclass(frozen=True)
class Factor:
    """A factor of det J_nr, whose sign tells the answers of one step apart.

    Attributes
    ----------
    value : callable
        The factor (...), from the screws at postures; analytic in complex postures.
    vanishes : str
        What it means if the factor is zero everywhere, with letters in braces for the joints.
    words : tuple of str
        Of the branches with a positive and a negative factor.
    slides : tuple of int
        If all of these joints are prismatic, the step has one answer, and the redundant joints alone set the factor.
    """

    value: Callable[[Arm], np.ndarray]
    vanishes: str
    words: tuple[str, str]
    slides: tuple[int, ...] = ()

    def linear(self, six: PoseJoints) -> bool:
        """Whether the step has one answer."""
        return bool(self.slides) and not six.revolute[list(self.slides)].any()


@dataclass(frozen=True)
class Recipe:
    """A way to solve for three joints.

    Attributes
    ----------
    fits : callable
        Whether it applies to six joints.
    meets : tuple of int or None
        Two joints whose axes meet in `Arm.meeting`.
    solve : callable
        Positions of a, b, c, with one or two answers along the slots `FRONT` and `UP`, from the screws while the six
        joints are at zero and the target of their centre; NaN where there is none.
    factors : tuple of Factor
        Of these two slots.
    """

    fits: Callable[[PoseJoints], bool]
    meets: tuple[int, int] | None
    solve: Callable[[Arm, np.ndarray], positioning.Values]
    factors: tuple[Factor, Factor]


def coplanar(six: PoseJoints, i: int, j: int) -> bool:
    """Whether two joints move positions in planes of one and the same direction."""
    if six.revolute[i] and six.revolute[j]:
        return aligned(six, i, j)
    if six.revolute[i] or six.revolute[j]:
        return perpendicular(six, i, j)
    return not aligned(six, i, j)


def meet(six: PoseJoints, i: int, j: int) -> bool:
    """Whether the axes of two joints meet in a fixed point of one of them."""
    return meeting(six, i, j) is not None


def on_cylinder(six: PoseJoints) -> bool:
    """Whether the first joint slides along the second's axis, and the third's is perpendicular to it."""
    return six.revolute[:3].tolist() == [False, True, True] and aligned(six, 0, 1) and perpendicular(six, 1, 2)


def wrist_factor(arm: Arm) -> np.ndarray:
    """Volume spanned by the axes of u, w, v."""
    u, v, w = arm.wrist
    return dot(u.axis, cross(w.axis, v.axis))


_FRONT, _UP, _FLIP = ("front", "back"), ("up", "down"), ("noflip", "flip")
_CENTRE = "the point where the axes of {u}, {v}, {w} meet"
_OUT = "does not move " + _CENTRE + " out of the plane in which"
_AWAY = "does not change the distance between " + _CENTRE + " and the one where those of"

WRIST = Factor(wrist_factor, "the axes of {u}, {v}, {w} always are parallel to one plane", _FLIP)

RECIPES = (
    Recipe(
        partial(coplanar, i=1, j=2),
        None,
        positioning.plane_of_last,
        (
            Factor(positioning.out_of_last_factor, f"{{a}} {_OUT} {{b}} and {{c}} do", _FRONT, (0,)),
            Factor(positioning.within_last_factor, f"{{b}} and {{c}} move {_CENTRE} along one line", _UP, (1, 2)),
        ),
    ),
    Recipe(
        partial(coplanar, i=0, j=1),
        None,
        positioning.plane_of_first,
        (
            Factor(positioning.within_first_factor, f"{{a}} and {{b}} move {_CENTRE} along one line", _FRONT, (0, 1)),
            Factor(positioning.out_of_first_factor, f"{{c}} {_OUT} {{a}} and {{b}} do", _UP, (2,)),
        ),
    ),
    Recipe(
        partial(meet, i=0, j=1),
        (0, 1),
        positioning.meeting_of_first,
        (
            Factor(positioning.along_first_factor, f"{{b}} does not move {_CENTRE} along the axis of {{a}}", _FRONT),
            Factor(positioning.approach_of_last_factor, f"{{c}} {_AWAY} {{a}} and {{b}} do", _UP),
        ),
    ),
    Recipe(
        partial(meet, i=1, j=2),
        (1, 2),
        positioning.meeting_of_last,
        (
            Factor(positioning.along_second_factor, f"{{c}} does not move {_CENTRE} along the axis of {{b}}", _FRONT),
            Factor(positioning.approach_of_first_factor, f"{{a}} {_AWAY} {{b}} and {{c}} do", _UP),
        ),
    ),
    Recipe(
        on_cylinder,
        None,
        positioning.cylinder,
        (
            Factor(
                positioning.in_front_factor, f"{{a}} and {{b}} do not move {_CENTRE} along the axis of {{c}}", _FRONT
            ),
            Factor(positioning.to_front_factor, f"{{c}} {_OUT} {{a}} and {{b}} do", _UP),
        ),
    ),
)


def reason_against(six: PoseJoints) -> str:
    """Say how the first three joints lie to each other."""
    relations = f"{_relation(six, 0, 1)}, and {_relation(six, 1, 2)}"
    return f"no closed form moves {_lettered(_CENTRE, six)} by {', '.join(six.names[:3])}: {relations}"


def reason_singular(six: PoseJoints, factor: Factor) -> str:
    """Say what it means if a factor is zero everywhere."""
    return _lettered(factor.vanishes, six)


def _lettered(sentence: str, six: PoseJoints) -> str:
    return sentence.format(**dict(zip("abcuvw", six.names, strict=True)))


def _relation(six: PoseJoints, i: int, j: int) -> str:
    """How two neighbours lie to each other."""
    first, second = six.names[i], six.names[j]
    if six.revolute[i] and six.revolute[j]:
        if aligned(six, i, j):
            return f"the axes of {first} and {second} are parallel"
        apart = "are not parallel and do not meet in a fixed point of one of them"
        return f"the axes of {first} and {second} {'meet' if meet(six, i, j) else apart}"
    manner = "along" if aligned(six, i, j) else "across" if perpendicular(six, i, j) else "at an angle to"
    if six.revolute[i]:
        first, second = second, first
    return f"{first} slides {manner} the {'axis' if six.revolute[[i, j]].any() else 'direction'} of {second}"
