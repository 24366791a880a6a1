"""Closed forms whose branches are distinguished by det J_nr: by its factors, or by its sign alone.

Two solutions meet only where det J_nr vanishes. The sign of det J_nr therefore defines the branches, and det J_nr
divided by its largest magnitude is the branch margin. In some families, several solutions have the same sign. Along a
motion, these solutions are distinguished by continuity.

If a closed form solves for one joint after the other, det J_nr is a product of factors. Each step brings a component or
a distance of a position to a given value. The derivative of this condition with respect to the joint of the step is, up
to its sign, a factor. The two solutions of a step differ by the sign of the step's factor, and meet where this factor
vanishes. The factors divided by their largest magnitudes are the branch margins, so a branch ends exactly where J_nr is
singular.

A step in which all joints are prismatic has only one solution. If the sign of its factor changes with the redundant
joints, ``left`` and ``right`` are two branches, of which only one exists at a time.
"""

from __future__ import annotations

import itertools
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from brachis.common import tolerances
from brachis.ik.arm import Arm, RemainingJoints
from brachis.ik.protocol import FormulaMargins, FormulaSolver, NotApplicableError
from brachis.ik.screws import ChainGeometry, PosedScrews, Poses, Screw
from brachis.ik.vectors import nan_where_negative, wrap
from brachis.robot.joints import complement


def largest_size(
    determinants: np.ndarray, geometry: ChainGeometry, redundant: Sequence[int]
) -> float:
    """Return the largest magnitude of det J_nr in random postures.

    Raises
    ------
    NotApplicableError
        J_nr is singular in all postures.
    """
    size = float(np.abs(determinants).max())
    if size < tolerances.LENGTH:
        names = ", ".join(geometry.joint_names[i] for i in redundant)
        reason = "the joints cannot make all motions of the task space"
        if names:
            reason = f"there is always a motion of the tool that needs {names}"
        raise NotApplicableError(f"J_nr is singular everywhere: {reason}")
    return size


class DeterminantSolver(FormulaMargins):
    """Base class of closed forms whose branches are the signs of det J_nr.

    Parameters
    ----------
    chain : ChainGeometry
    redundant : sequence of int
    name : str
        Beginning of the branch labels.
    postures : (K, n) ndarray, optional
        Random postures in which the scale of the determinant is measured.
    """

    def __init__(
        self,
        chain: ChainGeometry,
        redundant: Sequence[int],
        name: str = "determinant",
        postures: np.ndarray | None = None,
    ) -> None:
        self.branches: tuple[str, ...] = (f"{name}_positive", f"{name}_negative")
        self._chain = chain
        self._redundant = list(redundant)
        self._joints = complement(chain.n, redundant)
        if postures is None:
            rng = np.random.default_rng(0)
            postures = rng.uniform(-np.pi, np.pi, (64, chain.n))
        self._random = self._determinants(postures)
        self._scale = largest_size(self._random, chain, redundant)

    def _determinants(self, q: np.ndarray) -> np.ndarray:
        """Compute det J_nr, (K,), in postures, (K, n)."""
        return self._chain.screws_at(q).determinant(self._joints)

    def margins(self, q: np.ndarray) -> np.ndarray:
        """Return det J_nr, (K, 1), divided by its largest magnitude."""
        return self._determinants(q)[:, None] / self._scale

    def margin_signs(self, branch: int) -> np.ndarray:
        """Return the sign of det J_nr."""
        return np.array([1.0 if branch == 0 else -1.0])


@dataclass(frozen=True)
class Factor:
    """A factor of det J_nr, whose sign distinguishes the solutions of one step.

    Attributes
    ----------
    value : callable
        Function that returns the factor, (...), from the screws in postures; analytic for complex postures.
    labels : tuple of str
        Parts of the branch labels for a positive and a negative factor.
    slides : tuple of int
        Joints of the step. If all of them are prismatic, the step has one solution, and the factor depends only on the
        redundant joints.
    """

    value: Callable[[Arm], np.ndarray]
    labels: tuple[str, str]
    slides: tuple[int, ...] = ()


Steps = tuple[Arm, Sequence[np.ndarray]]
"""The arm with its joints at zero, and the solutions for the joints, whose arrays have the slots before the samples.

If the direction of a slide depends on joints that were solved before, the arm has this direction.
"""


class FactoredSolver(FormulaSolver):
    """Closed form that solves for one joint after the other. Each step has its own axis, or slot, in the solutions.

    Parameters
    ----------
    geometry : ChainGeometry
    redundant : tuple of int
    joints : RemainingJoints
        The joints, in the order in which the solver solves for them.
    factors : tuple of Factor
        Factors of det J_nr, one for each step.
    """

    def __init__(
        self,
        geometry: ChainGeometry,
        redundant: tuple[int, ...],
        joints: RemainingJoints,
        factors: tuple[Factor, ...],
    ) -> None:
        self._geometry = geometry
        self._redundant = redundant
        self._joints = joints
        self._factors = factors
        postures = self._arm_at(geometry.random_screws)
        values = [factor.value(postures) for factor in factors]
        self._scales = [float(np.abs(value).max()) for value in values]
        self._varying = [
            slot
            for slot, value in enumerate(values)
            if np.ptp(value) > tolerances.LENGTH * self._scales[slot]
        ]
        self._signs = []
        self._sided = []
        labels = []
        for slot, (factor, value) in enumerate(zip(factors, values, strict=True)):
            linear = bool(factor.slides) and not joints.revolute[[*factor.slides]].any()
            if linear and np.all(value[0] * value > 0.0):
                self._signs.append(np.sign(value[:1]))
                labels.append([""])
                continue
            self._signs.append(np.array([1.0, -1.0]))
            labels.append(["left", "right"] if linear else list(factor.labels))
            if linear:
                self._sided.append(slot)
        self._choices = list(itertools.product(*self._signs))
        self.branches: tuple[str, ...] = tuple(
            "_".join(filter(None, sides)) or "slides"
            for sides in itertools.product(*labels)
        )

    @abstractmethod
    def _arm(self, screws: tuple[Screw, ...], tool: np.ndarray) -> Arm:
        """Build the arm, with the points that follow from the joints' screws and the tool's position, (3, ...)."""

    @abstractmethod
    def _steps(self, targets: np.ndarray, q_r: np.ndarray) -> Steps:
        """Solve for the joints at targets, (K, c), with the redundant joints at q_r, (K, r)."""

    def _arm_at(self, screws: PosedScrews) -> Arm:
        return self._arm(self._joints.screws(screws), screws.tool_position)

    def _displacement(
        self, targets: np.ndarray, q_r: np.ndarray
    ) -> tuple[tuple[Screw, ...], Poses]:
        """Return the screws and D of the equation E_1 ... E_6 = D for poses, with the joints in the order of solution.

        With redundant joints at q_r and all others at zero, the tool is at M(q_r), and D = T M(q_r)^-1 for the target
        T. E_i is the motion about or along the screw of the i-th joint, as placed by the redundant joints. In the
        reverse order, the equation is E_6^-1 ... E_1^-1 = D^-1. Redundant joints may be anywhere in the chain.
        """
        screws = self._geometry.screws_with(self._redundant, q_r)
        motion = Poses.of_targets(targets) @ Poses.of_tool(screws).inverse()
        if self._joints.mirrored:
            motion = motion.inverse()
        spread = (..., None, None, None, slice(None))
        return self._joints.screws(screws, 3), Poses(
            motion.position[spread], motion.rotation[spread]
        )

    def answers(self, targets: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Arrange the solutions of the steps; angles are in (-pi, pi]."""
        held, values = self._steps(targets, q_r)
        slots = [len(signs) for signs in self._signs]
        for slot in self._sided:
            level = np.moveaxis(
                self._signs[slot].reshape(-1, *[1] * len(slots)), 0, slot
            )
            values = [
                nan_where_negative(level * self._factors[slot].value(held), value)
                for value in values
            ]
        ordered = values[::-1] if self._joints.mirrored else values
        revolute = self._geometry.revolute[np.sort(self._joints.joints)]
        pairs = zip(ordered, revolute, strict=True)
        shape = (*slots, len(q_r))
        answers = [
            np.broadcast_to(wrap(value) if turns else value, shape)
            for value, turns in pairs
        ]
        return (
            np.stack(answers).reshape(len(values), len(self.branches), -1).T[:, :, None]
        )

    def margins(self, q: np.ndarray) -> np.ndarray:
        """Return the factors of det J_nr that are not constant."""
        arm = self._arm_at(self._geometry.screws_at(q))
        margins = np.empty((len(q), len(self._varying)), arm.centre.dtype)
        for column, slot in enumerate(self._varying):
            margins[:, column] = self._factors[slot].value(arm) / self._scales[slot]
        return margins

    def margin_signs(self, branch: int) -> np.ndarray:
        """Return the signs of the factors that are not constant."""
        return np.array([self._choices[branch][slot] for slot in self._varying])


S = TypeVar("S", bound=FactoredSolver)


def fit(
    solver: Callable[..., S],
    geometry: ChainGeometry,
    redundant: tuple[int, ...],
    joints: RemainingJoints,
    *arguments: object,
) -> S:
    """Create a solver for joints in their order or, if the solver does not fit, in the reverse order.

    Parameters
    ----------
    solver : type
        Class of the solver, called with the geometry, the redundant joints, the remaining joints in one order, and the
        further arguments. The class raises `NotApplicableError` if the solver does not fit.
    geometry : ChainGeometry
    redundant : tuple of int
    joints : RemainingJoints
        The remaining joints, from the base to the tool.
    *arguments
        Further arguments of the solver.

    Raises
    ------
    NotApplicableError
        J_nr is singular everywhere, or the solver does not fit; the message gives the reason.
    """
    determinants = geometry.random_screws.determinant(joints.joints)
    largest_size(determinants, geometry, redundant)
    reasons = []
    for order in (joints, joints.reverse()):
        try:
            return solver(geometry, redundant, order, *arguments)
        except NotApplicableError as reason:
            reasons.append(str(reason))
    raise NotApplicableError("; ".join(dict.fromkeys(reasons)))
