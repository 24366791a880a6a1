"""The batches that the search tries one after the other: initial guesses with solvers.

If the task leaves the choice of redundant joints open, guesses come from the lattice of all postures, and plans are
made in charts; the closed forms of single choices are tried only while nothing is verified. If the task names its
redundant joints or its branch, only these choices are tried. Along a prescribed joint path there is only one guess.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.optimise.backends import solvers_for
from brachis.problem.problem import Decomposition, Problem
from brachis.search.differential_ik import STRATEGIES
from brachis.search.guesses import (
    SEARCH_LEVELS,
    SearchLevel,
    chart_guesses,
    joint_space_guess,
    lattice_guesses,
    numeric_guesses,
)
from brachis.search.hopeless import refuse_hopeless
from brachis.search.joint_path import NO_TIME, DeadEnd
from brachis.search.moves import move_guesses
from brachis.search.processes import run_in_processes
from brachis.search.stages import InitialGuess

_SIZE = 12
"""Number of guesses in a batch."""
_LATTICE_SHARE = 0.4
"""Fraction of the remaining time in which the guesses of a level are sought; the guesses found by then are tried."""

Lattices = list[tuple[Decomposition | None, DeadEnd]]
"""Lattices that gave no guesses (None for the lattice of all postures), and where they end."""
GuessesAndLattices = tuple[list[InitialGuess], Lattices]


@dataclass(frozen=True)
class Batch:
    """Guesses that are tried together.

    Attributes
    ----------
    guesses : sequence of InitialGuess
        Guesses, each with the solver that plans from it.
    refined : int
        Maximum number of candidates that are refined and verified once a motion is verified.
    fallback : bool
        Whether the batch is tried only while no motion is verified.
    lattices : list of (Decomposition or None, DeadEnd)
        Lattices that gave no guesses (None for the lattice of all postures), and where they end.
    """

    guesses: Sequence[InitialGuess] = ()
    refined: int = 0
    fallback: bool = True
    lattices: Lattices = field(default_factory=list)


def _with_solvers(
    guesses: Sequence[InitialGuess], solvers: Sequence[str]
) -> list[InitialGuess]:
    """Combine guesses with solvers."""
    return [replace(guess, solver=solver) for solver in solvers for guess in guesses]


def batches(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    deadline: Deadline,
    listener: Listener,
) -> Iterator[Batch]:
    """Yield batches: level by level the most promising guesses with the first solver, then fallbacks.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
    deadline : Deadline
        Joint paths not found by then are left out.
    listener : callable

    Yields
    ------
    Batch

    Raises
    ------
    PlanningError
        No motion along any joint path can reach a given speed, or meet a limit on the mean of a load.
    """
    solvers = [solver.name for solver in solvers_for(problem.task.solver.name)]
    levels = SEARCH_LEVELS[problem.task.search.effort]
    if not problem.task_map.m:
        find = partial(_guess_moves, problem, deadline, listener)
        yield from _batches_with_fallbacks(levels, solvers, find)
        return
    if not problem.task_map.is_of_tool:
        guess = joint_space_guess(problem)
        refuse_hopeless([guess])
        for number, solver_guess in enumerate(_with_solvers([guess], solvers)):
            yield Batch([solver_guess], 1, fallback=number > 0)
        return
    if has_charts(problem, decompositions):
        find = partial(_guess_in_charts, problem, decompositions, deadline, listener)
        yield from _batches_with_fallbacks(levels, solvers, find)
        levels = tuple(replace(level, fallback=True) for level in levels)
    if not decompositions:
        return
    find = partial(_guess_on_branches, decompositions, deadline, listener)
    guesses = yield from _level_by_level(levels, solvers, find)
    many = len(guesses) + len(STRATEGIES)
    tried = {(guess.joint_map.redundant_joints, guess.origin) for guess in guesses}
    yield Batch(_with_solvers(guesses[:_SIZE], solvers[1:2]), many)
    for decomposition in decompositions[: levels[-1].decompositions]:
        for guess in numeric_guesses(decomposition, len(STRATEGIES), deadline):
            if (guess.joint_map.redundant_joints, guess.origin) not in tried:
                yield Batch(_with_solvers([guess], solvers[:2]), many)
    yield Batch(_with_solvers(guesses[:2], solvers[2:]), many)


def has_charts(problem: Problem, decompositions: Sequence[Decomposition]) -> bool:
    """Tell whether motions are planned in charts: the choice of joints is open, and the robot is redundant."""
    task = problem.task
    is_open = task.redundant_joints == task.branch == "auto"
    if not is_open or task.search.guesses != "lattice":
        return False
    return problem.task_map.is_of_tool and (problem.r > 0 or not decompositions)


def _batches_with_fallbacks(
    levels: Sequence[SearchLevel],
    solvers: Sequence[str],
    find: Callable[[SearchLevel], GuessesAndLattices],
) -> Iterator[Batch]:
    """Yield the batches of all levels, then the first guesses with the other solvers."""
    guesses = yield from _level_by_level(levels, solvers, find)
    for solver in solvers[1:]:
        yield Batch(_with_solvers(guesses[:_SIZE], [solver]), len(guesses))


def _level_by_level(
    levels: Sequence[SearchLevel],
    solvers: Sequence[str],
    find: Callable[[SearchLevel], GuessesAndLattices],
) -> Generator[Batch, None, list[InitialGuess]]:
    """Yield batches of the guesses of each level, with the first solver; return the guesses of all levels."""
    guesses = []
    for level in levels:
        if level.fallback:
            # The search may end here, before lattices are searched.
            yield Batch()
        level_guesses, lattices = find(level)
        guesses += level_guesses
        for first in range(0, max(1, len(level_guesses)), _SIZE):
            yield Batch(
                _with_solvers(level_guesses[first : first + _SIZE], solvers[:1]),
                level.refined,
                level.fallback,
                [] if first else lattices,
            )
    return guesses


def _guess_moves(
    problem: Problem, deadline: Deadline, listener: Listener, level: SearchLevel
) -> GuessesAndLattices:
    """Find guesses of a move."""
    guesses = move_guesses(problem, level, deadline.part(_LATTICE_SHARE), listener)
    refuse_hopeless(guesses)
    return guesses, []


def _guess_in_charts(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    deadline: Deadline,
    listener: Listener,
    level: SearchLevel,
) -> GuessesAndLattices:
    """Find guesses in charts."""
    listener("looking for joint paths on the lattice of all postures")
    soon = deadline.part(_LATTICE_SHARE)
    outcome = chart_guesses(problem, decompositions, level, soon, listener)
    if isinstance(outcome, DeadEnd):
        return [], [(None, outcome)]
    return outcome, []


def _guess_on_branches(
    decompositions: Sequence[Decomposition],
    deadline: Deadline,
    listener: Listener,
    level: SearchLevel,
) -> GuessesAndLattices:
    """Find guesses on the branches of closed forms; decompositions without a joint path make room for others."""
    lattices: Lattices = []
    for first in range(0, len(decompositions), level.decompositions):
        some_decompositions = decompositions[first : first + level.decompositions]
        guesses, new_lattices = _guess_on_some_branches(
            some_decompositions, deadline, listener, level
        )
        lattices += new_lattices
        if guesses:
            refuse_hopeless(guesses)
            return guesses, lattices
    return [], lattices


def _guess_on_some_branches(
    decompositions: Sequence[Decomposition],
    deadline: Deadline,
    listener: Listener,
    level: SearchLevel,
) -> GuessesAndLattices:
    """Take a guess from every decomposition in turn; each gives the guesses with the least estimated times first."""
    search = decompositions[0].problem.task.search
    if search.guesses == "numeric":
        count = level.joint_paths
        numeric = (
            numeric_guesses(decomposition, count, deadline)
            for decomposition in decompositions
        )
        return list(itertools.chain(*numeric)), []
    deadline = deadline.part(_LATTICE_SHARE)
    outcomes = run_in_processes(
        _guess_for, decompositions, level, deadline, jobs=search.jobs, listener=listener
    )
    ranked: list[tuple[int, InitialGuess]] = []
    lattices: Lattices = []
    for decomposition, outcome in zip(decompositions, list(outcomes), strict=True):
        if isinstance(outcome, DeadEnd):
            lattices.append((decomposition, outcome))
            continue
        # Guesses that another process found have a copy of the problem.
        guesses = [replace(guess, problem=decomposition.problem) for guess in outcome]
        guesses.sort(key=lambda guess: guess.estimate)
        ranked += enumerate(
            guesses + numeric_guesses(decomposition, level.numeric, deadline)
        )
    ranked.sort(key=lambda item: (item[0], item[1].estimate))
    count = level.in_closed_forms // max(1, len(decompositions[0].redundant))
    return [guess for _, guess in ranked[: max(1, count)]], lattices


def _guess_for(
    decomposition: Decomposition,
    level: SearchLevel,
    deadline: Deadline,
    listener: Listener,
) -> list[InitialGuess] | DeadEnd:
    if deadline.passed:
        return DeadEnd(0.0, NO_TIME)
    place = "branches"
    if decomposition.redundant:
        place = f"lattice of {decomposition.name}"
    listener(f"looking for joint paths on the {place}")
    return lattice_guesses(decomposition, level, deadline, listener)
