"""The best value known: the same problem with discontinuous torque allowed, on a fine mesh.

Rest means zero velocity only, and the splines have many more intervals than the answer, so that torques may leave their
static values at once and switch as fast as the mesh allows. Cubic splines and parabolas, whose torques jump at every
knot, are both tried from the answer, and the faster motion within the limits counts. Redundant joints and branch stay.
It is the best value known for them and no proven bound: it is another local optimum, on a mesh that is finite still.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.bspline import basis_matrix
from brachis.errors import UnreachableError
from brachis.nlp import Transcription
from brachis.nlp.guess import stretched
from brachis.nlp.transcription import Motion
from brachis.refine import Refined, RefinementOptions, Solve, refine
from brachis.solvers import SolverOptions, SolverReport, solver_named

INTERVALS = 100
"""Least number of intervals of the fine mesh."""
MEANING = "the same problem with discontinuous torque allowed; the best value known, not a proven bound"
_DEGREES = (3, 2)
_POINTS = 3
_BESIDE = 1e-6
"""Parabolas are looked at this much of the whole time before every knot, too: their accelerations jump there."""
_DENSE = 30
_ITERATIONS = 200
_SECONDS = 4.0
"""Of one solve."""
_LEAST_SECONDS = 0.1
_BACKENDS = 2


@dataclass(frozen=True)
class Reference:
    """The best value known.

    Attributes
    ----------
    t_end : float
        s.
    distance : float
        How much longer the motion takes, as a fraction of `t_end`.
    degree, intervals : int
        Of the splines that gave it.
    excess : float
        Largest excess over a limit on a dense grid, as a fraction of it.
    wall_time : float
        s.
    refined : Refined
        The problem and its answer.
    """

    t_end: float
    distance: float
    degree: int
    intervals: int
    excess: float
    wall_time: float
    refined: Refined

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "meaning": MEANING,
            "t_end_s": self.t_end,
            "distance": self.distance,
            "degree": self.degree,
            "intervals": self.intervals,
            "excess": self.excess,
            "wall_time_s": self.wall_time,
        }


def find_reference(
    refined: Refined, *, tolerance: float = 1e-4, intervals: int = INTERVALS, time_limit: float = 10.0
) -> Reference | None:
    """Plan again with rest: velocity on a fine mesh, from the answer found.

    Parameters
    ----------
    refined : Refined
        ``result.attempt.refined``.
    tolerance : float, optional
        Largest excess over a limit, as a fraction of it.
    intervals : int, optional
        Least number of intervals; a multiple of the answer's own number is taken, so that the mesh contains its knots.
    time_limit : float, optional
        After this time no further solve is begun, s.

    Returns
    -------
    Reference or None
        None where no motion faster than the answer was found.
    """
    began = time.perf_counter()
    problem = refined.problem
    own = len(np.unique(problem.knots)) - 1
    count = own * -(-intervals // own)
    motion = problem.motion(refined.x)
    found: list[tuple[float, Refined, float]] = []
    for degree in _DEGREES:
        answer = _planned(_on_mesh(problem, degree, count), motion, tolerance, began + time_limit)
        if answer is None:
            continue
        excess = _excess(answer.problem, answer.x)
        if excess <= tolerance and answer.x[0] < motion.t_end:
            found.append((float(answer.x[0]), answer, excess))
    if not found:
        return None
    t_end, answer, excess = min(found, key=lambda each: each[0])
    distance = motion.t_end / t_end - 1.0
    return Reference(t_end, distance, answer.problem.degree, count, excess, time.perf_counter() - began, answer)


def _on_mesh(problem: Transcription, degree: int, intervals: int) -> Transcription:
    """Return the problem on a uniform mesh, with rest in velocity alone and the same branch margins."""
    tau = np.linspace(0.0, 1.0, _POINTS * intervals + 1)
    if degree == min(_DEGREES):
        tau = np.union1d(tau, np.arange(1, intervals) / intervals - _BESIDE)
    fine = Transcription(
        problem.decomposition, degree=degree, intervals=intervals, derivatives_at_rest=1, tau=tau, end=_end_of(problem)
    )
    return fine.with_margin(max(problem.guards)) if problem.guards else fine


def _end_of(problem: Transcription) -> np.ndarray | None:
    """End posture, (n,), as far as it is given: its redundant joints; None where it is free."""
    redundant = problem.splines[1:]
    if not redundant or redundant[0].variable[-1] >= 0:
        return None
    end = problem.decomposition.start.copy()
    end[problem.decomposition.redundant] = [spline.fixed[-1] for spline in redundant]
    return end


def _planned(problem: Transcription, motion: Motion, tolerance: float, deadline: float) -> Refined | None:
    """Solve and refine with one backend after the other, until one ends well."""
    try:
        x = stretched(problem, _fitted(problem, motion))
    except UnreachableError:
        return None
    for backend in solver_named("auto")[:_BACKENDS]:
        solve = _bounded(backend.solve, deadline)
        try:
            first = solve(problem, x)
        except ImportError:
            continue
        if first.status.usable:
            return refine(problem, first, solve, RefinementOptions(tolerance=tolerance))
    return None


def _bounded(backend: Callable[..., SolverReport], deadline: float) -> Solve:
    def solve(problem: Transcription, x: np.ndarray) -> SolverReport:
        seconds = float(np.clip(deadline - time.perf_counter(), _LEAST_SECONDS, _SECONDS))
        return backend(problem, x, SolverOptions(max_iterations=_ITERATIONS, time_limit=seconds), None)

    return solve


def _fitted(problem: Transcription, motion: Motion) -> np.ndarray:
    """Point x whose curves are nearest to a motion's, by least squares; exact where the mesh contains its knots."""
    tau = np.linspace(0.0, 1.0, 4 * len(problem.knots))
    wanted = motion.at(tau * motion.t_end)[0]
    basis = basis_matrix(problem.knots, problem.degree, tau).toarray()
    parts = [np.array([motion.t_end])]
    for spline, values in zip(problem.splines, wanted.T, strict=True):
        tied = np.zeros((len(spline.variable), spline.free))
        kept = np.flatnonzero(spline.variable >= 0)
        tied[kept, spline.variable[kept]] = 1.0
        parts.append(np.linalg.lstsq(basis @ tied, values - basis @ spline.fixed, rcond=None)[0])
    return np.clip(np.concatenate(parts), problem.x_lower, problem.x_upper)


def _excess(problem: Transcription, x: np.ndarray) -> float:
    """Largest excess over a limit on a dense grid and on both sides of every knot; infinite where out of reach."""
    knots = np.unique(problem.knots)
    grid = np.linspace(0.0, 1.0, _DENSE * (len(knots) - 1) + 1)
    tau = np.unique(np.concatenate([grid, knots, knots[1:] - 1e-9, knots[:-1] + 1e-9]))
    try:
        return float(problem.excess_at(x, tau).max())
    except UnreachableError:
        return np.inf
