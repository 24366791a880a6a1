"""Means over the whole motion: their values, slopes and curvature.

A mean extends over all phases and the pauses at rest between them, weighted by their durations.

The values whose means are limited are squares f^2. Their Hessian is 2 f' f'^T + 2 f f''. The first term is the
Gauss-Newton part, which equals g g^T / (2 f^2) with the slopes g = 2 f f'.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.limits import Limit, Moments, Partials
from brachis.optimise.phase import Phase

_NEARLY_ZERO = 1e-12
"""Value below which no curvature is computed: the slopes are nearly zero too, and the quotient is rounding error."""

PhasePoints = Sequence[tuple[Phase, np.ndarray]]
"""Sequence of phases, each with its variables."""


class Means:
    """Means, over the motion, of the values whose means are limited.

    Parameters
    ----------
    limits : sequence of Limit
        Limits of the phases.

    Attributes
    ----------
    limits : tuple of Limit
        The limits on means.
    lower, upper : (m,) ndarray
        Bounds of the means.
    """

    def __init__(self, limits: Sequence[Limit]) -> None:
        self.limits = tuple(limit for limit in limits if limit.guarantee.is_mean)
        none = np.empty(0)
        self.lower = np.concatenate([none, *(limit.lower for limit in self.limits)])
        self.upper = np.concatenate([none, *(limit.upper for limit in self.limits)])

    def __len__(self) -> int:
        """Return the number of values, m."""
        return len(self.lower)

    def values(self, phase_points: PhasePoints) -> np.ndarray:
        """Compute the means over all phases, (m,); raise UnreachableError as `Phase.evaluate` does."""
        if not self.limits:
            return np.empty(0)
        sums = []
        for phase, x in phase_points:
            sums.append(x[0] * _means_of(phase, x))
            if phase.pause:
                sums.append(phase.pause * self._values_at_rest(phase, x))
        return sum(sums) / _end_time(phase_points)

    def slopes(self, phase_points: PhasePoints) -> np.ndarray:
        """Compute the slopes of the means with respect to all variables, (m, v)."""
        if not self.limits:
            return np.empty((0, sum(len(x) for _, x in phase_points)))
        total = self.values(phase_points)
        columns = []
        for phase, x in phase_points:
            slopes = x[0] * _mean_slopes_of(phase, x)
            slopes[:, 0] += _means_of(phase, x) - total
            if phase.pause:
                slopes += phase.pause * self._slopes_at_rest(phase, x)
            columns.append(slopes)
        return np.hstack(columns) / _end_time(phase_points)

    def curvature(self, phase_points: PhasePoints, weights: np.ndarray) -> np.ndarray:
        """Compute the Gauss-Newton part, (v, v), of the Hessian of ``weights . values``, with weights (m,).

        It leaves out the pauses, and the effect that durations have on the shares of the phases.
        """
        ends = np.cumsum([0, *(len(x) for _, x in phase_points)])
        total = np.zeros((ends[-1], ends[-1]))
        for (phase, x), first in zip(phase_points, ends, strict=False):
            block = slice(first, first + len(x))
            share = x[0] / _end_time(phase_points)
            total[block, block] = share * _curvature_of(phase, x, weights)
        return total

    def violation(self, phase_points: PhasePoints) -> float:
        """Return the largest violation of the limits on means; -inf if there are none."""
        ends = np.cumsum([len(limit.lower) for limit in self.limits])
        values = np.split(self.values(phase_points), ends[:-1])
        pairs = zip(self.limits, values, strict=False)
        violations = [limit.violation(means[None]).max() for limit, means in pairs]
        return float(max(violations, default=-np.inf))

    def _values_at_rest(self, phase: Phase, x: np.ndarray) -> np.ndarray:
        """Return the values, (m,), while the arm waits at the end of the phase."""
        still = Moments.at_rest(phase.state(x).q[-1:])
        return np.concatenate([limit.values(still)[0] for limit in self.limits])

    def _slopes_at_rest(self, phase: Phase, x: np.ndarray) -> np.ndarray:
        """Return the slopes of `_values_at_rest`, (m, v)."""
        state = phase.state(x)
        still = Moments.at_rest(state.q[-1:])
        by_q = [_by_posture(limit.partials(still), still.q) for limit in self.limits]
        at_end = np.concatenate(by_q) @ state.gradient[-1]
        by_y = np.zeros((1, len(phase.t_norm), *at_end.shape))
        by_y[0, -1] = at_end
        return phase.sum_up(phase.slopes_by_variables(by_y, x))


def _end_time(phase_points: PhasePoints) -> float:
    """Return the total time of all phases and pauses, s."""
    return float(sum(x[0] + phase.pause for phase, x in phase_points))


def _means_of(phase: Phase, x: np.ndarray) -> np.ndarray:
    """Return the means over one phase, (m,)."""
    values = phase.evaluate(x).values[:, phase.evaluator.is_mean]
    return phase.mean_weights(x) @ values


def _mean_slopes_of(phase: Phase, x: np.ndarray) -> np.ndarray:
    """Return the slopes of the means over one phase, (m, v)."""
    is_mean = phase.evaluator.is_mean
    slopes = phase.limit_slopes(x)[:, is_mean]
    total = phase.sum_up(slopes, phase.mean_weights(x))
    by_lengths = phase.grid.mean_slopes
    total[:, phase.lengths] += phase.evaluate(x).values[:, is_mean].T @ by_lengths.T
    return total


def _curvature_of(phase: Phase, x: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the Gauss-Newton part of the Hessian, (v, v), of the means over one phase with given weights, (m,)."""
    is_mean = phase.evaluator.is_mean
    values = phase.evaluate(x).values[:, is_mean]
    is_curved = values > _NEARLY_ZERO
    inverse = np.divide(0.5, values, out=np.zeros_like(values), where=is_curved)
    factors = phase.mean_weights(x)[:, None] * weights * inverse
    return phase.sum_outer_products(phase.limit_slopes(x)[:, is_mean], factors)


def _by_posture(partials: Partials, q: np.ndarray) -> np.ndarray:
    """Return the slopes of a limit at rest with respect to the posture, (c, n); zero if there is no dependence."""
    if partials.q is None:
        return np.zeros((partials.size, q.shape[1]))
    return partials.q[0]
