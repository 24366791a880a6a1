"""Where phases join: the end of one is the start of another, and both rest there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.kinematics import JointState
from brachis.nlp.phase import Phase


@dataclass(frozen=True)
class Link:
    """Joints whose positions at the end of one phase are those at the start of another.

    A row for each of them is the difference of the two, rad or m, turns included, which is 0. Where a phase fixes a
    position at its boundary, only the other phase's variables matter; a joint that both phases fix needs no link. Along
    paths on both sides the redundant joints are enough: the closed form gives the others.

    Attributes
    ----------
    before, after : int
        Numbers of the phase that ends, and of the one that begins there.
    joints : tuple of int
    """

    before: int
    after: int
    joints: tuple[int, ...]

    @property
    def _sides(self) -> tuple[tuple[int, int, float], tuple[int, int, float]]:
        """Phase, collocation point and sign."""
        return (self.before, -1, 1.0), (self.after, 0, -1.0)

    def rows(self, states: Sequence[JointState]) -> np.ndarray:
        """Values of the rows, (j,), from the states of all phases at their collocation points."""
        joints = list(self.joints)
        return np.asarray(sum(sign * states[phase].q[point, joints] for phase, point, sign in self._sides))

    def pattern(self, phases: Sequence[Phase], first: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Rows, from 0, and columns of the Jacobian's entries, (nnz,) each.

        Parameters
        ----------
        phases : sequence of Phase
            All phases of the program.
        first : sequence of int
            Where the variables of each one begin.
        """
        variables = [_free(phases[phase], point)[1] + first[phase] for phase, point, _ in self._sides]
        rows = [np.repeat(np.arange(len(self.joints)), len(own)) for own in variables]
        return np.concatenate(rows), np.concatenate([np.tile(own, len(self.joints)) for own in variables])

    def jacobian(self, phases: Sequence[Phase], states: Sequence[JointState]) -> np.ndarray:
        """Entries of the Jacobian on the pattern, (nnz,): the joint maps' gradients at the ends."""
        joints = list(self.joints)
        return np.concatenate(
            [
                sign * states[phase].gradient[point][joints][:, _free(phases[phase], point)[0]].ravel()
                for phase, point, sign in self._sides
            ]
        )


def _free(phase: Phase, point: int) -> tuple[np.ndarray, np.ndarray]:
    """Find the curves whose value at an end is free, and the variables that it is."""
    variables = phase.end_variables(point)
    free = np.flatnonzero(variables >= 0)
    return free, variables[free]
