"""Two comparisons that show what a motion loses: with the best value known, and with other knots.

The reference is the same problem with discontinuous torque, on a fine mesh. Rest means
zero velocity only, so that torques may leave their static values at once. Cubic splines
are tried on the answer's own mesh and then on finer ones, and finally parabolas, whose
torques jump at every knot. Each begins at the best motion so far; redundant joints and
branch stay. The result is a local optimum on a finite mesh, not a proven bound.

The cost of the knots compares the motion with the fastest timing of its own joint path, phase by phase.
A spline can only ramp from one limit to another, so few knot intervals cost time. The
phase plane (`brachis.search.phase_plane`) times the same joint path with torques that
may jump. Its motion counts only if it also keeps the limits that the phase plane leaves
out (friction, power, means).
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.threads import use_one_thread
from brachis.errors import UnreachableError
from brachis.optimise.backends import (
    Solver,
    SolverOptions,
    SolverReport,
    SolveStatus,
    solvers_for,
)
from brachis.optimise.bspline import clamped_uniform_knots
from brachis.optimise.grid import FixedGrid
from brachis.optimise.guess import fit_curves, shortest_time, worst_time_scaling_ratio
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.program import Program
from brachis.optimise.refine import RefinementOptions, refine

MEANING = "the same problem with discontinuous torque allowed; the best value known, not a proven bound"
_PARABOLAS = 2
"""Degree of splines whose accelerations jump at knots."""
_JUMPING = 2
"""Highest derivative that is bounded if accelerations jump: limits on a higher one are left out."""


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
        Of the splines of this motion.
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
    intervals: int = 100,
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
        None if no motion faster than the answer was found.
    """
    began = time.perf_counter()
    deadline = Deadline.after(time_limit)
    own = refined.program.without_orders_above(_JUMPING)
    # Fewer intervals with several redundant joints: a step of the active-set method takes seconds then.
    r = own.phases[0].joint_map.r
    finest = max(2, intervals // (own.intervals * max(1, r)))
    meshes = [(3, times) for times in sorted({1, 2, finest})]
    fastest = refined
    with use_one_thread():
        for degree, times in (*meshes, (_PARABOLAS, finest)):
            if fastest is not refined and deadline.passed:
                break
            program = _on_mesh(own, degree, times)
            answer = _plan_on_mesh(program, fastest, tolerance, deadline)
            if answer is None or answer.t_end >= fastest.t_end:
                continue
            if answer.violation <= tolerance:
                fastest = answer
    if fastest is refined:
        return None
    return Reference(
        t_end=fastest.t_end,
        distance=refined.t_end / fastest.t_end - 1.0,
        degree=fastest.program.phases[0].degree,
        intervals=fastest.program.intervals,
        violation=fastest.violation,
        wall_time=time.perf_counter() - began,
        refined=fastest,
    )


def _on_mesh(program: Program, degree: int, times: int) -> Program:
    """Return the program on uniform meshes so many times finer, on which only velocities vanish or continue."""
    phases = []
    for phase in program.phases:
        intervals = times * phase.intervals
        t_norm = np.linspace(0.0, 1.0, 3 * intervals + 1)
        if degree == _PARABOLAS:  # accelerations jump at knots: look before them, too
            t_norm = np.union1d(t_norm, np.arange(1, intervals) / intervals - 1e-6)
        grid = FixedGrid(clamped_uniform_knots(degree, intervals), degree, t_norm)
        phases.append(phase.with_grid(grid, phase.boundary.up_to_velocity()))
    links = []
    for link in program.links:
        orders = tuple(order for order in link.orders if order < _JUMPING)
        links.append(dataclasses.replace(link, orders=orders))
    return Program(phases, links)


def _plan_on_mesh(
    program: Program, fastest: SolvedProgram, tolerance: float, deadline: Deadline
) -> SolvedProgram | None:
    """Solve from a motion and refine, with one backend after the other, until one gives a motion within the rows.

    It need not be an optimum: any motion within the limits is as good a reference as it is fast.
    """
    motions = fastest.program.motions(fastest.x)
    parts = []
    try:
        for phase, motion in zip(program.phases, motions, strict=True):
            t_norm = np.linspace(0.0, 1.0, 4 * len(phase.knots))
            wanted = motion.at(t_norm * motion.t_end)[0]
            parts.append(fit_curves(phase, motion.t_end, t_norm, wanted))
        x = np.concatenate(parts)
        if worst_time_scaling_ratio(program, x) > 1.001:  # solvers mend less themselves
            x = shortest_time(program, x)
    except UnreachableError:
        return None

    def solve_with(backend: Solver, program: Program, x: np.ndarray) -> SolverReport:
        """Solve for a short time."""
        seconds = float(np.clip(deadline.left, 0.1, 2.5))
        options = SolverOptions(max_iterations=200, time_limit=seconds)
        return backend.solve(program, x, options, None)

    backends = solvers_for("auto")[:2]
    is_rough = program.phases[0].degree == _PARABOLAS
    for backend in reversed(backends) if is_rough else backends:
        solve = partial(solve_with, backend)
        first = solve(program, x)
        is_faster = first.feasible and program.end_time(first.x) < fastest.t_end
        if is_faster and not first.status.usable:
            first = dataclasses.replace(first, status=SolveStatus.ACCEPTABLE)
        if first.status.usable:
            # What still exceeds a limit costs some 1e-4 of the time; more rounds cost seconds.
            options = RefinementOptions(tolerance=tolerance, max_rounds=4)
            return refine(program, first, solve, options)
    return None
