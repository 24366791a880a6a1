"""Factors of det J_nr, whose signs tell the branches of a closed form apart.

A closed form that solves for one joint after the other brings a component or a distance of a position to a given value
in each step. The derivatives of these conditions, each with respect to its step's joint, are the factors of det J_nr,
up to its sign: a step's two answers differ by the sign of its factor, and meet where it vanishes. Divided by their
largest size the factors are the branch margins, so that a branch ends exactly where J_nr is singular.

A step in which all joints slide has one answer; if its factor changes sign with the redundant joints, ``left`` and
``right`` are two branches of which one exists at a time.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from brachis.ik.arm import Arm
from brachis.ik.remaining_joints import RemainingJoints
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
    return next((factor for factor in factors if np.abs(factor.value(postures)).max() < _VANISHES), None)


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

    def __init__(self, factors: Sequence[Factor], joints: RemainingJoints, postures: Arm) -> None:
        self._factors = factors
        self._joints = joints
        values = [factor.value(postures) for factor in factors]
        self._scales = [float(np.abs(value).max()) for value in values]
        self._bounds = [slot for slot, value in enumerate(values) if np.ptp(value) > _VANISHES * self._scales[slot]]
        linear = [factor.linear(joints) for factor in factors]
        self._signs = [_signs(value, one_answer=one) for value, one in zip(values, linear, strict=True)]
        self._choices = list(itertools.product(*self._signs))
        words = [_LEFT if one else factor.words for factor, one in zip(factors, linear, strict=True)]
        named = [slot for slot in range(len(factors)) if len(self._signs[slot]) > 1]
        # Linear steps of which either side exists, but not for the same redundant joints.
        self._sided = [slot for slot in named if linear[slot]]
        self.labels: tuple[str, ...] = tuple(
            "_".join(words[slot][int(signs[slot] < 0.0)] for slot in named) or _ALONE for signs in self._choices
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
        joints = np.empty((len(values), *(len(signs) for signs in self._signs), values[-1].shape[-1]))
        for place, value in enumerate(values):
            joints[place] = value
        revolute = self._joints.revolute
        turning = slice(None) if revolute.all() else revolute
        joints[turning] = wrap(joints[turning])
        joints += 0.0 * joints.sum(axis=0)
        alternatives = range(len(self._factors) + 1)
        for slot in self._sided:
            side = np.expand_dims(self._signs[slot], [axis for axis in alternatives if axis != slot])
            joints = np.where(side * self._factors[slot].value(held) > 0.0, joints, np.nan)
        ordered = joints[::-1] if self._joints.mirrored else joints
        return ordered.reshape(len(values), len(self.labels), -1).T

    def margins(self, postures: Arm, branch: int) -> np.ndarray:
        """Compute the factors that are not constant, (K, k): positive within a branch; analytic."""
        signs = self._choices[branch]
        margins = [self._factors[slot].value(postures) * (signs[slot] / self._scales[slot]) for slot in self._bounds]
        return np.stack(margins, axis=1) if margins else np.zeros((postures.centre.shape[-1], 0), postures.centre.dtype)


def _signs(values: np.ndarray, *, one_answer: bool) -> np.ndarray:
    """Signs of a factor by which the branches of its step differ; its only one where nothing is to be told apart."""
    if one_answer and np.all(values[0] * values > 0.0):
        return np.sign(values[:1])
    return np.array([1.0, -1.0])
