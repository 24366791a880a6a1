"""What the search tries, batch after batch: initial guesses with solvers.

If the task leaves the choice of redundant joints open, guesses come from the lattice of all postures, and plans are
made in charts. A task that names its redundant joints or its branch gets these alone. Along a path of joints there is
one guess, and no choice.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.optimise.backends import solvers_for
from brachis.problem.problem import Decomposition, Problem
from brachis.robot.task_map import JointSpace
from brachis.search.guesses import (
    SEARCH_LEVELS,
    SearchLevel,
    joint_space_guess,
    lattice_guesses,
    numeric_guesses,
)
from brachis.search.hopeless import refuse_hopeless
from brachis.search.joint_path import DeadEnd
from brachis.search.stages import InitialGuess

_SIZE = 12
"""Guesses of a batch."""
_LATTICE_SHARE = 0.4
"""Part of the time left in which the guesses of a level are looked for; those found by then are tried."""

Lattices = list[tuple[Decomposition | None, DeadEnd]]
"""Lattices that gave no guesses (None: of all postures), and where they end."""
GuessesAndLattices = tuple[list[InitialGuess], Lattices]


@dataclass(frozen=True)
class Batch:
    """Guesses that are tried together.

    Attributes
    ----------
    guesses : sequence of InitialGuess
        With the solvers that plan from them.
    refined : int
        Largest number of them that are refined and verified once a motion is verified.
    fallback : bool
        Whether it is tried only while no motion is verified.
    lattices : list of (Decomposition or None, DeadEnd)
        Lattices that gave no guesses (None: of all postures), and where they end.
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
        Joint paths that are not found by then are left out.
    listener : callable

    Yields
    ------
    Batch

    Raises
    ------
    PlanningError
        No motion along any joint path can hold a speed, or a mean of a load.
    """
    solvers = [solver.name for solver in solvers_for(problem.task.solver.name)]
    levels = SEARCH_LEVELS[problem.task.search.effort]
    if isinstance(problem.task_map, JointSpace):
        guess = joint_space_guess(problem)
        refuse_hopeless([guess])
        for number, solver_guess in enumerate(_with_solvers([guess], solvers)):
            yield Batch([solver_guess], 1, fallback=number > 0)
        return
    guesses = []
    for level in levels:
        if level.fallback:
            # The search may end here, before lattices are looked at.
            yield Batch()
        soon = deadline.part(_LATTICE_SHARE)
        level_guesses, lattices = _find_guesses(
            problem, decompositions, level, soon, listener
        )
        guesses += level_guesses
        for first in range(0, max(1, len(level_guesses)), _SIZE):
            yield Batch(
                _with_solvers(level_guesses[first : first + _SIZE], solvers[:1]),
                level.refined,
                level.fallback,
                [] if first else lattices,
            )
    for solver in solvers[1:]:
        yield Batch(_with_solvers(guesses[:_SIZE], [solver]), len(guesses))


def has_charts(problem: Problem, decompositions: Sequence[Decomposition]) -> bool:
    """Tell whether motions are planned in charts: the task leaves the joints open, and the robot is redundant."""
    task = problem.task
    is_open = task.redundant_joints == task.branch == "auto"
    if not is_open or task.search.guesses != "lattice":
        return False
    return problem.r > 0 or not decompositions


def _find_guesses(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    level: SearchLevel,
    deadline: Deadline,
    listener: Listener,
) -> GuessesAndLattices:
    """Find guesses in charts, or on the branches of closed forms: of the first decompositions that have any."""
    if has_charts(problem, decompositions):
        listener("looking for joint paths on the lattice of all postures")
        outcome = lattice_guesses(problem, decompositions, level, deadline, listener)
        if isinstance(outcome, DeadEnd):
            return [], [(None, outcome)]
        return outcome, []
    guesses: list[InitialGuess] = []
    lattices: Lattices = []
    remaining = level.decompositions
    for decomposition in decompositions:
        if not remaining:
            break
        if problem.task.search.guesses == "numeric":
            outcome = numeric_guesses(decomposition, level.ranked, deadline)
        else:
            listener(f"looking for joint paths on branches of {decomposition.name}")
            outcome = lattice_guesses(
                problem, [decomposition], level, deadline, listener, keeps_branch=True
            )
        if isinstance(outcome, DeadEnd):
            lattices.append((decomposition, outcome))
        elif outcome:
            guesses += outcome
            remaining -= 1
    if guesses:
        refuse_hopeless(guesses)
    guesses.sort(key=lambda guess: guess.estimate)
    return guesses, lattices
