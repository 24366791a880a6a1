"""The program over time, solved from a guess or from the timings of joint paths.

Its first point consists of splines along the timing of a joint path, slowed down until the limits are met at the
collocation points.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import spread
from brachis.errors import UnreachableError
from brachis.optimise.backends import SolverReport
from brachis.optimise.extraction import meet
from brachis.optimise.improve import (
    SolvedProgram,
    SolverSession,
    attempt_once,
    keep_feasible,
)
from brachis.optimise.mesh import coarsest
from brachis.optimise.path_phase import violation_of_postures
from brachis.optimise.phase_timing import PhaseTiming, time_phases
from brachis.optimise.program import Program
from brachis.optimise.retiming import (
    BetterPaths,
    begin_with_timing,
    is_timing_all,
    least_time,
)
from brachis.search.phase_plane import initial_guess
from brachis.search.stages import InitialGuess
from brachis.task import SplineSettings
from brachis.timing import is_left_out

_ENTRIES = 500_000
"""Maximum product of the numbers of variables and rows of a program over time that improves a joint path. With a larger
product, an iteration takes tenths of a second."""
_ITERATIONS = 60
"""Maximum number of iterations of such a solve. From the timing, most solves take 5 to 25; one close to a singular
posture took 74. With 80, a program of eight paths took 32 s in place of 29 s, and was 0.14 % faster."""
_WIDENING = 1e-6
"""Widening of the bounds; see `SolverOptions`. Along a timing, hundreds of rows are at their bounds, and a solve of 0.1
s took 4 s without widening."""
_NEARLY = 0.01
"""Maximum violation that is accepted if the iteration limit ends a solve; refinement can remove it."""
_LOOKS = 10
"""Number of instants in each interval at which limits on postures are checked."""
_FIRST_LOSS = 0.05
"""Fraction of the motion time that the first knots may cost, if a mesh is refined from them."""
_FIRST_INTERVALS = 16
"""Approximate number of intervals of such a first mesh."""


def solve_over_time(
    guess: InitialGuess, program: Program, session: SolverSession
) -> SolvedProgram:
    """Solve over time, first over few knots: those that the fastest timing needs, or some of the given knots.

    Parameters
    ----------
    guess : InitialGuess
    program : Program
        Program of the guess's joint maps, over all given knots.
    session : SolverSession

    Returns
    -------
    SolvedProgram

    Raises
    ------
    UnreachableError
        The first splines leave the joint map.
    """
    first, x = _first_splines(guess, program)
    return keep_feasible(attempt_once(session, first, x), x)


def _first_splines(guess: InitialGuess, program: Program) -> tuple[Program, np.ndarray]:
    """Return a program over few knots and its first splines, (v,); raise UnreachableError if these are out of reach."""
    task = guess.problem.task
    has_laws = any(guess.problem.time_laws)
    is_open = task.spline.intervals == "auto" and not task.boundary.periodic
    x = None
    if has_laws and is_open and not any(map(is_left_out, program.limits)):
        x = initial_guess(program, guess)
    if is_open and (not has_laws or x is not None):
        # Knots are close together where the fastest timing of the joint path needs them.
        points = task.spline.points_per_interval
        with contextlib.suppress(UnreachableError):
            pairs = zip(program.phases, guess.legs, strict=True)
            timings = [PhaseTiming.through(*pair) for pair in pairs]
            first = begin_with_timing(
                program, timings, _FIRST_LOSS, _FIRST_INTERVALS, points, x
            )
            if first is not None:
                return first
    is_near = guess.joint_map.r <= 1 and is_timing_all(program)
    # At a given speed, motions leave their charts between the points of a coarse mesh.
    even = program if is_near or has_laws else coarsest(program)
    x = initial_guess(even, guess)
    if x is None:
        raise UnreachableError(
            "the splines through the joint path leave the branch, or the chart"
        )
    return even, x


@dataclass(frozen=True)
class BetterTimings:
    """Timings of joint paths, as far as the program over time has improved them.

    Attributes
    ----------
    program : Program
        Program with all limits, over any knots.
    timings : sequence of PhaseTiming or None
        The fastest known timings, one for each phase of the program.
    solved : SolvedProgram or None
        The motion over time; None if the solve gave none.
    is_smoothed : bool
        Whether the joint paths are those of the smoothest motion that is as fast as `solved`.
    """

    program: Program
    timings: Sequence[PhaseTiming | None]
    solved: SolvedProgram | None = None
    is_smoothed: bool = False

    @property
    def t_end(self) -> float:
        """Time of all phases, s; infinite if a phase has no timing."""
        return least_time(self.timings)

    @property
    def reports(self) -> tuple[SolverReport, ...]:
        """Reports of the solves."""
        return () if self.solved is None else self.solved.reports


def shorten_solves(session: SolverSession) -> SolverSession:
    """Return a session with bounded effort, for solves that begin with the fastest timing."""
    iterations = min(_ITERATIONS, session.options.max_iterations)
    options = replace(session.options, max_iterations=iterations, widening=_WIDENING)
    return replace(session, options=options)


def improve_timings(
    guess: InitialGuess,
    program: Program,
    paths: BetterPaths,
    session: SolverSession,
    smooth: Callable[[SolvedProgram], np.ndarray | None] | None,
) -> BetterTimings:
    """Solve over time from splines along timings, and time the joint path of the solution, and of a smoother one.

    Parameters
    ----------
    guess : InitialGuess
    program : Program
        A program over any knots.
    paths : BetterPaths
        Joint paths of the program's phases.
    session : SolverSession
    smooth : callable or None
        ``smooth(solved)`` returns the smoothest motion, (v,), that is as fast as the solution of a large program, or
        None.

    Returns
    -------
    BetterTimings
        The given timings if no joint is redundant and no speed is free, no time is left, or the solve gives no motion.
    """
    unimproved = BetterTimings(program, paths.timings)
    is_free = bool(guess.joint_map.r) or program.flies
    if not is_free or session.deadline.passed:
        return unimproved
    followed = zip(program.phases, paths.curves, strict=True)
    restricted = program.with_phases(
        phase.restrict_to(curves, is_followed=True) for phase, curves in followed
    )
    spline = guess.problem.task.spline
    solved = _solve_from_timings(restricted, paths.timings, session, spline)
    if solved is None:
        return unimproved
    pairs = zip(solved.program.phases, program.phases, strict=True)
    unrestricted = solved.program.with_phases(
        phase.with_limits(original.limits) for phase, original in pairs
    )
    # Between its points, a solution may exceed limits on postures, which no timing of its joint path can meet.
    allowed = max(paths.violation, guess.problem.task.refinement.tolerance)

    def time_motion(known: BetterTimings, x: np.ndarray, later: float) -> BetterTimings:
        """Time the joint path of a motion; keep the known one if it is faster by more than a fraction."""
        x = meet(unrestricted, x)
        timings = time_phases(unrestricted, x)
        is_fast = least_time(timings) < (1.0 + later) * known.t_end
        if is_fast and _violation_of_postures(unrestricted, x) <= allowed:
            return BetterTimings(unrestricted, timings, solved)
        return known

    fastest = time_motion(replace(unimproved, solved=solved), solved.x, 0.0)
    is_large = session.choose_for_large(solved.program) is not None
    x = smooth(solved) if smooth and is_large else None
    if x is None:
        return fastest
    smoothest = time_motion(fastest, x, tolerances.END_TIME)
    return replace(smoothest, is_smoothed=smoothest is not fastest)


def _violation_of_postures(program: Program, x: np.ndarray) -> float:
    """Return the largest violation of limits on postures along a motion, (v,)."""
    violations = []
    for phase, x_of_phase in program.split(x):
        motion = phase.motion(x_of_phase)
        t = spread(motion.breaks, _LOOKS)
        violations.append(violation_of_postures(phase, motion.at(t)[0]))
    return max(violations)


def _solve_from_timings(
    program: Program,
    timings: Sequence[PhaseTiming | None],
    session: SolverSession,
    spline: SplineSettings,
) -> SolvedProgram | None:
    """Solve over time from splines along the timings of all phases; None if that gives no motion."""
    r = max(phase.joint_map.r for phase in program.phases)
    # The product of variables and rows grows with the square of the number of intervals.
    rows = (1 + r) * len(program.lower) / program.intervals
    intervals = int(np.sqrt(_ENTRIES / rows))
    begun = begin_with_timing(
        program, timings, spline.tolerance, intervals, spline.points_per_interval
    )
    if begun is None:
        return None
    options = replace(session.options, acceptable=_NEARLY)
    backend = session.choose_for_large(begun[0]) or session.backend
    session = replace(session, backend=backend, options=options)
    solved = attempt_once(session, *begun, accept_early_end=True)
    return solved if solved.usable else None
