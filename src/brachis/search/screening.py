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
"""Factor on the least time up to which others are as fast, about."""
_PLACES = np.linspace(0.0, 1.0, 49)
"""Places at which joint paths are compared."""


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
    if len(starts) <= most:
        return _choose_distinct(improve(starts, ROUGH, CHARTS, most), most)
    coarse = improve(_spread_out(starts), COARSE, 1, 2 * most)
    chosen = _choose_distinct(coarse, 2 * most)
    chosen = _choose_distinct(improve(chosen, ROUGH, CHARTS, most), most)
    # Of many, one half of those as fast as the fastest is enough.
    alike = max(2, most // 2)
    slower = [
        start
        for start in chosen[alike:]
        if start.estimate > _NEAR_LEAST * chosen[0].estimate
    ]
    return chosen[:alike] + slower


def _choose_distinct(starts: Sequence[InitialGuess], most: int) -> list[InitialGuess]:
    """Choose the fastest of guesses, one of each joint path; those without a time only if none has one."""
    timed = [start for start in starts if np.isfinite(start.estimate)]
    chosen: list[InitialGuess] = []
    for start in sorted(timed or starts, key=lambda start: start.estimate):
        if not any(is_same(start, other) for other in chosen):
            chosen.append(start)
    return chosen[:most]


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
    """Improve guesses until `alike` of them end near the least end time: others are unlikely to end below it."""
    work = run_in_processes(
        improve_quickly,
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
            least = min(each.estimate for each in solved)
            is_near = [each.estimate <= _NEAR_LEAST * least < np.inf for each in solved]
            if sum(is_near) >= alike:
                break
    return solved


def improve_quickly(
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
