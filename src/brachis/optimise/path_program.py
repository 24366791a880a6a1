"""The NLP over the path of all phases; see `path_phase`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
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
        Links between phases. Only their values are linked here.
    """

    def __init__(self, phases: Sequence[PathPhase], links: Sequence[Link]) -> None:
        super().__init__(phases)
        first = self.first_variables
        self.start = np.concatenate([phase.start for phase in self.phases])
        self._links = [
            replace(link, orders=(0,))
            for link in links
            if not (isinstance(link, CurveLink) and link.curves == (0,))
        ]
        if self.phases[0].phase.boundary.periodic and self.phases[0].curves_count:
            redundant = tuple(range(1, 1 + self.phases[0].curves_count))
            self._links.append(CurveLink(0, 0, (0,), redundant))
        row = 0
        rows = []
        columns = []
        patterns = [
            *(
                (phase.jacobian_rows, phase.jacobian_columns + column)
                for phase, column in zip(self.phases, first, strict=True)
            ),
            *(link.pattern(self.phases, first) for link in self._links),
        ]
        heights = [
            *(len(phase.lower) for phase in self.phases),
            *(link.size for link in self._links),
        ]
        for (rows_of_block, columns_of_block), height in zip(
            patterns, heights, strict=True
        ):
            rows.append(rows_of_block + row)
            columns.append(columns_of_block)
            row += height
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
        return sum(link.size for link in self._links)

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
        parts = self.split(x)
        rows = [phase.rows(x_of_phase) for phase, x_of_phase in parts]
        rows += [link.rows(parts) for link in self._links]
        return np.concatenate(rows)

    def meet(self, x: np.ndarray) -> np.ndarray:
        """Return x with the ends of moves exactly where the parts beside them begin or end.

        A solver links postures only to within its tolerance. In an interval of microseconds, the rest would become a
        jump of the torque.
        """
        parts = self.split(x)
        met = [x_of_phase for _, x_of_phase in parts]
        for link in self._links:
            if isinstance(link, PostureLink):
                (moved, end), (kept, place) = link.sides(self.phases)
                phase, x_of_phase = parts[kept]
                q = phase.state(x_of_phase).q[place, : link.combinations.shape[1]]
                met[moved] = self.phases[moved].with_end(met[moved], end, q)
        return np.concatenate(met)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Compute the entries of the Jacobian on its pattern, (nnz,); raise as `rows` does."""
        parts = self.split(x)
        entries = [phase.jacobian(x_of_phase) for phase, x_of_phase in parts]
        entries += [link.jacobian(parts) for link in self._links]
        return np.concatenate(entries)

    def curves(self, x: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return s and the redundant curves of all phases at many places, (S, c) each."""
        return tuple(phase.curves(x_of_phase) for phase, x_of_phase in self.split(x))

    def timings(
        self, x: np.ndarray, places: int, *, is_rough: bool
    ) -> tuple[PhaseTiming, ...]:
        """Time the joint paths of all phases again with `PhaseTiming.along`."""
        return tuple(
            PhaseTiming.along(
                path_phase.phase,
                partial(path_phase.course, x_of_phase),
                path_phase.ends,
                places,
                is_rough=is_rough,
            )
            for path_phase, x_of_phase in self.split(x)
        )
