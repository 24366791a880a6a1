"""Programs beside the fastest timing of their joint paths: timed, begun with it, and timed again."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from brachis.errors import UnreachableError
from brachis.optimise.backends import SolverReport, SolveStatus
from brachis.optimise.follow import Followed, begin, follow
from brachis.optimise.guess import shortest_time
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.phase_timing import PhaseTiming, least_time_of, time_phases
from brachis.optimise.program import Program
from brachis.timing import is_left_out

SOLVER = "phase plane"
"""Name of what solves a program by its timing alone."""
TOO_FAST = 0.01
"""Part of the least time by which a motion is faster that exceeds limits by much between its collocation points."""
_ROUGHLY = 0.05
"""Part of the time that first knots may lose."""
_FIRST_INTERVALS = 16
"""Intervals over which a search begins, about."""


def keep(program: Program, x: np.ndarray) -> SolverReport:
    """Solve nothing: a timing is not improved by more collocation points, but lengthened until limits hold."""
    return _report(program, x, SolveStatus.STALLED, np.inf, 0.0)


def _report(
    program: Program,
    x: np.ndarray,
    status: SolveStatus,
    violation: float,
    seconds: float,
) -> SolverReport:
    """Report a motion that no solver changed."""
    return SolverReport(
        solver=SOLVER,
        status=status,
        x=x,
        objective=program.objective(x),
        violation=violation,
        multipliers=np.zeros(len(program.lower)),
        iterations=0,
        wall_time=seconds,
        message="the fastest timing of the joint path",
    )


def time_guess(
    program: Program,
    joint_paths: Sequence[np.ndarray],
    rates: Sequence[tuple[float, float]],
    tolerance: float,
    points: int,
) -> SolvedProgram | None:
    """Give joint paths without redundancy their fastest timing, which is all that is to be decided.

    Parameters
    ----------
    program : Program
        Over any knots.
    joint_paths : sequence of (S, c) ndarray
        Of every phase, s and other curves.
    rates : sequence of tuple of float
        ds/dt at both ends of each, 1/s.
    tolerance, points
        As of `retime`.

    Returns
    -------
    SolvedProgram or None
        As of `retime`; or where the phase plane finds no timing.
    """
    began = time.perf_counter()
    if not is_timing_all(program):
        return None
    found = []
    for phase, curves, ends in zip(program.phases, joint_paths, rates, strict=True):
        try:
            own = PhaseTiming.along(phase, curves, ends)
        except UnreachableError:
            return None
        followed = follow(phase, own, tolerance, points)
        if followed is None:
            return None
        found.append(followed)
    return _as_solved(program, found, (), time.perf_counter() - began)


def begin_with_timing(
    program: Program,
    joint_paths: Sequence[np.ndarray],
    rates: Sequence[tuple[float, float]],
    points: int,
) -> tuple[Program, np.ndarray] | None:
    """Lay splines along the fastest timing of joint paths, over few knots, close together where it needs them.

    Parameters
    ----------
    program : Program
        Over any knots.
    joint_paths, rates, points
        As of `time_guess`.

    Returns
    -------
    program : Program
    x : (v,) ndarray
        Slowed down until the limits hold at the collocation points; None where the limits allow no timing.
    """
    phases = []
    parts = []
    for phase, curves, ends in zip(program.phases, joint_paths, rates, strict=True):
        try:
            own = PhaseTiming.along(phase, curves, ends)
            begun = begin(phase, own, _ROUGHLY, _FIRST_INTERVALS, points)
        except UnreachableError:
            return None
        if begun is None:
            return None
        phases.append(begun[0])
        parts.append(begun[1])
    first = program.with_phases(phases)
    try:
        return first, shortest_time(first, np.concatenate(parts))
    except UnreachableError:
        return None


def is_timing_all(program: Program) -> bool:
    """Tell whether the phase plane knows all limits, and phases meet at rest."""
    is_linked = any(max(link.orders) for link in program.links)
    is_periodic = any(phase.boundary.periodic for phase in program.phases)
    has_laws = any(phase.time_law is not None for phase in program.phases)
    left_out = any(map(is_left_out, program.limits))
    return not (is_linked or is_periodic or has_laws or left_out)


def retime(
    solved: SolvedProgram, tolerance: float, points: int, worth: float
) -> SolvedProgram | None:
    """Give a solved program the fastest timing of its own joint path, over the knots that this needs.

    Parameters
    ----------
    solved : SolvedProgram
        Without free knots.
    tolerance : float
        Part of the time by which splines should not be slower.
    points : int
        Collocation points an interval.
    worth : float
        Part of the time by which the timing has to be faster.

    Returns
    -------
    SolvedProgram or None
        None if that is about as fast. None where timing is not all: with limits on jerk, torque rate or means, in
        periodic motions, and where a phase goes on in motion from another one.
    """
    began = time.perf_counter()
    program = solved.program
    if not is_timing_all(program):
        return None
    timings = time_phases(solved)
    least = least_time_of(program, solved.x, timings)
    # A motion that is faster exceeds limits between its collocation points.
    if least * (1.0 - TOO_FAST) < solved.t_end < least * (1.0 + worth):
        return None
    found = []
    for (phase, x), own in zip(program.split(solved.x), timings, strict=True):
        followed = None if own is None else follow(phase, own, tolerance, points)
        found.append(followed or Followed(phase, x, 0.0))
    return _as_solved(program, found, solved.reports, time.perf_counter() - began)


def _as_solved(
    program: Program,
    found: Sequence[Followed],
    reports: tuple[SolverReport, ...],
    seconds: float,
) -> SolvedProgram:
    """Write timings of all phases as the answer of a program."""
    finer = program.with_phases([own.phase for own in found])
    x = np.concatenate([own.x for own in found])
    violation = max(own.violation for own in found)
    report = _report(finer, x, SolveStatus.ACCEPTABLE, violation, seconds)
    return SolvedProgram(finer, (*reports, report))
