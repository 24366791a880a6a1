"""Which of many guesses are worth a plan: each is solved quickly over few knots, and the fastest that differ are kept.

The length of a joint path, and the least time along it, tell little about the motion that an optimiser makes of it if
several redundant joints are free to move. A solve over few knots, stopped early, tells more and costs little; and the
plan then begins at the joint path where it ended.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from contextlib import closing

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.errors import UnreachableError
from brachis.kinematics import ChartMap
from brachis.optimise.backends import SolverOptions, solvers_for
from brachis.optimise.candidate import InitialGuess
from brachis.optimise.improve import SolverSession
from brachis.optimise.transcription import program_of
from brachis.search.candidates import solve_in_chart
from brachis.search.phase_plane import initial_guess
from brachis.search.processes import process_count, run_in_processes
from brachis.search.timed import solvers_of

_DEGREE = 2
"""Parabolas jump from one acceleration to the next, as fastest motions do: so few intervals say most."""
_SAME_LEAST = 1.003
"""End times of quick solves that differ by less than this factor are the same."""


def screen(
    starts: Sequence[InitialGuess], most: int, deadline: Deadline, listener: Listener
) -> list[InitialGuess]:
    """Choose the most promising of guesses in charts.

    Parameters
    ----------
    starts : sequence of InitialGuess
        At least one.
    most : int
        How many to keep; if so few are given, all are kept without a solve.
    deadline : Deadline
    listener : callable

    Returns
    -------
    list of InitialGuess
        With the joint paths that the quick solves led to, and their end times as estimates; the fastest first.
    """
    if len(starts) <= most:
        return list(starts)
    jobs = process_count(starts[0].problem.task.search.jobs, deadline)
    listener(f"solving quickly from {len(starts)} joint paths")
    solved: list[InitialGuess] = []
    work = run_in_processes(
        _solve_quickly, starts, deadline, jobs=jobs, listener=listener
    )
    with closing(work) as outcomes:
        for start in outcomes:
            solved.append(start)
            # If as many end at the least end time, others are unlikely to end below it.
            times = np.array([each.estimate for each in solved])
            times = times[np.isfinite(times)]
            is_least = times <= _SAME_LEAST * times.min(initial=np.inf)
            if is_least.sum() >= max(4, most):
                break
    kept: list[InitialGuess] = []
    for start in sorted(solved, key=lambda start: start.estimate):
        ratio = start.estimate / kept[0].estimate if kept else 1.0
        # Guesses slower than the fastest one by 3 % are left out, and so is the second half of equally fast ones.
        is_slow = ratio > 1.03
        is_one_too_many = ratio <= _SAME_LEAST and len(kept) >= max(2, most // 2)
        is_known = any(_is_same(start, other) for other in kept)
        if not (is_slow or is_one_too_many or is_known) and len(kept) < most:
            kept.append(start)
    return kept


def _solve_quickly(
    start: InitialGuess, deadline: Deadline, _listener: Listener
) -> InitialGuess:
    """Solve from a guess over few knots; if that fails it stays as it is, with an infinite estimate."""
    hopeless = dataclasses.replace(start, estimate=np.inf)
    if deadline.passed:
        return hopeless
    # At rest in their velocity alone, without limits that parabolas cannot hold.
    task = start.problem.task
    spline = task.spline.model_copy(update={"degree": _DEGREE, "rest": "velocity"})
    problem = dataclasses.replace(
        start.problem,
        task=task.model_copy(update={"spline": spline}),
        limits=tuple(limit for limit in start.problem.limits if limit.order <= _DEGREE),
    )
    (backend,) = solvers_for(solvers_of(start.problem)[0])
    # An answer that nearly holds the limits will do, and so will one that hardly gets any faster.
    options = SolverOptions(1e-3, 25, np.inf, progress=5e-3, patience=3)
    session = SolverSession(backend, options, deadline, acceptable=1e-2)
    try:
        maps = start.maps_by_leg()
        program = program_of(problem, maps, [np.linspace(0.0, 1.0, 13)] * len(maps))
        x = initial_guess(program, start)
        if x is None:
            return hopeless
        solved = solve_in_chart(problem, program, x, session)
        if not solved.usable:
            return hopeless
        motions = solved.program.motions(solved.report.x)
        chart = solved.program.phases[0].joint_map
        assert isinstance(chart, ChartMap)
        even = [motion.at(np.linspace(0.0, motion.t_end, 97))[0] for motion in motions]
        return dataclasses.replace(
            start,
            joint_map=chart.along(problem.path, chart.start),
            joint_path=np.concatenate(even),
            estimate=solved.t_end,
            durations=tuple(motion.t_end for motion in motions),
        )
    except (ImportError, UnreachableError):  # the plan says which backend is missing
        return hopeless


def _is_same(first: InitialGuess, second: InitialGuess) -> bool:
    """Tell whether two guesses that were solved are the same joint path, nearly."""
    if not np.isfinite([first.estimate, second.estimate]).all():
        return False
    if abs(first.estimate - second.estimate) > 0.02 * second.estimate:
        return False
    postures = [start.joint_map.postures(start.joint_path) for start in (first, second)]
    return bool(np.abs(postures[0] - postures[1]).max() < 0.15)  # rad or m
