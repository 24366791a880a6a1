"""Two comparisons that show what a motion loses: the best value known, and the knots.

The reference is the same problem with discontinuous torque, on a fine mesh. Rest means
zero velocity only, so that torques may leave their static values at once. Cubic splines
are tried on the answer's own mesh and then on finer ones, and finally parabolas, whose
torques jump at every knot. Each begins at the best motion so far; redundant joints and
branch stay. The result is a local optimum on a finite mesh, not a proven bound.

The cost of the knots compares the motion with the fastest timing of its own joint path.
A spline can only ramp from one limit to another, so few knot intervals cost time. The
phase plane (`brachis.search.phase_plane`) times the same joint path with torques that
may jump. Its motion counts only if it also keeps the limits that the phase plane leaves
out (friction, power, means).
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from brachis.errors import UnreachableError
from brachis.limits import Limit, Moments
from brachis.optimise.backends import (
    SolverOptions,
    SolverReport,
    SolveStatus,
    solver_named,
)
from brachis.optimise.bspline import clamped_uniform_knots
from brachis.optimise.grid import FixedGrid
from brachis.optimise.guess import fit_curves, shortest_time, worst_time_scaling_ratio
from brachis.optimise.improve import Solve, SolvedProgram
from brachis.optimise.phase import Motion, Phase
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions, refine
from brachis.search.phase_plane import PhasePlane
from brachis.trajectory import Trajectory

INTERVALS = 100
"""Number of intervals of the fine mesh for one redundant joint, rounded to a multiple of the answer's own."""
MEANING = "the same problem with discontinuous torque allowed; the best value known, not a proven bound"
_PARABOLAS = 2
_HIGHEST = 2
"""Highest derivative that is bounded where accelerations jump: limits on a higher one are left out."""
_BESIDE = 1e-6
"""Parabolas are looked at this much of the whole time before every knot, too: their accelerations jump there."""
_AS_GOOD = 1.001
"""A start beyond its limits by less needs no longer time: solvers mend that themselves."""
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
    refined : SolvedProgram
        The problem and its answer.
    """

    t_end: float
    distance: float
    degree: int
    intervals: int
    violation: float
    wall_time: float
    refined: SolvedProgram

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
    refined: SolvedProgram,
    *,
    tolerance: float = 1e-4,
    intervals: int = INTERVALS,
    time_limit: float = 8.0,
) -> Reference | None:
    """Plan again with rest: velocity on a fine mesh, from the answer found.

    Parameters
    ----------
    refined : SolvedProgram
        ``result.candidate.refined``.
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
    with ThreadpoolController().limit(
        limits=1, user_api="blas"
    ):  # as in `plan`: batches are small
        return _find_faster(refined, tolerance, intervals, time_limit)


def _find_faster(
    refined: SolvedProgram, tolerance: float, intervals: int, time_limit: float
) -> Reference | None:
    """Try one mesh after the other."""
    began = time.perf_counter()
    (phase,) = refined.program.without_orders_above(_HIGHEST).phases
    (motion,) = refined.program.motions(refined.x)
    best: Reference | None = None
    for degree, count in _meshes(phase.intervals, _fine(phase, intervals)):
        if best is not None and time.perf_counter() > began + time_limit:
            break
        answer = _plan_on_mesh(
            _on_mesh(phase, degree, count), motion, tolerance, began + time_limit
        )
        violation = np.inf if answer is None else _violation(answer)
        if answer is None or violation > tolerance or answer.t_end >= motion.t_end:
            continue
        (motion,) = answer.program.motions(answer.x)
        best = Reference(
            motion.t_end,
            refined.t_end / motion.t_end - 1.0,
            degree,
            count,
            violation,
            0.0,
            answer,
        )
    return (
        None
        if best is None
        else dataclasses.replace(best, wall_time=time.perf_counter() - began)
    )


def _fine(phase: Phase, intervals: int) -> int:
    """Return a multiple of the answer's number of intervals, at least twice; fewer with several redundant joints.

    A step of the active-set method takes seconds where there are many more variables.
    """
    return phase.intervals * max(
        2, intervals // (phase.intervals * max(1, phase.joint_map.r))
    )


def _meshes(own: int, fine: int) -> tuple[tuple[int, int], ...]:
    """List degrees and numbers of intervals in the order of trying; each begins at the best motion so far."""
    cubics = sorted({own, min(2 * own, fine), fine})
    return (*((3, count) for count in cubics), (_PARABOLAS, fine))


def _on_mesh(phase: Phase, degree: int, intervals: int) -> Phase:
    """Return the phase on a uniform mesh, with rest in velocity alone."""
    t_norm = np.linspace(0.0, 1.0, 3 * intervals + 1)
    if degree == _PARABOLAS:
        t_norm = np.union1d(t_norm, np.arange(1, intervals) / intervals - _BESIDE)
    grid = FixedGrid(clamped_uniform_knots(degree, intervals), degree, t_norm)
    return phase.with_grid(grid, dataclasses.replace(phase.boundary, derivatives=1))


def _plan_on_mesh(
    phase: Phase, motion: Motion, tolerance: float, deadline: float
) -> SolvedProgram | None:
    """Solve from a motion and refine, with one backend after the other, until one gives a motion within the rows.

    It need not be an optimum: any motion within the limits is as good a reference as it is fast.
    """
    program = Program([phase])
    t_norm = np.linspace(0.0, 1.0, 4 * len(phase.knots))
    try:
        x = fit_curves(phase, motion.t_end, t_norm, motion.at(t_norm * motion.t_end)[0])
        if worst_time_scaling_ratio(program, x) > _AS_GOOD:
            x = shortest_time(program, x)
    except UnreachableError:
        return None
    backends = solver_named("auto")[:2]
    for backend in reversed(backends) if phase.degree == _PARABOLAS else backends:
        solve = _limit_time(backend.solve, deadline)
        try:
            first = solve(program, x)
        except ImportError:
            continue
        if (
            not first.status.usable
            and first.feasible
            and first.objective < motion.t_end
        ):
            first = dataclasses.replace(first, status=SolveStatus.ACCEPTABLE)
        if first.status.usable:
            return refine(
                program,
                first,
                solve,
                RefinementOptions(tolerance=tolerance, max_rounds=_ROUNDS),
            )
    return None


def _limit_time(backend: Callable[..., SolverReport], deadline: float) -> Solve:
    def solve(program: Program, x: np.ndarray) -> SolverReport:
        seconds = float(np.clip(deadline - time.perf_counter(), 0.1, 2.5))
        return backend(
            program,
            x,
            SolverOptions(max_iterations=200, time_limit=seconds),
            None,
        )

    return solve


def _violation(answer: SolvedProgram) -> float:
    """Largest violation of a limit on a dense grid and on both sides of every knot; infinite where out of reach."""
    ((phase, x),) = answer.program.split(answer.x)
    grid = np.linspace(0.0, 1.0, 30 * phase.intervals + 1)
    t_norm = np.unique(
        np.concatenate(
            [grid, phase.breaks, phase.breaks[1:] - 1e-9, phase.breaks[:-1] + 1e-9]
        )
    )
    try:
        return float(phase.violation_at(x, t_norm).max())
    except UnreachableError:
        return np.inf


_WITHIN = 0.02
_MOST = 0.01
"""The motion in the phase plane may exceed limits by more than the first fraction for this fraction of its time: at
the stations beside rest its derivatives are differences, and rough."""
_JUMPING = 2
"""Highest derivative that the phase plane bounds: it jumps there."""


@dataclass(frozen=True)
class KnotCost:
    """What the knots cost.

    Attributes
    ----------
    intervals : int
        Number of knot intervals of the motion.
    given : bool
        Whether the task gives this number, so that ``intervals: auto`` is left to try.
    t_end : float
        Of the fastest timing of the same joint path, s, to about 0.2 %.
    saved : float
        How much shorter that is, as a fraction of the motion's end time.
    """

    intervals: int
    given: bool
    t_end: float
    saved: float

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {"intervals": self.intervals, "t_end_s": self.t_end, "saved": self.saved}


def knot_cost(
    trajectory: Trajectory, limits: Sequence[Limit], t_end: float
) -> KnotCost | None:
    """Compare a planned motion with the fastest timing of its own joint path.

    Parameters
    ----------
    trajectory : Trajectory
    limits : sequence of Limit
        Of the task.
    t_end : float
        Of the fastest motion over these knots, s; the trajectory may be a calmer one.

    Returns
    -------
    KnotCost or None
        None if the phase plane does not tell: a limit bounds the jerk or the rate of the torque, or the motion in the
        phase plane exceeds a limit that it leaves out.
    """
    if any(limit.order > _JUMPING for limit in limits):
        return None
    s = np.linspace(0.0, 1.0, 1001)
    q = trajectory.position(_times_at(trajectory, s))
    first, last = np.abs(trajectory.path_spline.derivative()([0.0, trajectory.t_end]))
    rate = PhasePlane(limits, s, q).fastest((first, last))
    if rate is None:
        return None
    steps = 2.0 * np.diff(s) / (rate[1:] + rate[:-1])
    if steps[_exceeds(limits, s, q, rate, steps)].sum() > _MOST * steps.sum():
        return None
    least = float(steps.sum())
    intervals = len(np.unique(trajectory.knots)) - 1
    given = trajectory.task.spline.intervals != "auto"
    return KnotCost(intervals, given, least, 1.0 - least / t_end)


def _times_at(trajectory: Trajectory, s: np.ndarray) -> np.ndarray:
    """Find when path coordinates, (S,), are passed, s."""
    low = np.zeros_like(s)
    high = np.full_like(s, trajectory.t_end)
    for _ in range(50):
        middle = 0.5 * (low + high)
        before = trajectory.path_coordinate(middle) < s
        low = np.where(before, middle, low)
        high = np.where(before, high, middle)
    return high


def _exceeds(
    limits: Sequence[Limit],
    s: np.ndarray,
    q: np.ndarray,
    rate: np.ndarray,
    steps: np.ndarray,
) -> np.ndarray:
    """Tell between which stations the motion in the phase plane exceeds a limit, (S - 1,)."""
    q_ds = np.gradient(q, s, axis=0, edge_order=2)
    q_dds = np.gradient(q_ds, s, axis=0, edge_order=2)
    acceleration = (np.diff(rate**2) / (2.0 * np.diff(s)))[:, None]
    speed = rate[:-1, None]
    qddot = q_ds[:-1] * acceleration + q_dds[:-1] * speed**2
    moments = Moments(q[:-1], q_ds[:-1] * speed, qddot, np.zeros_like(qddot), s[:-1])
    ratios = [
        np.abs(limit.ratios(moments, np.cumsum(steps))).max(axis=1) for limit in limits
    ]
    return np.max(ratios, axis=0) > 1.0 + _WITHIN
