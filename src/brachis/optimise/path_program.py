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
        linked = [
            replace(link, orders=(0,))
            for link in links
            if not (isinstance(link, CurveLink) and link.curves == (0,))
        ]
        first = phases[0]
        if first.phase.boundary.periodic and first.curves_count:
            redundant = tuple(range(1, 1 + first.curves_count))
            linked.append(CurveLink(0, 0, (0,), redundant))
        super().__init__(phases, linked)
        self.start = np.concatenate([phase.start for phase in self.phases])

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

    def meet(self, x: np.ndarray) -> np.ndarray:
        """Return x with the ends of moves exactly where the parts beside them begin or end.

        A solver links postures only to within its tolerance. In an interval of microseconds, the rest would become a
        jump of the torque.
        """
        parts = self.split(x)
        met = [x_of_phase for _, x_of_phase in parts]
        for link in self.links:
            if isinstance(link, PostureLink):
                (moved, end), (kept, place) = link.sides(self.phases)
                phase, x_of_phase = parts[kept]
                q = phase.state(x_of_phase).q[place, : link.combinations.shape[1]]
                met[moved] = self.phases[moved].with_end(met[moved], end, q)
        return np.concatenate(met)

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
