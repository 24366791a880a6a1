"""Which of many guesses are worth a plan: each is improved over the path, and the fastest that differ are kept.

The length of a joint path, and the least time along it, tell little about the motion that an optimiser makes of it if
several redundant joints are free to move. A rough search over the path tells more and costs little; and the plan then
begins at the joint path where it ended.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.errors import UnreachableError
from brachis.optimise.backends import SolverOptions, solver_for_large, solvers_for
from brachis.optimise.improve import SolverSession
from brachis.optimise.retiming import COARSE, ROUGH, PathEffort
from brachis.optimise.transcription import program_of
from brachis.search.lattice import farthest
from brachis.search.over_path import CHARTS, improve_guess
from brachis.search.processes import run_in_processes
from brachis.search.stages import InitialGuess

_NEAR_LEAST = 1.01
"""Factor on the least time up to which others are as fast, about: plans from there may end in either order."""
_PLACES = np.linspace(0.0, 1.0, 49)
"""Places at which joint paths are compared."""
_SLOW = 1.03
"""Times the least time that is slow."""


def screen(
    starts: Sequence[InitialGuess], most: int, deadline: Deadline, listener: Listener
) -> list[InitialGuess]:
    """Choose the most promising of guesses.

    Parameters
    ----------
    starts : sequence of InitialGuess
        At least one.
    most : int
        How many to keep.
    deadline : Deadline
    listener : callable

    Returns
    -------
    list of InitialGuess
        With the better joint paths, and their least times as estimates; the fastest first.
    """
    listener(f"improving {len(starts)} joint paths")
    improve = partial(_improve_most, deadline=deadline, listener=listener)
    alike = max(2, most // 2)
    is_many = len(starts) > most
    if is_many:
        # The half that looks worse after a coarse search is left out.
        coarse = improve(_spread_out(starts), COARSE, 1, alike + 1)
        count = max(most, (len(coarse) + 1) // 2)
        place = {start.origin: number for number, start in enumerate(starts)}
        coarse.sort(key=lambda start: (start.estimate, place[start.origin]))
        starts = coarse[:count]
    solved = improve(starts, ROUGH, CHARTS, alike if is_many else len(starts))
    kept: list[InitialGuess] = []
    for start in sorted(solved, key=lambda start: start.estimate):
        ratio = start.estimate / kept[0].estimate if kept else 1.0
        # Of many, those slower than the fastest one are left out, and so is the second half of equally fast ones.
        is_slow = ratio > _SLOW and is_many
        is_one_too_many = ratio <= _NEAR_LEAST and len(kept) >= alike
        is_known = any(is_same(start, other) for other in kept)
        if not (is_slow or is_one_too_many or is_known):
            kept.append(start)
    return kept[:most]


def _spread_out(starts: Sequence[InitialGuess]) -> list[InitialGuess]:
    """Order guesses so that each differs most from all before it; of equal ones the first is kept.

    Neighbours end in the same optimum. Where some that are far apart do, others do too. Guesses without some of their
    postures come last.
    """
    paths = np.array([start.postures_at(_PLACES).ravel() for start in starts])
    (known,) = np.isfinite(paths).all(axis=1).nonzero()
    order = known[:1].tolist()
    if len(known) > 1:
        points = paths[known]
        order += known[farthest(points, points[:1], len(points) - 1)].tolist()
    order += np.setdiff1d(np.arange(len(starts)), known).tolist()
    return [starts[number] for number in dict.fromkeys(order)]


def _improve_most(
    starts: Sequence[InitialGuess],
    effort: PathEffort,
    charts: int,
    alike: int,
    *,
    deadline: Deadline,
    listener: Listener,
) -> list[InitialGuess]:
    """Improve guesses until `alike` of them end near the least end time: others are unlikely to end below it.

    A guess that stays slower than the fastest one was at first is given up.
    """
    # A program over the path knows no pauses, and its time differs a little from that of a timing.
    waiting = starts[0].problem.dwell_time
    least = min(start.estimate for start in starts) - waiting
    options = replace(effort.options, to_beat=_NEAR_LEAST * least)
    effort = replace(effort, options=options)
    work = run_in_processes(
        _improve,
        starts,
        deadline,
        effort,
        charts,
        jobs=starts[0].problem.task.search.jobs,
        listener=listener,
    )
    solved = []
    with closing(work) as outcomes:
        for start in outcomes:
            solved.append(start)
            if _count_near_least(solved, apart=charts > 1) >= alike:
                break
    return solved


def _count_near_least(solved: Sequence[InitialGuess], *, apart: bool) -> int:
    """Count the guesses near the least end time; with `apart` those of the same joint path once."""
    known = [start for start in solved if np.isfinite(start.estimate)]
    least = min((start.estimate for start in known), default=np.inf)
    near: list[InitialGuess] = []
    for start in known:
        is_near = start.estimate <= _NEAR_LEAST * least
        if is_near and not (apart and any(is_same(start, each) for each in near)):
            near.append(start)
    return len(near)


def _improve(
    start: InitialGuess,
    deadline: Deadline,
    effort: PathEffort,
    charts: int,
    _listener: Listener,
) -> InitialGuess:
    """Improve a guess over the path. If that fails, its estimate stays; one never improved gets infinity."""
    if not start.is_improved:
        start = replace(start, estimate=np.inf)
    if deadline.passed:
        return start
    problem = start.problem
    backend = solvers_for(problem.task.solver.name)[0]
    options = SolverOptions(time_limit=np.inf, apart=any(problem.time_laws))
    for_large = solver_for_large(problem.task.solver.name)
    session = SolverSession(backend, options, deadline, for_large=for_large)
    try:
        program = program_of(problem, start.maps_by_leg())
        better = improve_guess(start, program, session, effort, charts)
    except UnreachableError:
        return start
    return better.start


def is_same(first: InitialGuess, second: InitialGuess) -> bool:
    """Tell whether two guesses that were solved are the same joint path, nearly."""
    if not np.isfinite([first.estimate, second.estimate]).all():
        return False
    if abs(first.estimate - second.estimate) > 0.02 * second.estimate:
        return False
    postures = [start.postures_at(_PLACES) for start in (first, second)]
    return bool(np.abs(postures[0] - postures[1]).max() < 0.15)  # rad or m
