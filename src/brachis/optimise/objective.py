"""The objective to minimise: the end time or the accelerations of the joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from brachis.limits import Partials
from brachis.optimise.phase import Phase

_CALM = 1e-4
"""Weight of the redundant joints' squared accelerations if the time is given, s per rad^2 or m^2.

The accelerations are scaled by the duration of a knot interval. Joints may therefore move fast where intervals are
short, but do not swing between two collocation points that are far apart. For ten lines at 0.02 to 0.5 m/s, weights of
1e-5 and 1e-3 gave the same end times to within 1e-4.
"""


class Objective(Protocol):
    """A function of the motions of the phases. It is a sum of one share per phase.

    Attributes
    ----------
    longest : float or (phases,) ndarray
        Upper bounds on the phases' durations, s.
    """

    @property
    def longest(self) -> float | np.ndarray: ...  # noqa: D102

    def value(self, phase: Phase, x: np.ndarray) -> float:
        """Return the share of a phase in the objective, at its variables x, (v,)."""

    def gradient(self, phase: Phase, x: np.ndarray) -> np.ndarray:
        """Return the gradient of the share, (v,)."""

    def is_curved(self, phase: Phase) -> bool:
        """Tell whether the share of a phase contains a sum of squares."""

    def curvature(self, phase: Phase, x: np.ndarray) -> np.ndarray:
        """Return the Gauss-Newton part of the share's Hessian, (v, v)."""


@dataclass(frozen=True)
class EndTime:
    """The end time t_E, s: the sum of the durations.

    If the duration of a phase is given, many motions are equally fast, but solvers need a unique optimum. Therefore the
    mean square of the redundant joints' accelerations is added with a small weight.
    """

    longest: float = np.inf

    def value(self, phase: Phase, x: np.ndarray) -> float:
        """Return the time of a phase and the pause after it, s, plus weighted accelerations if the time is given."""
        duration = float(x[0]) + phase.pause
        if phase.time_law is None:
            return duration
        squares = phase.state(x).yddot[:, 1:] ** 2
        return duration + float(_calm(phase, x) @ squares.sum(axis=1))

    def gradient(self, phase: Phase, x: np.ndarray) -> np.ndarray:
        """Return the gradient of the value, (v,)."""
        gradient = np.zeros(len(x))
        if phase.time_law is not None:
            yddot = phase.state(x).yddot[:, None]
            slopes = np.zeros((3, *yddot.shape))
            slopes[2] = 2.0 * _calm(phase, x)[:, None, None] * yddot
            slopes[2, :, :, 0] = 0.0
            gradient = phase.gradient_by_curves(slopes, x)
        gradient[0] = 1.0  # a given duration does not change
        return gradient

    def is_curved(self, phase: Phase) -> bool:
        """Tell whether the duration is given and there are redundant joints."""
        return phase.time_law is not None and phase.joint_map.r > 0

    def curvature(self, phase: Phase, x: np.ndarray) -> np.ndarray:
        """Return the Hessian of the weighted mean square of the redundant joints' accelerations, (v, v)."""
        points, curves = phase.state(x).yddot.shape
        by_curves = np.zeros((3, points, curves - 1, curves))
        by_curves[2, :, :, 1:] = np.eye(curves - 1)
        slopes = phase.slopes_by_variables(by_curves, x)
        hessian = phase.sum_outer_products(slopes, 2.0 * _calm(phase, x)[:, None])
        hessian[0] = 0.0  # the duration does not change
        hessian[:, 0] = 0.0
        return hessian


@dataclass(frozen=True, eq=False)
class LeastAcceleration:
    """Mean of the sum of (weights_i qddot_i)^2 over the joints, taken over the time of a phase (trapezoidal rule).

    Attributes
    ----------
    weights : (n,) ndarray
        Weight of each joint, as the reciprocal of an acceleration. The weight of further joints of a phase is 0.
    longest : (phases,) ndarray
        Upper bounds on the phases' durations, s.
    """

    weights: np.ndarray
    longest: np.ndarray

    def value(self, phase: Phase, x: np.ndarray) -> float:
        """Return the mean over a phase; raise UnreachableError as `Phase.evaluate` does."""
        squares = (phase.state(x).qddot * self._weights_of(phase)) ** 2
        return float(_shares(phase) @ squares.sum(axis=1))

    def gradient(self, phase: Phase, x: np.ndarray) -> np.ndarray:
        """Return the gradient of the mean, (v,); raise UnreachableError as `Phase.evaluate` does."""
        weights = self._weights_of(phase)
        slopes = 2.0 * _shares(phase)[:, None] * weights**2 * phase.state(x).qddot
        return phase.gradient(Partials(qddot=slopes[:, None]), x)

    def is_curved(self, _phase: Phase) -> bool:
        """Return True, because the share is a sum of squares."""
        return True

    def curvature(self, phase: Phase, x: np.ndarray) -> np.ndarray:
        """Return the Gauss-Newton part of the mean's Hessian, (v, v)."""
        by_joints = np.tile(np.diag(self._weights_of(phase)), (len(phase.t_norm), 1, 1))
        by_curves = phase.evaluate(x).chain(Partials(qddot=by_joints))
        slopes = phase.slopes_by_variables(by_curves, x)
        shares = _shares(phase)[:, None]
        return phase.sum_outer_products(slopes, 2.0 * shares)

    def _weights_of(self, phase: Phase) -> np.ndarray:
        """Return the weights of all joints of a phase."""
        return np.pad(self.weights, (0, phase.joint_map.robot.n - len(self.weights)))


def _calm(phase: Phase, x: np.ndarray) -> np.ndarray:
    """Return weights of squared accelerations at the collocation points, (K,), s per (rad/s^2)^2 or (m/s^2)^2."""
    breaks = phase.breaks
    interval = np.searchsorted(breaks[1:-1], phase.t_norm, side="right")
    durations = np.diff(breaks)[interval] * float(x[0])
    return _CALM * _shares(phase) * durations**4


def _shares(phase: Phase) -> np.ndarray:
    """Return the weights of the trapezoidal rule at the collocation points, (K,)."""
    gaps = np.concatenate([[0.0], np.diff(phase.t_norm), [0.0]])
    return 0.5 * (gaps[:-1] + gaps[1:])
