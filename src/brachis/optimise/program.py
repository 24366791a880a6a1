"""The nonlinear program: the best motion in phases, by an objective that is the end time unless said otherwise.

    minimise    objective(x), for example t_E = sum of the phases' durations
    over        x = the variables of the first phase, then of the second, ...
    subject to  lower <= rows(x) <= upper,   x_lower <= x <= x_upper

Rows are those of the phases, one phase after the other, then those of the links. Most motions have one phase and no
links; see `phase`. The objective is a sum over the phases. Where a link joins two phases, both rest.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from brachis.common.summary import Summary
from brachis.kinematics import JointState
from brachis.limits import Bound, Limit, Partials, Role
from brachis.optimise.phase import Motion, Phase


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
        """Duration of a phase, s."""
        return float(x[0])

    def gradient(self, _phase: Phase, x: np.ndarray) -> np.ndarray:
        """1 for the duration, which is the first variable, else 0."""
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
        """Mean over a phase; raises UnreachableError as `Phase.evaluate` does."""
        squares = (phase.state(x).qddot * self.weights) ** 2
        return float(_shares(phase) @ squares.sum(axis=1))

    def gradient(self, phase: Phase, x: np.ndarray) -> np.ndarray:
        """Gradient of the mean, (v,); raises UnreachableError as `Phase.evaluate` does."""
        slopes = 2.0 * _shares(phase)[:, None] * self.weights**2 * phase.state(x).qddot
        return phase.gradient(Partials(qddot=slopes[:, None]), x)


def _shares(phase: Phase) -> np.ndarray:
    """Weights of the trapezoidal rule at the collocation points, (K,)."""
    gaps = np.concatenate([[0.0], np.diff(phase.t_norm), [0.0]])
    return np.asarray(0.5 * (gaps[:-1] + gaps[1:]))


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

    def rows(self, states: Sequence[JointState]) -> np.ndarray:
        """Values of the rows, (j,), from the states of all phases at their collocation points."""
        joints = list(self.joints)
        last = states[self.before].q[-1, joints]
        return np.asarray(last - states[self.after].q[0, joints])

    def _sides(
        self, phases: Sequence[Phase]
    ) -> Iterator[tuple[int, int, np.ndarray, np.ndarray]]:
        """Yield phase, collocation point, the curves whose value is free there, and the variables that these are."""
        for number, point in ((self.before, -1), (self.after, 0)):
            variables = phases[number].end_variables(point)
            free = np.flatnonzero(variables >= 0)
            yield number, point, free, variables[free]

    def pattern(
        self, phases: Sequence[Phase], first: Sequence[int]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rows, from 0, and columns of the Jacobian's entries, (nnz,) each.

        Parameters
        ----------
        phases : sequence of Phase
            All phases of the program.
        first : sequence of int
            Where the variables of each one begin.
        """
        count = len(self.joints)
        rows = []
        columns = []
        for number, _, _, variables in self._sides(phases):
            rows.append(np.repeat(np.arange(count), len(variables)))
            columns.append(np.tile(variables + first[number], count))
        return np.concatenate(rows), np.concatenate(columns)

    def jacobian(
        self, phases: Sequence[Phase], states: Sequence[JointState]
    ) -> np.ndarray:
        """Entries of the Jacobian on the pattern, (nnz,): the joint maps' gradients at the ends."""
        joints = list(self.joints)
        last, first = (
            states[number].gradient[point][joints][:, free].ravel()
            for number, point, free, _ in self._sides(phases)
        )
        return np.concatenate([last, -first])


class Program(Summary):
    """The NLP as functions of x; what a solver sees.

    Parameters
    ----------
    phases : iterable of Phase
    links : sequence of Link, optional
    objective : Objective, optional
        What is minimised; the end time.

    Attributes
    ----------
    phases : tuple of Phase
    links : tuple of Link
    minimised : Objective
    x_lower, x_upper : (v,) ndarray
    lower, upper : (c,) ndarray
        Bounds of the rows.
    jacobian_rows, jacobian_columns : (nnz,) int ndarray
        Fixed sparsity pattern; each place occurs once.
    """

    def summary(self) -> Mapping[str, object]:
        """Return what is shown: its size."""
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
        self.phases = tuple(phases)
        self.links = tuple(links)
        self.minimised = objective or EndTime()
        first = np.cumsum([0, *(phase.variables for phase in self.phases)]).tolist()
        self._parts = [slice(a, b) for a, b in itertools.pairwise(first)]
        self._durations = first[:-1]
        self.x_lower = np.concatenate([phase.x_lower for phase in self.phases])
        self.x_upper = np.concatenate([phase.x_upper for phase in self.phases])
        self.x_upper[self._durations] = self.minimised.longest
        joined = np.zeros(sum(len(link.joints) for link in self.links))
        self.lower = np.concatenate([*(phase.lower for phase in self.phases), joined])
        self.upper = np.concatenate([*(phase.upper for phase in self.phases), joined])
        patterns = [
            (phase.jacobian_rows, phase.jacobian_columns + a)
            for phase, a in zip(self.phases, self._durations, strict=True)
        ]
        patterns += [link.pattern(self.phases, first) for link in self.links]
        heights = [len(phase.lower) for phase in self.phases]
        heights += [len(link.joints) for link in self.links]
        self._first_rows = np.cumsum([0, *heights[:-1]]).tolist()
        pairs = zip(patterns, self._first_rows, strict=True)
        self.jacobian_rows = np.concatenate([rows + a for (rows, _), a in pairs])
        self.jacobian_columns = np.concatenate([columns for _, columns in patterns])

    @property
    def variables(self) -> int:
        """Number of variables."""
        return len(self.x_lower)

    @property
    def intervals(self) -> int:
        """Number of knot intervals of all phases."""
        return sum(phase.intervals for phase in self.phases)

    @property
    def collocation_points(self) -> int:
        """Number of collocation points of all phases."""
        return sum(len(phase.t_norm) for phase in self.phases)

    def split(self, x: np.ndarray) -> list[tuple[Phase, np.ndarray]]:
        """Every phase, and its part of x."""
        pairs = zip(self.phases, self._parts, strict=True)
        return [(phase, x[part]) for phase, part in pairs]

    def end_time(self, x: np.ndarray) -> float:
        """End time t_E, s: the sum of the durations."""
        return float(sum(x[first] for first in self._durations))

    def with_time_scaled(self, x: np.ndarray, factor: float) -> np.ndarray:
        """Return the same motion, every phase longer by a factor."""
        x = x.copy()
        x[self._durations] *= factor
        return x

    def objective(self, x: np.ndarray) -> float:
        """Value to be minimised; raises UnreachableError as `states` does where it depends on the joints."""
        return float(
            sum(self.minimised.value(phase, part) for phase, part in self.split(x))
        )

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Gradient of the objective, (v,); raises as `objective` does."""
        return np.concatenate(
            [self.minimised.gradient(phase, part) for phase, part in self.split(x)]
        )

    def with_objective(self, objective: Objective) -> Program:
        """Return the same program with another objective."""
        return Program(self.phases, self.links, objective)

    def states(self, x: np.ndarray) -> list[JointState]:
        """Joint motion of every phase at its collocation points.

        Raises
        ------
        UnreachableError
            A collocation point is out of the branch's reach.
        """
        return [phase.state(part) for phase, part in self.split(x)]

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Values of the rows, (c,); raises UnreachableError as `states` does."""
        rows = [phase.rows(part) for phase, part in self.split(x)]
        if self.links:
            states = self.states(x)
            rows += [link.rows(states) for link in self.links]
        return np.concatenate(rows)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Entries of the rows' Jacobian on its sparsity pattern, (nnz,); raises UnreachableError as `states` does."""
        entries = [phase.jacobian(part) for phase, part in self.split(x)]
        if self.links:
            states = self.states(x)
            entries += [link.jacobian(self.phases, states) for link in self.links]
        return np.concatenate(entries)

    @property
    def limits(self) -> tuple[Limit, ...]:
        """The limits of all phases, safeguards included, each once."""
        each = {id(limit): limit for phase in self.phases for limit in phase.limits}
        return tuple(each.values())

    def rows_of(self, limit: Limit) -> np.ndarray:
        """Numbers of the rows of a limit, (K, c), at the collocation points of all phases that have it."""
        # The links' rows come behind.
        pairs = zip(self.phases, self._first_rows, strict=False)
        return np.concatenate(
            [first + phase.rows_of(limit) for phase, first in pairs if phase.has(limit)]
        )

    def motions(self, x: np.ndarray) -> list[Motion]:
        """Curves of every phase that belong to x."""
        return [phase.motion(part) for phase, part in self.split(x)]

    def variables_from(self, motions: Sequence[Motion]) -> np.ndarray:
        """Point x nearest to given curves of every phase; see `Phase.variables_from`."""
        pairs = zip(self.phases, motions, strict=True)
        return np.concatenate([phase.variables_from(motion) for phase, motion in pairs])

    def with_phases(self, phases: Iterable[Phase]) -> Program:
        """Return the program with other phases for the present ones, all else as it is."""
        return Program(phases, self.links, self.minimised)

    def with_points(self, t_norm: Sequence[np.ndarray]) -> Program:
        """Return the same program with other collocation points of every phase; see `Phase.with_points`."""
        pairs = zip(self.phases, t_norm, strict=True)
        return self.with_phases(phase.with_points(own) for phase, own in pairs)

    def with_free_knots(self, shortest: float) -> Program:
        """Return the same program with interval lengths as variables; see `Phase.with_free_knots`."""
        return self.with_phases(
            phase.with_free_knots(shortest) for phase in self.phases
        )

    def fix_knots(self, x: np.ndarray) -> tuple[Program, np.ndarray]:
        """Return the program with its knots fixed where they are at x, and the same motion as its point x."""
        other = self.with_phases(phase.fix_knots(part) for phase, part in self.split(x))
        return other, other.variables_from(self.motions(x))

    def without_orders_above(self, order: int) -> Program:
        """Return the same program without limits that ask for a higher derivative; x keeps its meaning."""
        return self.with_phases(
            phase.with_limits([limit for limit in phase.limits if limit.order <= order])
            for phase in self.phases
        )

    def with_margin(self, margin: float) -> Program:
        """Return the same program with another least branch margin; x keeps its meaning."""
        return self.with_phases(phase.with_margin(margin) for phase in self.phases)

    def relax(self, limit: Limit, bound: Bound, amount: float) -> Program:
        """Return the same program with a figure of one of its limits giving way by `amount`, in the figure's unit."""
        other = limit.relax(bound, amount)
        return self.with_phases(
            phase.with_limits(
                [other if each is limit else each for each in phase.limits]
            )
            for phase in self.phases
        )

    @property
    def safeguard_bounds(self) -> tuple[float, ...]:
        """Least values of the safeguards in force: branch margins."""
        own = filter(_is_safeguard, self.limits)
        return tuple(float(bound) for limit in own for bound in limit.lower)

    def safeguard_slack(self, x: np.ndarray) -> float:
        """Smallest distance of a safeguard from its bound; infinite without safeguards.

        Raises UnreachableError as `states` does.
        """
        violations = [
            phase.evaluate(part).violation(_is_safeguard)
            for phase, part in self.split(x)
        ]
        return -float(max(own.max(initial=-np.inf) for own in violations))


def _is_safeguard(limit: Limit) -> bool:
    return limit.role is Role.SAFEGUARD
