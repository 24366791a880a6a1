"""Links: conditions that hold where one phase ends and another begins.

Each linked value or derivative has a row that must be 0. The row is the difference between the two phases, times the
duration of a knot interval to the power of the derivative's order. A `CurveLink` links curves of the same joint map. A
`PostureLink` links postures of different joint maps.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from brachis.kinematics import JointMap, JointState


class LinkedPhase(Protocol):
    """A phase, over time or over the path, as links see it."""

    @property
    def joint_map(self) -> JointMap:
        """Map from the curves to the joints."""

    def state(self, x: np.ndarray) -> JointState:
        """Return the joint motion at the points of the phase, of which the first and the last are its ends."""

    def end_pattern(self, point: int) -> np.ndarray:
        """Return the variables, (z,), that affect the curves at the first (0) or last (-1) point."""

    def end_slopes(self, x: np.ndarray, point: int) -> np.ndarray:
        """Return slopes of the curves and their time derivatives at an end, (3 or 4, c, z)."""

    def last_interval(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the duration of the last interval, s, and its relative slopes, (z,), by the variables at the end."""


LinkedPoints = Sequence[tuple[LinkedPhase, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Link(ABC):
    """The condition that some values and their time derivatives are equal where two phases meet.

    Attributes
    ----------
    before, after : int
        Numbers of the phase that ends and of the phase that begins.
    orders : tuple of int
        Orders of the derivatives that are equal: 0 for the values, 1 for the first time derivatives, ...
    """

    before: int
    after: int
    orders: tuple[int, ...]

    @property
    @abstractmethod
    def width(self) -> int:
        """Number of values that are linked."""

    @abstractmethod
    def _values(self, phase: LinkedPhase, x: np.ndarray, point: int) -> np.ndarray:
        """Return the values and their derivatives, (orders, width), at the first (0) or last (-1) point of a phase."""

    @abstractmethod
    def _slopes(self, phase: LinkedPhase, x: np.ndarray, point: int) -> np.ndarray:
        """Return slopes of `_values`, (orders, width, z), by the variables of `end_pattern`."""

    @property
    def size(self) -> int:
        """Number of rows of the link."""
        return self.width * len(self.orders)

    def _scales(self, phase: LinkedPhase, x: np.ndarray) -> np.ndarray:
        """Return the factors on the rows of each order, (orders, 1)."""
        duration, _ = phase.last_interval(x)
        return duration ** np.array(self.orders)[:, None]

    def rows(self, phase_points: LinkedPoints) -> np.ndarray:
        """Compute the values of the rows, by order and value. `phase_points` are all phases with their variables."""
        last = self._values(*phase_points[self.before], -1)
        first = self._values(*phase_points[self.after], 0)
        return (self._scales(*phase_points[self.before]) * (last - first)).ravel()

    def pattern(
        self, phases: Sequence[LinkedPhase], first: Sequence[int]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return rows, counted from 0, and columns of the Jacobian's entries, (nnz,) each.

        Parameters
        ----------
        phases : sequence of LinkedPhase
            All phases of the program.
        first : sequence of int
            Index of the first variable of each phase.
        """
        last = phases[self.before].end_pattern(-1) + first[self.before]
        begin = phases[self.after].end_pattern(0) + first[self.after]
        columns = np.concatenate([last, begin])
        rows = np.repeat(np.arange(self.size), len(columns))
        return rows, np.tile(columns, self.size)

    def jacobian(self, phase_points: LinkedPoints) -> np.ndarray:
        """Compute the entries of the Jacobian on the pattern, (nnz,)."""
        orders = np.array(self.orders)
        phase, x = phase_points[self.before]
        scales = self._scales(phase, x)[:, :, None]
        last = scales * self._slopes(phase, x, -1)
        first = -scales * self._slopes(*phase_points[self.after], 0)
        # The scales grow with the duration.
        _, growth = phase.last_interval(x)
        rows = self.rows(phase_points).reshape(len(orders), -1)
        last += (orders[:, None] * rows)[:, :, None] * growth
        return np.concatenate([last, first], axis=2).ravel()


@dataclass(frozen=True, eq=False)
class CurveLink(Link):
    """The condition that some curves of the same joint map, with the indices `curves`, are equal.

    Equal curves then mean equal motions.
    """

    curves: tuple[int, ...]

    @property
    def width(self) -> int:
        """Number of curves that are linked."""
        return len(self.curves)

    def _values(self, phase: LinkedPhase, x: np.ndarray, point: int) -> np.ndarray:
        curves = np.array([curves[point] for curves in phase.state(x).curves])
        return curves[np.ix_(self.orders, self.curves)]

    def _slopes(self, phase: LinkedPhase, x: np.ndarray, point: int) -> np.ndarray:
        return phase.end_slopes(x, point)[np.ix_(self.orders, self.curves)]


@dataclass(frozen=True, eq=False)
class PostureLink(Link):
    """The condition that linear combinations of joint positions are equal, whatever the joint maps.

    Attributes
    ----------
    combinations : (k, n) ndarray
        Factors of the first n joints, which both phases have.
    """

    combinations: np.ndarray

    @property
    def width(self) -> int:
        """Number of combinations."""
        return len(self.combinations)

    def sides(
        self, phases: Sequence[LinkedPhase]
    ) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return the numbers of the phase that is changed so that both meet, and of the other, each with its end.

        A move is changed, because its curves are the joints.
        """
        before, after = (self.before, -1), (self.after, 0)
        is_move = phases[self.before].joint_map.is_move
        return (before, after) if is_move else (after, before)

    def combine(self, values: np.ndarray) -> np.ndarray:
        """Return the combinations, (k, ...), of values of the joints, (n or more, ...)."""
        return self.combinations @ values[: self.combinations.shape[1]]

    def _values(self, phase: LinkedPhase, x: np.ndarray, point: int) -> np.ndarray:
        state = phase.state(x)
        motion = (state.q, state.qdot, state.qddot)
        return np.array([self.combine(motion[order][point]) for order in self.orders])

    def _slopes(self, phase: LinkedPhase, x: np.ndarray, point: int) -> np.ndarray:
        state = phase.state(x)
        y, ydot, yddot = phase.end_slopes(x, point)[:3]
        gradient = state.gradient[point]
        by = state.derivatives
        slopes = (
            gradient @ y,
            by.qdot_y[point] @ y + gradient @ ydot,
            by.qddot_y[point] @ y + by.qddot_ydot[point] @ ydot + gradient @ yddot,
        )
        return np.array([self.combine(slopes[order]) for order in self.orders])
