"""What closed forms have in common that solve for one joint after the other, so that factors of det J_nr appear."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from brachis.ik.arm import Anchor, Arm
from brachis.ik.factors import Factor, FactoredBranches, vanishing
from brachis.ik.geometry import ChainGeometry, PosedScrews
from brachis.ik.pose_joints import largest_determinant, random_postures
from brachis.ik.position_recipes import Recipe
from brachis.ik.protocol import IKSolver, Kind, NotApplicableError
from brachis.ik.remaining_joints import RemainingJoints


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

    kind: Kind = "closed_form"

    def __init__(self, geometry: ChainGeometry, redundant: tuple[int, ...], structure: S) -> None:
        self._geometry = geometry
        self._redundant = redundant
        self._structure = structure
        postures = structure.posed(random_postures(geometry))
        self._branches = FactoredBranches(structure.factors, structure.joints, postures)
        self.branches: tuple[str, ...] = self._branches.labels

    @abstractmethod
    def steps(self, targets: np.ndarray, q_r: np.ndarray) -> tuple[Arm, Sequence[np.ndarray]]:
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
        return self._branches.margins(self._structure.posed(self._geometry.posed(q)), branch)


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
    structure, reasons = None, []
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
        meaning = f": {factor.vanishes.format(**structure.words())}" if structure and factor else ""
        raise NotApplicableError(f"{singular}{meaning}") from None
    if structure is None:
        raise NotApplicableError("; ".join(reasons))
    return structure
