"""The branch of a closed form from which postures along a path are chosen."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from brachis.kernel.formula import Formula
from brachis.kernel.library import Structured, address, as_contiguous, declare_fields


class _Branch(ctypes.Structure):
    """The structure `branch` of motion.h."""

    _fields_ = declare_fields(
        "p answers_of; l alternatives; p redundant nonredundant turns ranged start"
    )


@dataclass(frozen=True, eq=False)
class Branch(Structured):
    """A branch of a closed form. The closed form gives m of n joints from the target and the redundant joints.

    Of several solutions, the one closest to the previous posture is chosen; full turns do not count as a difference.
    Full turns are then added to the angles so that they are closest to the previous posture, or to where the velocities
    lead.

    Attributes
    ----------
    redundant, nonredundant : (r,), (m,) int ndarray
        Indices of the joints.
    turns : (n,) bool ndarray
        True for joints whose turns are counted.
    ranged : (n,) bool ndarray
        True for joints with a finite range. The number of turns of these joints must be certain.
    start : (n,) ndarray
        Posture to which the first posture is brought as close as possible by full turns.
    alternatives : int
        Number of solutions, A. Solutions that do not exist are not finite.
    answers_of : Formula or None
        Formula of the target and the redundant joints, with (A, m) results; None if the solutions are given.
    """

    redundant: np.ndarray
    nonredundant: np.ndarray
    turns: np.ndarray
    ranged: np.ndarray
    start: np.ndarray
    alternatives: int = 1
    answers_of: Formula | None = None

    def check_fits(self, n: int, r: int, coordinates: int) -> None:
        """Raise an error if the numbers of joints, redundant joints or task coordinates differ.

        With different numbers the library would read beyond the ends of arrays.

        Raises
        ------
        ValueError
        """
        joints = len(self.start)
        redundant = len(self.redundant)
        if (joints, redundant) != (n, r):
            raise ValueError(
                f"the branch has {joints} joints, {redundant} redundant; needed: {n} and {r}"
            )
        if self.answers_of is None or self.answers_of.counts == (coordinates, r):
            return
        raise ValueError(
            f"the formula takes {self.answers_of.counts} numbers; needed: {(coordinates, r)}"
        )

    def _make_structure(self) -> _Branch:
        n = len(self.start)
        joints = np.concatenate([self.redundant, self.nonredundant])
        if not np.array_equal(np.sort(joints), np.arange(n)):
            raise ValueError(
                "the redundant and the other joints must be all joints of the robot, each once"
            )
        if self.alternatives < 1:
            raise ValueError("the branch has no solutions to choose from")
        formula = None
        if self.answers_of is not None:
            formula = self.answers_of.address
            needed = (self.alternatives, len(self.nonredundant))
            if self.answers_of.shape != needed:
                raise ValueError(
                    f"the solutions have the shape {self.answers_of.shape}; needed: {needed}"
                )
        indices = [self.redundant.astype("l"), self.nonredundant.astype("l")]
        tables = [
            as_contiguous(table, (n,))
            for table in (self.turns, self.ranged, self.start)
        ]
        arrays = indices + tables
        structure = _Branch(formula, self.alternatives, *map(address, arrays))
        structure.arrays = arrays
        return structure
