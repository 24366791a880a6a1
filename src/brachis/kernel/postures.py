"""Which postures belong to the curves along a path: those of a branch of a closed form, or of a chart."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from brachis.kernel.formula import Formula
from brachis.kernel.library import Structured, address, as_contiguous, declare_fields


class _Branch(ctypes.Structure):
    """`branch` of motion.h."""

    _fields_ = declare_fields(
        "p answers_of; l alternatives; p redundant nonredundant turns ranged start"
    )


@dataclass(frozen=True, eq=False)
class Branch(Structured):
    """A branch of a closed form, by which m of n joints follow from target and redundant joints.

    Of several answers the one is taken that is nearest, modulo turns, to the posture before. Angles get the turns
    nearest to the posture before, or those to which their velocities lead.

    Attributes
    ----------
    redundant, nonredundant : (r,), (m,) int ndarray
        Indices of the joints.
    turns : (n,) bool ndarray
        Joints whose turns are counted.
    ranged : (n,) bool ndarray
        Those with a finite range: their turns must be certain.
    start : (n,) ndarray
        The first posture gets the turns nearest to this one.
    alternatives : int
        Number of answers, A; those that do not exist are not finite.
    answers_of : Formula or None
        Of target and redundant joints, with (A, m) results; None where the answers are given.
    """

    redundant: np.ndarray
    nonredundant: np.ndarray
    turns: np.ndarray
    ranged: np.ndarray
    start: np.ndarray
    alternatives: int = 1
    answers_of: Formula | None = None

    @property
    def counts_turns(self) -> bool:
        """Whether it matters which turn an angle is in."""
        return bool(self.ranged.any())

    def check_fits(self, n: int, r: int, coordinates: int) -> None:
        """Refuse other numbers of joints, redundant joints or task coordinates.

        The library would read beyond the end of arrays.

        Raises
        ------
        ValueError
        """
        joints = len(self.start)
        redundant = len(self.redundant)
        if (joints, redundant) != (n, r):
            raise ValueError(
                f"the branch has {joints} joints, {redundant} redundant; needed: {n}, {r}"
            )
        if self.answers_of is None or self.answers_of.counts == (coordinates, r):
            return
        raise ValueError(
            f"the answers are of {self.answers_of.counts} numbers; needed: {(coordinates, r)}"
        )

    def _make_structure(self) -> _Branch:
        n = len(self.start)
        joints = np.concatenate([self.redundant, self.nonredundant])
        if not np.array_equal(np.sort(joints), np.arange(n)):
            raise ValueError("redundant and other joints are not all joints, once each")
        if self.alternatives < 1:
            raise ValueError("no answers to choose from")
        formula = None
        if self.answers_of is not None:
            formula = self.answers_of.address
            needed = (self.alternatives, len(self.nonredundant))
            if self.answers_of.shape != needed:
                raise ValueError(
                    f"the answers have the shape {self.answers_of.shape}; needed: {needed}"
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
