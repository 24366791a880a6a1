"""The choice of the guesses that are worth a plan: each is improved over the path, and the fastest distinct ones stay.

If several joints are redundant, the length of a joint path and the least time along it say little about the motion that
an optimiser finds from it. A rough optimisation over the path says more and costs little. The plan then begins with the
joint path at which the rough optimisation ended.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener, ignore
from brachis.errors import UnreachableError
from brachis.optimise.backends import solvers_for
from brachis.optimise.improve import SolverSession
from brachis.optimise.retiming import COARSE, ROUGH, PathEffort
from brachis.optimise.transcription import program_of
from brachis.search.lattice import farthest
from brachis.search.over_path import CHARTS, improve_guess
from brachis.search.processes import run_in_processes
from brachis.search.stages import InitialGuess

_NEAR_LEAST = 1.01
"""Factor on the least time up to which guesses count as equally fast."""
_SAME_TIME = 0.02
"""Maximum relative difference between estimates of the same joint path."""
_SAME_POSTURE = 0.15
"""Maximum difference of a joint position along joint paths that count as the same, rad or m."""
_FEWEST = 2
"""Minimum number of guesses that are kept, however little of the time is free."""
_MOST = 8
"""Maximum number of guesses that are improved for each guess that is kept: four from a lattice, and four at random."""
_PLACES = np.linspace(0.0, 1.0, 49)
"""Path coordinates at which joint paths are compared."""


def screen(
    guesses: Sequence[InitialGuess], count: int, deadline: Deadline, listener: Listener
) -> list[InitialGuess]:
    """Choose the most promising guesses.

    Parameters
    ----------
    guesses : sequence of InitialGuess
        At least one.
    count : int
        Number of guesses to keep.
    deadline : Deadline
    listener : callable

    Returns
    -------
    list of InitialGuess
        Guesses with the better joint paths and with their least times as estimates, the fastest first.
    """
    listener(f"improving {len(guesses)} joint paths")
    improve = partial(
        _improve_in_parallel, count=count, deadline=deadline, listener=listener
    )
    if len(guesses) > _count_worthwhile(count, guesses):
        coarse = improve(_spread_out(guesses), COARSE, 1, 2)
        guesses = _choose_distinct(coarse, 2 * _count_worthwhile(count, coarse))
    better = improve(guesses, ROUGH, CHARTS, 1)
    return _choose_distinct(better, _count_worthwhile(count, better))


def screen_coarsely(
    guesses: Sequence[InitialGuess], count: int, deadline: Deadline, listener: Listener
) -> list[InitialGuess]:
    """Choose guesses like `screen`, but after the coarse improvement: more accuracy hardly changes curves of moves."""
    listener(f"improving {len(guesses)} joint paths")
    order = _spread_out(guesses)
    coarse = _improve_in_parallel(
        order, COARSE, 1, 1, count=count, deadline=deadline, listener=listener
    )
    return _choose_distinct(coarse, count)


def _count_worthwhile(count: int, guesses: Sequence[InitialGuess]) -> int:
    """Tell how many of `count` guesses are worth keeping if the task fixes a part of the least known time."""
    return max(min(count, _FEWEST), round(count * _free_share(guesses)))


def _free_share(guesses: Sequence[InitialGuess]) -> float:
    """Return the fraction of the least time that the task does not fix, which is the most that can be gained."""
    problem = guesses[0].problem
    durations = [law.duration for law in problem.time_laws if law is not None]
    fixed_time = sum(durations) + problem.dwell_time
    least = min(guess.estimate for guess in guesses)
    return 1.0 - fixed_time / least if np.isfinite(least) else 1.0


def _choose_distinct(guesses: Sequence[InitialGuess], count: int) -> list[InitialGuess]:
    """Choose the fastest guesses, one for each joint path; guesses without a time count only if no guess has one."""
    timed = [guess for guess in guesses if np.isfinite(guess.estimate)]
    chosen: list[InitialGuess] = []
    for guess in sorted(timed or guesses, key=lambda guess: guess.estimate):
        if not any(is_same(guess, chosen_guess) for chosen_guess in chosen):
            chosen.append(guess)
    return chosen[:count]


def _spread_out(guesses: Sequence[InitialGuess]) -> list[InitialGuess]:
    """Order guesses so that each differs most from all earlier guesses; of equal guesses, only the first one is kept.

    Guesses close to each other end in the same optimum. If guesses that are far apart do so, the others do too. Guesses
    without some of their postures come last.
    """
    paths = np.array([guess.postures_at(_PLACES).ravel() for guess in guesses])
    (known,) = np.isfinite(paths).all(axis=1).nonzero()
    order = known[:1].tolist()
    if len(known) > 1:
        points = paths[known]
        order += known[farthest(points, points[:1], len(points) - 1)].tolist()
    order += np.setdiff1d(np.arange(len(guesses)), known).tolist()
    return [guesses[number] for number in dict.fromkeys(order)]


def _improve_in_parallel(
    guesses: Sequence[InitialGuess],
    effort: PathEffort,
    charts: int,
    spare: int,
    *,
    count: int,
    deadline: Deadline,
    listener: Listener,
) -> list[InitialGuess]:
    """Improve guesses until, for each one kept, `spare` end close to the least time: more are hardly faster."""
    work = run_in_processes(
        improve_quickly,
        guesses,
        deadline,
        effort,
        charts,
        jobs=guesses[0].problem.task.search.jobs,
        listener=listener,
    )
    solved = []
    with closing(work) as outcomes:
        for outcome in outcomes:
            solved.append(outcome)
            least = min(guess.estimate for guess in solved)
            is_near = [
                guess.estimate <= _NEAR_LEAST * least < np.inf for guess in solved
            ]
            worthwhile = _count_worthwhile(count, solved)
            is_enough = sum(is_near) >= spare * worthwhile
            if is_enough or len(solved) >= _MOST * worthwhile:
                break
    return solved


def improve_quickly(
    guess: InitialGuess,
    deadline: Deadline,
    effort: PathEffort,
    charts: int,
    _listener: Listener,
) -> InitialGuess:
    """Improve a guess over the path; if that fails, keep the estimate of an improved one, else set it to infinity."""
    if not guess.is_improved:
        guess = replace(guess, estimate=np.inf)
    if deadline.passed:
        return guess
    problem = guess.problem
    backend = solvers_for(problem.task.solver.name)[0]
    session = SolverSession.for_task(
        backend, problem, guess.joint_map, deadline, ignore
    )
    try:
        program = program_of(problem, guess.maps_by_leg()).at_rest()
        better = improve_guess(guess, program, session, effort, charts)
    except UnreachableError:
        return guess
    return better.guess


def is_same(first: InitialGuess, second: InitialGuess) -> bool:
    """Tell whether two improved guesses have nearly the same joint path."""
    if not np.isfinite([first.estimate, second.estimate]).all():
        return False
    if abs(first.estimate - second.estimate) > _SAME_TIME * second.estimate:
        return False
    postures = [guess.postures_at(_PLACES) for guess in (first, second)]
    return bool(np.abs(postures[0] - postures[1]).max() < _SAME_POSTURE)
