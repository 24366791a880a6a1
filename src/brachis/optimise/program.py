"""The nonlinear program for the best motion in phases. By default the objective is the end time.

    minimise    objective(x), for example t_E = sum of the phases' durations
    over        x = the variables of the first phase, then of the second, ...
    subject to  lower <= rows(x) <= upper,   x_lower <= x <= x_upper

First come the rows of the phases, one phase after the other, then the rows of the links, then the means over the whole
motion. Most motions have one phase and no links; see `phase`. The objective is a sum over the phases.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Generic, Protocol, TypeVar

import numpy as np

from brachis.common.summary import Summary
from brachis.kinematics import JointState
from brachis.limits import Bound, Limit, Role
from brachis.optimise.backends import Curvature, ProgramRows
from brachis.optimise.evaluator import Evaluation
from brachis.optimise.links import Link, LinkedPhase
from brachis.optimise.means import Means
from brachis.optimise.motion import Motion
from brachis.optimise.objective import EndTime, Objective
from brachis.optimise.phase import Phase


class _PhaseWithRows(LinkedPhase, ProgramRows, Protocol):
    """A phase of a program over time or over the path."""

    @property
    def value_rows(self) -> Sequence[np.ndarray]:
        """Indices of the rows of the limits' values, (K, c) each; a column belongs to one value."""

    def evaluate(self, x: np.ndarray) -> Evaluation:
        """Evaluate joint motion and limits at given variables of the phase, (v,)."""


_Phase = TypeVar("_Phase", bound=_PhaseWithRows)


def _position(limits: Sequence[Limit], limit: Limit) -> int | None:
    """Return the index of a limit, None if it is not there. Limits of users may define what equal means."""
    return next((number for number, other in enumerate(limits) if other is limit), None)


class PhaseSequence(Generic[_Phase]):
    """Successive phases and the links between them, with the variables and the rows of all of them.

    Parameters
    ----------
    phases : iterable of Phase or PathPhase
    links : iterable of Link

    Attributes
    ----------
    phases : tuple of Phase or PathPhase
    links : tuple of Link
    x_lower, x_upper : (v,) ndarray
        Bounds of the variables.
    first_variables : list of int
        Index of the first variable of each phase.
    """

    def __init__(self, phases: Iterable[_Phase], links: Iterable[Link]) -> None:
        self.phases = tuple(phases)
        self.links = tuple(links)
        first = np.cumsum([0, *(len(phase.x_lower) for phase in self.phases)]).tolist()
        self.first_variables = first[:-1]
        self._blocks = [slice(a, b) for a, b in itertools.pairwise(first)]
        self.x_lower = np.concatenate([phase.x_lower for phase in self.phases])
        self.x_upper = np.concatenate([phase.x_upper for phase in self.phases])
        heights = [len(phase.lower) for phase in self.phases]
        sizes = [link.size for link in self.links]
        self._first_rows = np.cumsum([0, *heights, *sizes]).tolist()
        self._joined = np.zeros(sum(sizes))

    @property
    def lower(self) -> np.ndarray:
        """Lower bounds of the rows, (c,)."""
        return np.concatenate([*(phase.lower for phase in self.phases), self._joined])

    @property
    def upper(self) -> np.ndarray:
        """Upper bounds of the rows, (c,)."""
        return np.concatenate([*(phase.upper for phase in self.phases), self._joined])

    @cached_property
    def _pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the entries of the Jacobian, computed on demand because many programs never need them."""
        firsts = self.first_variables
        patterns = [
            (phase.jacobian_rows, phase.jacobian_columns + first)
            for phase, first in zip(self.phases, firsts, strict=True)
        ]
        patterns += [link.pattern(self.phases, firsts) for link in self.links]
        pairs = zip(patterns, self._first_rows, strict=False)
        rows = [rows + first for (rows, _), first in pairs]
        columns = [columns for _, columns in patterns]
        return np.concatenate(rows), np.concatenate(columns)

    @property
    def jacobian_rows(self) -> np.ndarray:
        """Row of each entry of the Jacobian, (nnz,). Each place occurs once."""
        return self._pattern[0]

    @property
    def jacobian_columns(self) -> np.ndarray:
        """Column of each entry of the Jacobian, (nnz,)."""
        return self._pattern[1]

    @cached_property
    def value_numbers(self) -> np.ndarray:
        """Number of the limit value in each row, (c,), the same at all points of a phase. Other rows have their own."""
        numbers = np.arange(len(self.lower))
        for phase, first in zip(self.phases, self._first_rows, strict=False):
            for rows in phase.value_rows:
                numbers[first + rows] = first + rows[:1]
        return numbers

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Compute the values of the rows, (c,); raise UnreachableError if the joint map has no posture."""
        phase_points = self.split(x)
        rows = [phase.rows(x_of_phase) for phase, x_of_phase in phase_points]
        rows += [link.rows(phase_points) for link in self.links]
        return np.concatenate(rows)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Compute the entries of the rows' Jacobian on its pattern, (nnz,); raise as `rows` does."""
        phase_points = self.split(x)
        entries = [phase.jacobian(x_of_phase) for phase, x_of_phase in phase_points]
        entries += [link.jacobian(phase_points) for link in self.links]
        return np.concatenate(entries)

    def split(self, x: np.ndarray) -> list[tuple[_Phase, np.ndarray]]:
        """Return each phase with its part of x."""
        pairs = zip(self.phases, self._blocks, strict=True)
        return [(phase, x[block]) for phase, block in pairs]

    def safeguard_slack(self, x: np.ndarray) -> float:
        """Return the smallest distance of a safeguard from its bound; infinite without safeguards.

        Raises
        ------
        UnreachableError
            A collocation point is out of the branch's reach.
        """
        states = [phase.evaluate(x_of_phase) for phase, x_of_phase in self.split(x)]
        violations = [state.violation(is_safeguard) for state in states]
        return -float(max(violation.max(initial=-np.inf) for violation in violations))


class Program(PhaseSequence[Phase], Summary):
    """The NLP as functions of x, in the form in which solvers use it.

    Parameters
    ----------
    phases : iterable of Phase
    links : sequence of Link, optional
    objective : Objective, optional
        Objective to minimise; by default the end time.

    Attributes
    ----------
    phases : tuple of Phase
    links : tuple of Link
    minimised : Objective
    means : Means
        Means, over the motion, of the values whose means are limited.
    x_lower, x_upper : (v,) ndarray
    lower, upper : (c,) ndarray
        Bounds of the rows.
    """

    def summary(self) -> Mapping[str, object]:
        """Return the figures shown to the user: the size of the program."""
        return {
            "phases": len(self.phases),
            "intervals": self.intervals,
            "collocation points": self.collocation_points,
            "variables": self.variables,
            "rows": len(self.lower),
        }

    def __init__(
        self,
        phases: Iterable[Phase],
        links: Sequence[Link] = (),
        objective: Objective | None = None,
    ) -> None:
        super().__init__(phases, links)
        self.minimised = objective or EndTime()
        durations = self.first_variables
        longest = np.broadcast_to(self.minimised.longest, len(self.phases))
        self.x_upper[durations] = np.minimum(self.x_upper[durations], longest)
        self.means = Means(self.phases[0].limits)
        self._mean_rows = slice(self._first_rows[-1], None)

    @cached_property
    def lower(self) -> np.ndarray:
        """Lower bounds of the rows, (c,)."""
        return np.append(super().lower, self.means.lower)

    @cached_property
    def upper(self) -> np.ndarray:
        """Upper bounds of the rows, (c,)."""
        return np.append(super().upper, self.means.upper)

    @cached_property
    def _pattern(self) -> tuple[np.ndarray, np.ndarray]:
        rows, columns = super()._pattern
        row, column = np.indices((len(self.means), self.variables)).reshape(2, -1)
        return np.append(rows, self._first_rows[-1] + row), np.append(columns, column)

    @property
    def names(self) -> list[str]:
        """Names of the variables by their index in x, with the phase if there are several; see `Phase.names`."""
        if len(self.phases) == 1:
            return self.phases[0].names
        return [
            f"{name} of phase {number}"
            for number, phase in enumerate(self.phases, 1)
            for name in phase.names
        ]

    @property
    def variables(self) -> int:
        """Number of variables."""
        return len(self.x_lower)

    @property
    def intervals(self) -> int:
        """Total number of knot intervals of all phases."""
        return sum(phase.intervals for phase in self.phases)

    @property
    def has_free_knots(self) -> bool:
        """Whether interval lengths are variables."""
        return any(len(phase.grid.lower) for phase in self.phases)

    @property
    def collocation_points(self) -> int:
        """Total number of collocation points of all phases."""
        return sum(len(phase.t_norm) for phase in self.phases)

    def end_time(self, x: np.ndarray) -> float:
        """Return the end time t_E, s: the sum of the durations and the pauses."""
        pauses = sum(phase.pause for phase in self.phases)
        return float(sum(x[first] for first in self.first_variables) + pauses)

    def free_time(self, x: np.ndarray) -> float:
        """Return the sum of the durations that are free, s."""
        return float(
            sum(
                x_of_phase[0]
                for phase, x_of_phase in self.split(x)
                if phase.time_law is None
            )
        )

    def scale_time(self, x: np.ndarray, factor: float) -> np.ndarray:
        """Return the same motion with all durations, except given ones, longer by a factor."""
        return np.concatenate(
            [
                phase.scale_time(x_of_phase, factor, self.held_orders(number))
                for number, (phase, x_of_phase) in enumerate(self.split(x))
            ]
        )

    def held_orders(self, number: int) -> tuple[int, int]:
        """Return the highest order of derivative at each end of a phase that a link to a phase of given time fixes."""
        first = 0
        last = 0
        for link in self.links:
            if link.after == number and self.phases[link.before].time_law is not None:
                first = max(first, *link.orders)
            if link.before == number and self.phases[link.after].time_law is not None:
                last = max(last, *link.orders)
        return first, last

    def objective(self, x: np.ndarray) -> float:
        """Return the value to minimise. If it depends on the joints, raise UnreachableError as `states` does."""
        return float(
            sum(
                self.minimised.value(phase, x_of_phase)
                for phase, x_of_phase in self.split(x)
            )
        )

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Return the gradient of the objective, (v,); raise as `objective` does."""
        return np.concatenate(
            [
                self.minimised.gradient(phase, x_of_phase)
                for phase, x_of_phase in self.split(x)
            ]
        )

    def with_objective(self, objective: Objective) -> Program:
        """Return the same program with a different objective."""
        return Program(self.phases, self.links, objective)

    def states(self, x: np.ndarray) -> list[JointState]:
        """Return the joint motion of every phase at its collocation points.

        Raises
        ------
        UnreachableError
            A collocation point is out of the branch's reach.
        """
        return [phase.state(x_of_phase) for phase, x_of_phase in self.split(x)]

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Compute the values of the rows, (c,); raise UnreachableError as `states` does."""
        return np.append(super().rows(x), self.means.values(self.split(x)))

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Compute the entries of the rows' Jacobian on its sparsity pattern, (nnz,); raise as `states` does."""
        return np.append(super().jacobian(x), self.means.slopes(self.split(x)))

    def curvature(self, x: np.ndarray) -> Curvature | None:
        """Return the part of the Hessian due to squares in the objective and in means; None if there are no squares."""
        is_curved = any(map(self.minimised.is_curved, self.phases))
        if not (is_curved or len(self.means)):
            return None
        # Squared accelerations fall with the fourth power of the time T, so dT/d(mean) = -T/4 if the mean is 1.
        guess = np.zeros(len(self.lower))
        if len(self.means):
            guess[self._mean_rows] = -0.25 * self.end_time(x) / len(self.means)
        return Curvature(self._find_hessian, guess)

    def _find_hessian(
        self, x: np.ndarray, objective_multiplier: float, multipliers: np.ndarray
    ) -> np.ndarray:
        """Return the Gauss-Newton part for given multipliers of objective and rows."""
        weights = -multipliers[self._mean_rows].clip(max=0.0)
        hessian = self.means.curvature(self.split(x), weights)
        for (phase, x_of_phase), block in zip(self.split(x), self._blocks, strict=True):
            if self.minimised.is_curved(phase):
                curved = self.minimised.curvature(phase, x_of_phase)
                hessian[block, block] += objective_multiplier * curved
        return hessian

    @property
    def limits(self) -> tuple[Limit, ...]:
        """The limits of all phases, safeguards included, each once."""
        limits = {id(limit): limit for phase in self.phases for limit in phase.limits}
        return tuple(limits.values())

    def rows_of(self, limit: Limit) -> np.ndarray:
        """Return the indices of the rows of a limit, (K, c), at the collocation points of all phases with this limit.

        For a limit on means, the result is a single row of indices, (1, c).
        """
        if limit.guarantee.is_mean:
            limits = self.means.limits
            number = _position(limits, limit)
            before = sum(len(earlier.lower) for earlier in limits[:number])
            first = self._first_rows[-1] + before
            return np.arange(first, first + len(limit.lower))[None]
        pairs = zip(self.phases, self._first_rows, strict=False)
        return np.concatenate(
            [
                first + phase.value_rows[number]
                for phase, first in pairs
                if (number := _position(phase.limits, limit)) is not None
            ]
        )

    @cached_property
    def third_order_rows(self) -> list[int]:
        """Indices of the rows of limits on third derivatives, such as jerks."""
        pairs = zip(self.phases, self._first_rows, strict=False)
        return [
            int(first + row)
            for phase, first in pairs
            for limit, rows in zip(phase.limits, phase.value_rows, strict=True)
            if limit.order > 2
            for row in rows.ravel()
        ]

    def motions(self, x: np.ndarray) -> list[Motion]:
        """Return the curves of every phase that belong to x."""
        return [phase.motion(x_of_phase) for phase, x_of_phase in self.split(x)]

    def variables_from(self, motions: Sequence[Motion]) -> np.ndarray:
        """Return the point x closest to given curves of every phase; see `Phase.variables_from`."""
        pairs = zip(self.phases, motions, strict=True)
        return np.concatenate([phase.variables_from(motion) for phase, motion in pairs])

    def with_phases(self, phases: Iterable[Phase]) -> Program:
        """Return the same program with different phases."""
        return Program(phases, self.links, self.minimised)

    @property
    def has_time_laws(self) -> bool:
        """Whether the speed of a phase is given."""
        return any(phase.time_law is not None for phase in self.phases)

    @property
    def flies(self) -> bool:
        """Whether a phase begins or ends at a speed that is free."""
        return any(any(phase.boundary.are_speeds_free) for phase in self.phases)

    def at_rest(self) -> Program:
        """Return the same program with rest in place of free speeds."""
        if not self.flies:
            return self
        phases = [
            phase.with_grid(phase.grid, phase.boundary.with_speeds())
            for phase in self.phases
        ]
        links = [replace(link, orders=(0,)) for link in self.links if 0 in link.orders]
        return Program(phases, links)

    def with_points(self, t_norm: Sequence[np.ndarray]) -> Program:
        """Return the same program with new collocation points in every phase; see `Phase.with_points`."""
        pairs = zip(self.phases, t_norm, strict=True)
        return self.with_phases(phase.with_points(times) for phase, times in pairs)

    def with_free_knots(self, shortest: float) -> Program:
        """Return the same program with interval lengths as variables; see `Phase.with_free_knots`."""
        return self.with_phases(
            phase.with_free_knots(shortest) for phase in self.phases
        )

    def fix_knots(self, x: np.ndarray) -> tuple[Program, np.ndarray]:
        """Return the program with its knots fixed at their positions for x, and the point that is the same motion."""
        fixed = self.with_phases(
            phase.fix_knots(x_of_phase) for phase, x_of_phase in self.split(x)
        )
        return fixed, fixed.variables_from(self.motions(x))

    def with_margin(self, margin: float) -> Program:
        """Return the same program with a different minimum branch margin. The meaning of x is unchanged."""
        return self.with_phases(phase.with_margin(margin) for phase in self.phases)

    def relax(self, limit: Limit, bound: Bound, amount: float) -> Program:
        """Return the same program with one bound of a limit relaxed by `amount`, in the unit of the bound."""
        relaxed = limit.relax(bound, amount)
        return self.with_phases(
            phase.with_limits(
                [
                    relaxed if candidate is limit else candidate
                    for candidate in phase.limits
                ]
            )
            for phase in self.phases
        )


def is_safeguard(limit: Limit) -> bool:
    """Tell whether a limit is a safeguard, which only keeps the solve on its branch."""
    return limit.role is Role.SAFEGUARD
