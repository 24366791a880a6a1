"""The best value known: the same problem with discontinuous torque allowed, on a fine mesh.

Rest means zero velocity only, and the splines have many more intervals than the answer, so that torques may leave
their static values at once and switch as fast as the mesh allows. Cubic splines are tried on the answer's own mesh and
then on finer ones, each from the motion before, at last parabolas, whose torques jump at every knot; the fastest motion
within the limits counts. Redundant joints and branch stay. It is the best value known for them and no proven bound: it
is another local optimum, on a mesh that is finite still.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from brachis.bspline import clamped_uniform_knots
from brachis.errors import UnreachableError
from brachis.limits import Role
from brachis.nlp import Motion, Transcription
from brachis.nlp.guess import fitted, stretched, worst_time_scaling_ratio
from brachis.refine import Refined, RefinementOptions, Solve, refine
from brachis.solvers import SolverOptions, SolverReport, SolveStatus, solver_named

INTERVALS = 100
"""Number of intervals of the fine mesh for one redundant joint, rounded to a multiple of the answer's own."""
MEANING = "the same problem with discontinuous torque allowed; the best value known, not a proven bound"
_CUBICS, _PARABOLAS = 3, 2
_POINTS = 3
_BESIDE = 1e-6
"""Parabolas are looked at this much of the whole time before every knot, too: their accelerations jump there."""
_DENSE = 30
_FIT_DENSITY = 4
_AS_GOOD = 1.001
"""A start beyond its limits by less needs no longer time: solvers mend that themselves."""
_ITERATIONS = 200
_SECONDS = 2.5
"""Of one solve."""
_LEAST_SECONDS = 0.1
_BACKENDS = 2
_ROUNDS = 4
"""What still exceeds a limit between collocation points costs some 1e-4 of the time; further solves cost seconds."""


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
    refined: Refined, *, tolerance: float = 1e-4, intervals: int = INTERVALS, time_limit: float = 8.0
) -> Reference | None:
    """Plan again with rest: velocity on a fine mesh, from the answer found.

    Parameters
    ----------
    refined : Refined
        ``result.attempt.refined``.
    tolerance : float, optional
        Largest excess over a limit, as a fraction of it.
    intervals : int, optional
        Of the fine mesh, about; a multiple of the answer's own number is taken, so that its mesh is contained in it.
    time_limit : float, optional
        After this time no further solve is begun, s.

    Returns
    -------
    Reference or None
        None where no motion faster than the answer was found.
    """
    with ThreadpoolController().limit(limits=1, user_api="blas"):  # as in `plan`: batches are small
        return _found(refined, tolerance, intervals, time_limit)


def _found(refined: Refined, tolerance: float, intervals: int, time_limit: float) -> Reference | None:
    """Try one mesh after the other."""
    began = time.perf_counter()
    problem = refined.problem
    own = len(np.unique(problem.knots)) - 1
    slowest, motion = float(refined.x[0]), problem.motion(refined.x)
    best: Reference | None = None
    for degree, count in _meshes(own, _fine(problem, own, intervals)):
        if best is not None and time.perf_counter() > began + time_limit:
            break
        answer = _planned(_on_mesh(problem, degree, count), motion, tolerance, began + time_limit)
        excess = np.inf if answer is None else _excess(answer.problem, answer.x)
        if answer is None or excess > tolerance or answer.x[0] >= motion.t_end:
            continue
        motion = answer.problem.motion(answer.x)
        best = Reference(motion.t_end, slowest / motion.t_end - 1.0, degree, count, excess, 0.0, answer)
    return None if best is None else dataclasses.replace(best, wall_time=time.perf_counter() - began)


def _fine(problem: Transcription, own: int, intervals: int) -> int:
    """Return a multiple of the answer's number of intervals, at least twice; fewer with several redundant joints.

    A step of the active-set method takes seconds where there are many more variables.
    """
    return own * max(2, intervals // (own * max(1, problem.decomposition.r)))


def _meshes(own: int, fine: int) -> tuple[tuple[int, int], ...]:
    """List degrees and numbers of intervals in the order of trying; each begins at the best motion so far."""
    cubics = sorted({own, min(2 * own, fine), fine})
    return (*((_CUBICS, count) for count in cubics), (_PARABOLAS, fine))


def _on_mesh(problem: Transcription, degree: int, intervals: int) -> Transcription:
    """Return the problem on a uniform mesh, with rest in velocity alone and the same branch margins."""
    tau = np.linspace(0.0, 1.0, _POINTS * intervals + 1)
    if degree == _PARABOLAS:
        tau = np.union1d(tau, np.arange(1, intervals) / intervals - _BESIDE)
    own = [limit for limit in problem.limits if limit.role is not Role.SAFEGUARD]
    fine = Transcription(
        problem.decomposition,
        own,
        degree=degree,
        knots=clamped_uniform_knots(degree, intervals),
        derivatives_at_rest=1,
        tau=tau,
        end=problem.end,
        start_free=problem.start_free,
    )
    return fine.with_margin(max(problem.guards)) if problem.guards else fine


def _planned(problem: Transcription, motion: Motion, tolerance: float, deadline: float) -> Refined | None:
    """Solve from a motion and refine, with one backend after the other, until one gives a motion within the rows.

    It need not be an optimum: any motion within the limits is as good a reference as it is fast.
    """
    try:
        tau = np.linspace(0.0, 1.0, _FIT_DENSITY * len(problem.knots))
        x = fitted(problem, motion.t_end, tau, motion.at(tau * motion.t_end)[0])
        if worst_time_scaling_ratio(problem, x) > _AS_GOOD:
            x = stretched(problem, x)
    except UnreachableError:
        return None
    backends = solver_named("auto")[:_BACKENDS]
    for backend in reversed(backends) if problem.degree == _PARABOLAS else backends:
        solve = _bounded(backend.solve, deadline)
        try:
            first = solve(problem, x)
        except ImportError:
            continue
        if not first.status.usable and first.feasible and first.x[0] < motion.t_end:
            first = dataclasses.replace(first, status=SolveStatus.ACCEPTABLE)
        if first.status.usable:
            return refine(problem, first, solve, RefinementOptions(tolerance=tolerance, max_rounds=_ROUNDS))
    return None


def _bounded(backend: Callable[..., SolverReport], deadline: float) -> Solve:
    def solve(problem: Transcription, x: np.ndarray) -> SolverReport:
        seconds = float(np.clip(deadline - time.perf_counter(), _LEAST_SECONDS, _SECONDS))
        return backend(problem, x, SolverOptions(max_iterations=_ITERATIONS, time_limit=seconds), None)

    return solve


def _excess(problem: Transcription, x: np.ndarray) -> float:
    """Largest excess over a limit on a dense grid and on both sides of every knot; infinite where out of reach."""
    knots = np.unique(problem.knots)
    grid = np.linspace(0.0, 1.0, _DENSE * (len(knots) - 1) + 1)
    tau = np.unique(np.concatenate([grid, knots, knots[1:] - 1e-9, knots[:-1] + 1e-9]))
    try:
        return float(problem.violation_at(x, tau).max())
    except UnreachableError:
        return np.inf
