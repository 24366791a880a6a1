"""What closed forms have in common that solve for one joint after the other, so that factors of det J_nr appear.

Factors of det J_nr, whose signs tell the branches of a closed form apart.

A closed form that solves for one joint after the other brings a component or a distance of a position to a given value
in each step. The derivatives of these conditions, each with respect to its step's joint, are the factors of det J_nr,
up to its sign: a step's two answers differ by the sign of its factor, and meet where it vanishes. Divided by their
largest size the factors are the branch margins, so that a branch ends exactly where J_nr is singular.

A step in which all joints slide has one answer; if its factor changes sign with the redundant joints, ``left`` and
``right`` are two branches of which one exists at a time.

Which recipe of `placing` fits three joints, what its branches are called, and what it means if none fits.

Words follow the senses of the joint axes. On an industrial arm whose axes 1, 2, 3 are z, y, y, and with these three
joints left over to place a point (the wrist's centre, or the tool): ``front`` where it is on the side to which joint 1
faces, ``up`` where joint 3 bends forwards.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Generic, TypeVar

import numpy as np

from brachis.ik import placing
from brachis.ik.arm import (
    Anchor,
    Arm,
    RemainingJoints,
    aligned,
    largest_determinant,
    meeting,
    perpendicular,
    random_postures,
)
from brachis.ik.protocol import IKSolver, NotApplicableError
from brachis.ik.screws import ChainGeometry, PosedScrews
from brachis.ik.vectors import wrap

_VANISHES = 1e-9
_LEFT = ("left", "right")
_ALONE = "slides"


@dataclass(frozen=True)
class Factor:
    """A factor of det J_nr, whose sign tells the answers of one step apart.

    Attributes
    ----------
    value : callable
        The factor (...), from the screws at postures; analytic in complex postures.
    vanishes : str
        What it means if the factor is zero everywhere, with letters in braces for the joints, and a point's name.
    words : tuple of str
        Of the branches with a positive and a negative factor.
    slides : tuple of int
        If all of these joints are prismatic, the step has one answer, and the redundant joints alone set the factor.
    """

    value: Callable[[Arm], np.ndarray]
    vanishes: str
    words: tuple[str, str]
    slides: tuple[int, ...] = ()

    def linear(self, joints: RemainingJoints) -> bool:
        """Whether the step has one answer."""
        return bool(self.slides) and not joints.revolute[list(self.slides)].any()


def vanishing(factors: Iterable[Factor], postures: Arm) -> Factor | None:
    """Return a factor that is zero at all postures, if there is one."""
    return next(
        (
            factor
            for factor in factors
            if np.abs(factor.value(postures)).max() < _VANISHES
        ),
        None,
    )


class FactoredBranches:
    """The branches that the signs of some factors make; each factor has a slot, one axis of the steps' answers.

    Parameters
    ----------
    factors : sequence of Factor
    joints : RemainingJoints
    postures : Arm
        Random ones, by which the factors' sizes and signs are told.

    Attributes
    ----------
    labels : tuple of str
        A word for each factor that has both signs.
    """

    def __init__(
        self, factors: Sequence[Factor], joints: RemainingJoints, postures: Arm
    ) -> None:
        self._factors = factors
        self._joints = joints
        values = [factor.value(postures) for factor in factors]
        self._scales = [float(np.abs(value).max()) for value in values]
        self._bounds = [
            slot
            for slot, value in enumerate(values)
            if np.ptp(value) > _VANISHES * self._scales[slot]
        ]
        linear = [factor.linear(joints) for factor in factors]
        self._signs = [
            _signs(value, one_answer=one)
            for value, one in zip(values, linear, strict=True)
        ]
        self._choices = list(itertools.product(*self._signs))
        words = [
            _LEFT if one else factor.words
            for factor, one in zip(factors, linear, strict=True)
        ]
        named = [slot for slot in range(len(factors)) if len(self._signs[slot]) > 1]
        # Linear steps of which either side exists, but not for the same redundant joints.
        self._sided = [slot for slot in named if linear[slot]]
        self.labels: tuple[str, ...] = tuple(
            "_".join(words[slot][int(signs[slot] < 0.0)] for slot in named) or _ALONE
            for signs in self._choices
        )

    def answers(self, values: Sequence[np.ndarray], held: Arm) -> np.ndarray:
        """Arrange the steps' answers.

        Parameters
        ----------
        values : sequence of (..., K) ndarray
            Positions of the joints, in the order of `RemainingJoints`; the alternatives are axes before the samples.
        held : Arm
            While the joints are at zero.

        Returns
        -------
        (K, B, J) ndarray
            Chain order; NaN all through where one of an answer's joints is; angles in (-pi, pi].
        """
        joints = np.empty(
            (len(values), *(len(signs) for signs in self._signs), values[-1].shape[-1])
        )
        for place, value in enumerate(values):
            joints[place] = value
        revolute = self._joints.revolute
        turning = slice(None) if revolute.all() else revolute
        joints[turning] = wrap(joints[turning])
        joints += 0.0 * joints.sum(axis=0)
        alternatives = range(len(self._factors) + 1)
        for slot in self._sided:
            side = np.expand_dims(
                self._signs[slot], [axis for axis in alternatives if axis != slot]
            )
            joints = np.where(
                side * self._factors[slot].value(held) > 0.0, joints, np.nan
            )
        ordered = joints[::-1] if self._joints.mirrored else joints
        return ordered.reshape(len(values), len(self.labels), -1).T

    def margins(self, postures: Arm, branch: int) -> np.ndarray:
        """Compute the factors that are not constant, (K, k): positive within a branch; analytic."""
        signs = self._choices[branch]
        margins = [
            self._factors[slot].value(postures) * (signs[slot] / self._scales[slot])
            for slot in self._bounds
        ]
        return (
            np.stack(margins, axis=1)
            if margins
            else np.zeros((postures.centre.shape[-1], 0), postures.centre.dtype)
        )


def _signs(values: np.ndarray, *, one_answer: bool) -> np.ndarray:
    """Signs of a factor by which the branches of its step differ; its only one where nothing is to be told apart."""
    if one_answer and np.all(values[0] * values > 0.0):
        return np.sign(values[:1])
    return np.array([1.0, -1.0])


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
    return (
        joints.revolute[:3].tolist() == [False, True, True]
        and aligned(joints, 0, 1)
        and perpendicular(joints, 1, 2)
    )


_FRONT = ("front", "back")
_UP = ("up", "down")
_OUT = "does not move {point} out of the plane in which"
_AWAY = "does not change the distance between {point} and the point where the axes of"

RECIPES = (
    Recipe(
        partial(coplanar, i=1, j=2),
        None,
        placing.plane_of_last,
        (
            Factor(
                placing.out_of_last_factor,
                f"{{a}} {_OUT} {{b}} and {{c}} do",
                _FRONT,
                (0,),
            ),
            Factor(
                placing.within_last_factor,
                "{b} and {c} move {point} along one line",
                _UP,
                (1, 2),
            ),
        ),
    ),
    Recipe(
        partial(coplanar, i=0, j=1),
        None,
        placing.plane_of_first,
        (
            Factor(
                placing.within_first_factor,
                "{a} and {b} move {point} along one line",
                _FRONT,
                (0, 1),
            ),
            Factor(
                placing.out_of_first_factor,
                f"{{c}} {_OUT} {{a}} and {{b}} do",
                _UP,
                (2,),
            ),
        ),
    ),
    Recipe(
        partial(meet, i=0, j=1),
        (0, 1),
        placing.meeting_of_first,
        (
            Factor(
                placing.along_first_factor,
                "{b} does not move {point} along the axis of {a}",
                _FRONT,
            ),
            Factor(
                placing.approach_of_last_factor,
                f"{{c}} {_AWAY} {{a}} and {{b}} meet",
                _UP,
            ),
        ),
    ),
    Recipe(
        partial(meet, i=1, j=2),
        (1, 2),
        placing.meeting_of_last,
        (
            Factor(
                placing.along_second_factor,
                "{c} does not move {point} along the axis of {b}",
                _FRONT,
            ),
            Factor(
                placing.approach_of_first_factor,
                f"{{a}} {_AWAY} {{b}} and {{c}} meet",
                _UP,
            ),
        ),
    ),
    Recipe(
        on_cylinder,
        None,
        placing.cylinder,
        (
            Factor(
                placing.in_front_factor,
                "{a} and {b} do not move {point} along the axis of {c}",
                _FRONT,
            ),
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
    raise NotApplicableError(
        f"no closed form moves {point} by {', '.join(joints.names[:3])}: {relations}"
    )


def _relation(joints: RemainingJoints, i: int, j: int) -> str:
    """How two neighbours lie to each other."""
    first = joints.names[i]
    second = joints.names[j]
    if joints.revolute[i] and joints.revolute[j]:
        if aligned(joints, i, j):
            return f"the axes of {first} and {second} are parallel"
        apart = "are not parallel and do not meet in a fixed point of one of them"
        return f"the axes of {first} and {second} {'meet' if meet(joints, i, j) else apart}"
    manner = (
        "along"
        if aligned(joints, i, j)
        else "across"
        if perpendicular(joints, i, j)
        else "at an angle to"
    )
    if joints.revolute[i]:
        first, second = second, first
    return f"{first} slides {manner} the {'axis' if joints.revolute[[i, j]].any() else 'direction'} of {second}"


@dataclass(frozen=True)
class Structure(ABC):
    """Joints, in one order or the other, and what they are to each other.

    Attributes
    ----------
    joints : RemainingJoints
    """

    joints: RemainingJoints

    @property
    @abstractmethod
    def factors(self) -> tuple[Factor, ...]:
        """Factors of det J_nr, of the alternatives of the steps."""

    @abstractmethod
    def posed(self, posed: PosedScrews) -> Arm:
        """Screws at postures, (3, K)."""

    @abstractmethod
    def words(self) -> dict[str, str]:
        """Names of the joints, by their letters, and of the ``point`` that a, b, c place."""


@dataclass(frozen=True)
class PlacingStructure(Structure):
    """Joints of which the first three place a point by a recipe.

    Attributes
    ----------
    joints
        See `Structure`.
    recipe : Recipe
    meeting : Anchor or None
        See `Arm`.
    """

    recipe: Recipe
    meeting: Anchor | None

    @property
    def factors(self) -> tuple[Factor, ...]:
        """See `Structure.factors`."""
        return self.recipe.factors


J = TypeVar("J", bound=RemainingJoints)
S = TypeVar("S", bound=Structure)


class FactoredSolver(IKSolver, Generic[S]):
    """Closed form that solves for one joint after the other, with branches told apart by factors of det J_nr.

    Parameters
    ----------
    geometry : ChainGeometry
    redundant : tuple of int
    structure : Structure
    """

    def __init__(
        self, geometry: ChainGeometry, redundant: tuple[int, ...], structure: S
    ) -> None:
        self._geometry = geometry
        self._redundant = redundant
        self._structure = structure
        postures = structure.posed(random_postures(geometry))
        self._branches = FactoredBranches(structure.factors, structure.joints, postures)
        self.branches: tuple[str, ...] = self._branches.labels

    @abstractmethod
    def steps(
        self, targets: np.ndarray, q_r: np.ndarray
    ) -> tuple[Arm, Sequence[np.ndarray]]:
        """Return the arm while its joints are at zero, and their positions, with the alternatives before the samples.

        A slide whose direction, beside a plane, depends on joints that are solved for before it has that direction.
        """

    def solve(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """See `IKSolver.solve`."""
        with np.errstate(invalid="ignore", divide="ignore"):
            held, values = self.steps(targets, q_r)
            return self._branches.answers(values, held)[:, :, None]

    def branch_margins(self, q: np.ndarray, branch: int) -> np.ndarray:
        """See `IKSolver.branch_margins`: the factors of det J_nr that are not constant."""
        return self._branches.margins(
            self._structure.posed(self._geometry.posed(q)), branch
        )


def fitted(geometry: ChainGeometry, joints: J, fits: Sequence[Callable[[J], S]]) -> S:
    """Fit a structure to joints.

    Parameters
    ----------
    geometry : ChainGeometry
    joints : RemainingJoints
        From the base to the tool.
    fits : sequence of callable
        Each returns a structure of the joints, or raises `NotApplicableError`; the first that does is taken.

    Raises
    ------
    NotApplicableError
        J_nr is singular everywhere, or no structure fits; says why.
    """
    structure = None
    reasons = []
    for fit in fits:
        try:
            structure = fit(joints)
        except NotApplicableError as reason:
            reasons.append(str(reason))
        else:
            break
    posed = random_postures(geometry)
    try:
        largest_determinant(posed, joints.joints)
    except NotApplicableError as singular:
        factor = structure and vanishing(structure.factors, structure.posed(posed))
        meaning = (
            f": {factor.vanishes.format(**structure.words())}"
            if structure and factor
            else ""
        )
        raise NotApplicableError(f"{singular}{meaning}") from None
    if structure is None:
        raise NotApplicableError("; ".join(reasons))
    return structure
