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
from brachis.nlp import FixedGrid, Motion, Phase, Program
from brachis.nlp.guess import fitted, shortest_time, worst_time_scaling_ratio
from brachis.refine import Refined, RefinementOptions, Solve, refine
from brachis.solvers import SolverOptions, SolverReport, SolveStatus, solver_named

INTERVALS = 100
"""Number of intervals of the fine mesh for one redundant joint, rounded to a multiple of the answer's own."""
MEANING = "the same problem with discontinuous torque allowed; the best value known, not a proven bound"
_CUBICS, _PARABOLAS = 3, 2
_HIGHEST = 2
"""Highest derivative that is bounded where accelerations jump: limits on a higher one are left out."""
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
    violation : float
        Largest violation of a limit on a dense grid, as a fraction of it.
    wall_time : float
        s.
    refined : Refined
        The problem and its answer.
    """

    t_end: float
    distance: float
    degree: int
    intervals: int
    violation: float
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
            "violation": self.violation,
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
        Largest violation of a limit, as a fraction of it.
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
    (phase,), (motion,) = refined.program.up_to(_HIGHEST).phases, refined.program.motions(refined.x)
    best: Reference | None = None
    for degree, count in _meshes(phase.intervals, _fine(phase, intervals)):
        if best is not None and time.perf_counter() > began + time_limit:
            break
        answer = _planned(_on_mesh(phase, degree, count), motion, tolerance, began + time_limit)
        violation = np.inf if answer is None else _violation(answer)
        if answer is None or violation > tolerance or answer.t_end >= motion.t_end:
            continue
        (motion,) = answer.program.motions(answer.x)
        best = Reference(motion.t_end, refined.t_end / motion.t_end - 1.0, degree, count, violation, 0.0, answer)
    return None if best is None else dataclasses.replace(best, wall_time=time.perf_counter() - began)


def _fine(phase: Phase, intervals: int) -> int:
    """Return a multiple of the answer's number of intervals, at least twice; fewer with several redundant joints.

    A step of the active-set method takes seconds where there are many more variables.
    """
    return phase.intervals * max(2, intervals // (phase.intervals * max(1, phase.joint_map.r)))


def _meshes(own: int, fine: int) -> tuple[tuple[int, int], ...]:
    """List degrees and numbers of intervals in the order of trying; each begins at the best motion so far."""
    cubics = sorted({own, min(2 * own, fine), fine})
    return (*((_CUBICS, count) for count in cubics), (_PARABOLAS, fine))


def _on_mesh(phase: Phase, degree: int, intervals: int) -> Phase:
    """Return the phase on a uniform mesh, with rest in velocity alone."""
    t_norm = np.linspace(0.0, 1.0, _POINTS * intervals + 1)
    if degree == _PARABOLAS:
        t_norm = np.union1d(t_norm, np.arange(1, intervals) / intervals - _BESIDE)
    grid = FixedGrid(clamped_uniform_knots(degree, intervals), degree, t_norm)
    return phase.over(grid, dataclasses.replace(phase.boundary, derivatives=1))


def _planned(phase: Phase, motion: Motion, tolerance: float, deadline: float) -> Refined | None:
    """Solve from a motion and refine, with one backend after the other, until one gives a motion within the rows.

    It need not be an optimum: any motion within the limits is as good a reference as it is fast.
    """
    program, t_norm = Program([phase]), np.linspace(0.0, 1.0, _FIT_DENSITY * len(phase.knots))
    try:
        x = fitted(phase, motion.t_end, t_norm, motion.at(t_norm * motion.t_end)[0])
        if worst_time_scaling_ratio(program, x) > _AS_GOOD:
            x = shortest_time(program, x)
    except UnreachableError:
        return None
    backends = solver_named("auto")[:_BACKENDS]
    for backend in reversed(backends) if phase.degree == _PARABOLAS else backends:
        solve = _bounded(backend.solve, deadline)
        try:
            first = solve(program, x)
        except ImportError:
            continue
        if not first.status.usable and first.feasible and first.objective < motion.t_end:
            first = dataclasses.replace(first, status=SolveStatus.ACCEPTABLE)
        if first.status.usable:
            return refine(program, first, solve, RefinementOptions(tolerance=tolerance, max_rounds=_ROUNDS))
    return None


def _bounded(backend: Callable[..., SolverReport], deadline: float) -> Solve:
    def solve(program: Program, x: np.ndarray) -> SolverReport:
        seconds = float(np.clip(deadline - time.perf_counter(), _LEAST_SECONDS, _SECONDS))
        return backend(program, x, SolverOptions(max_iterations=_ITERATIONS, time_limit=seconds), None)

    return solve


def _violation(answer: Refined) -> float:
    """Largest violation of a limit on a dense grid and on both sides of every knot; infinite where out of reach."""
    ((phase, x),) = answer.program.split(answer.x)
    grid = np.linspace(0.0, 1.0, _DENSE * phase.intervals + 1)
    t_norm = np.unique(np.concatenate([grid, phase.breaks, phase.breaks[1:] - 1e-9, phase.breaks[:-1] + 1e-9]))
    try:
        return float(phase.violation_at(x, t_norm).max())
    except UnreachableError:
        return np.inf
