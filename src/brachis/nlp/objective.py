"""What a program minimises: a sum over its phases."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from brachis.limits import Partials
from brachis.nlp.phase import Phase


class Objective(Protocol):
    """A function of the phases' motions.

    Attributes
    ----------
    longest : float or (phases,) ndarray
        Upper bounds on the phases' durations, s.
    """

    @property
    def longest(self) -> float | np.ndarray: ...  # noqa: D102

    def value(self, phase: Phase, x: np.ndarray) -> float:
        """Share of a phase at its variables x, (v,)."""
        ...

    def gradient(self, phase: Phase, x: np.ndarray) -> np.ndarray:
        """Gradient of the share, (v,)."""
        ...


@dataclass(frozen=True)
class EndTime:
    """The end time t_E, s: the sum of the durations."""

    longest: float = np.inf

    def value(self, _phase: Phase, x: np.ndarray) -> float:
        """See `Objective`."""
        return float(x[0])

    def gradient(self, _phase: Phase, x: np.ndarray) -> np.ndarray:
        """See `Objective`."""
        unit = np.zeros(len(x))
        unit[0] = 1.0
        return unit


@dataclass(frozen=True, eq=False)
class LeastAcceleration:
    """Mean over a phase's time of the sum over the joints of (weights_i qddot_i)^2, by the trapezoidal rule.

    Attributes
    ----------
    weights : (n,) ndarray
        By joint, reciprocals of accelerations.
    longest : (phases,) ndarray
        See `Objective`.
    """

    weights: np.ndarray
    longest: np.ndarray

    def value(self, phase: Phase, x: np.ndarray) -> float:
        """See `Objective`; raises UnreachableError as `Phase.state` does."""
        squares = (phase.state(x).qddot * self.weights) ** 2
        return float(_shares(phase) @ squares.sum(axis=1))

    def gradient(self, phase: Phase, x: np.ndarray) -> np.ndarray:
        """See `Objective`; raises UnreachableError as `Phase.state` does."""
        slopes = 2.0 * _shares(phase)[:, None] * self.weights**2 * phase.state(x).qddot
        return phase.gradient(Partials(qddot=slopes[:, None]), x)


def _shares(phase: Phase) -> np.ndarray:
    """Weights of the trapezoidal rule at the collocation points, (K,)."""
    gaps = np.concatenate([[0.0], np.diff(phase.t_norm), [0.0]])
    return np.asarray(0.5 * (gaps[:-1] + gaps[1:]))
