"""The NLP over the path of all phases; see `path_phase`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from brachis.optimise.links import CurveLink, Link, PostureLink
from brachis.optimise.path_phase import PathPhase
from brachis.optimise.phase_timing import PhaseTiming
from brachis.optimise.program import PhaseSequence


class PathProgram(PhaseSequence[PathPhase]):
    """The NLP over the path of all phases, as a `NonlinearProgram` for the solvers.

    Parameters
    ----------
    phases : sequence of PathPhase
    links : sequence of Link
        Links between phases. They link only values, because phases meet at rest.
    """

    def __init__(self, phases: Sequence[PathPhase], links: Sequence[Link]) -> None:
        super().__init__(phases)
        first = self.first_variables
        self.start = np.concatenate([phase.start for phase in self.phases])
        # Phases meet at rest.
        self._links = [
            link for link in links if isinstance(link, PostureLink) and 0 in link.orders
        ]
        joins = [
            (link.before, link.after, link.curves)
            for link in links
            if isinstance(link, CurveLink)
        ]
        if self.phases[0].phase.boundary.periodic:
            joins.append((0, 0, tuple(range(1, 1 + self.phases[0].curves_count))))
        pairs = [
            (
                first[before] + self.phases[before].places_at(-1)[curve - 1],
                first[after] + self.phases[after].places_at(0)[curve - 1],
            )
            for before, after, curves in joins
            for curve in curves
            if curve > 0
        ]
        self._pairs = np.reshape(np.array(pairs, dtype=int), (-1, 2))
        row = 0
        rows = []
        columns = []
        for phase, column in zip(self.phases, first, strict=True):
            rows.append(phase.jacobian_rows + row)
            columns.append(phase.jacobian_columns + column)
            row += len(phase.lower)
        numbers = row + np.arange(len(self._pairs))
        rows.append(np.repeat(numbers, 2))
        columns.append(self._pairs.ravel())
        row += len(self._pairs)
        for link in self._links:
            places = [
                first[number] + self.phases[number].places_at(end)
                for number, end in ((link.before, -1), (link.after, 0))
            ]
            at_ends = np.concatenate(places)
            numbers = row + np.arange(link.width)
            rows.append(np.repeat(numbers, len(at_ends)))
            columns.append(np.tile(at_ends, link.width))
            row += link.width
        self.value_numbers = self._number_values()
        self.jacobian_rows = np.concatenate(rows)
        self.jacobian_columns = np.concatenate(columns)

    def _number_values(self) -> np.ndarray:
        """Give each limit value of a phase, and each join, a number; return the number for each row, (c,)."""
        numbers = []
        first = 0
        for phase in self.phases:
            numbers.append(first + phase.value_numbers)
            first = 1 + int(numbers[-1].max(initial=first - 1))
        return np.concatenate([*numbers, first + np.arange(self._joined)])

    @property
    def _joined(self) -> int:
        """Number of rows of links."""
        return len(self._pairs) + sum(link.width for link in self._links)

    @property
    def lower(self) -> np.ndarray:
        """Lower bounds of the rows, (c,)."""
        joined = np.zeros(self._joined)
        return np.concatenate([*(phase.lower for phase in self.phases), joined])

    @property
    def upper(self) -> np.ndarray:
        """Upper bounds of the rows, (c,)."""
        joined = np.zeros(self._joined)
        return np.concatenate([*(phase.upper for phase in self.phases), joined])

    def narrow(self, x: np.ndarray) -> float:
        """Narrow limits on postures in all phases; see `PathPhase.narrow`."""
        return max(phase.narrow(x_of_phase) for phase, x_of_phase in self.split(x))

    def objective(self, x: np.ndarray) -> float:
        """Return the total time of all phases, s."""
        return sum(phase.time(x_of_phase) for phase, x_of_phase in self.split(x))

    end_time = objective
    free_time = objective

    def gradient(self, x: np.ndarray) -> np.ndarray:
        """Return the gradient of the time, (v,)."""
        return np.concatenate(
            [phase.gradient(x_of_phase) for phase, x_of_phase in self.split(x)]
        )

    def curvature(self, _x: np.ndarray) -> None:
        """Return None, because no part of the Hessian is known."""

    def rows(self, x: np.ndarray) -> np.ndarray:
        """Compute the values of the rows, (c,); raise UnreachableError if the joint map has no posture."""
        before, after = x[self._pairs].T
        parts = self.split(x)
        rows = [phase.rows(x_of_phase) for phase, x_of_phase in parts]
        rows.append(before - after)
        for link in self._links:
            last, first = (
                link.combine(phase.evaluate(x_of_phase).motion.q[end])
                for (phase, x_of_phase), end in self._sides(link, parts)
            )
            rows.append(last - first)
        return np.concatenate(rows)

    def meet(self, x: np.ndarray) -> np.ndarray:
        """Return x with the ends of moves exactly where the parts beside them begin or end.

        A solver links postures only to within its tolerance. In an interval of microseconds, the rest would become a
        jump of the torque.
        """
        x = x.copy()
        for link in self._links:
            sides = [(link.before, -1), (link.after, 0)]
            is_move = self.phases[link.before].phase.joint_map.is_move
            (moved, end), (kept, place) = sides if is_move else sides[::-1]
            phase, x_of_phase = self.split(x)[kept]
            q = phase.evaluate(x_of_phase).motion.q[place]
            path_phase = self.phases[moved]
            joint_map = path_phase.phase.joint_map
            y = joint_map.coordinates(path_phase.ends[end], q[: joint_map.robot.n])
            x[self.first_variables[moved] + path_phase.places_at(end)] = y[1:]
        return x

    @staticmethod
    def _sides(
        link: Link, parts: Sequence[tuple[PathPhase, np.ndarray]]
    ) -> tuple[tuple[tuple[PathPhase, np.ndarray], int], ...]:
        """Return the phases on both sides of a link, with their variables, each with the place of the link."""
        return (parts[link.before], -1), (parts[link.after], 0)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Compute the entries of the Jacobian on its pattern, (nnz,); raise as `rows` does."""
        parts = self.split(x)
        entries = [phase.jacobian(x_of_phase) for phase, x_of_phase in parts]
        entries.append(np.tile([1.0, -1.0], len(self._pairs)))
        for link in self._links:
            last, first = (
                link.combine(phase.evaluate(x_of_phase).motion.gradient[end, :, 1:])
                for (phase, x_of_phase), end in self._sides(link, parts)
            )
            entries.append(np.hstack([last, -first]).ravel())
        return np.concatenate(entries)

    def curves(self, x: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return s and the redundant curves of all phases at many places, (S, c) each."""
        return tuple(phase.curves(x_of_phase) for phase, x_of_phase in self.split(x))

    def timings(
        self, x: np.ndarray, places: int, *, is_rough: bool
    ) -> tuple[PhaseTiming, ...]:
        """Time the joint paths of all phases again with `PhaseTiming.along`."""
        courses = [
            partial(path_phase.course, x_of_phase)
            for path_phase, x_of_phase in self.split(x)
        ]
        pairs = zip(self.phases, courses, strict=True)
        return tuple(
            PhaseTiming.along(
                path_phase.phase, course, path_phase.ends, places, is_rough=is_rough
            )
            for path_phase, course in pairs
        )
