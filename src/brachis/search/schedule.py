"""What the search tries, batch after batch: starts with solvers.

Where the task leaves the choice of redundant joints open, starts come from the lattice of all postures, and plans are
made in charts; the closed forms of single choices are tried only while nothing is verified. A task that names its
redundant joints or its branch gets these alone. Along a path of joints there is one start, and no choice.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.optimise.backends import solver_named
from brachis.optimise.candidate import InitialGuess
from brachis.problem.problem import Decomposition, Problem
from brachis.robot.task_map import JointSpace
from brachis.search.chart_starts import chart_starts
from brachis.search.differential_ik import STRATEGIES
from brachis.search.holding import check_holding
from brachis.search.joint_path import DeadEnd
from brachis.search.levels import SEARCH_LEVELS, SearchLevel
from brachis.search.processes import each, processes
from brachis.search.starts import joint_space_start, lattice_starts, numeric_starts
from brachis.search.too_fast import refuse_hopeless_speeds

_SIZE = 12
_LATTICE_SHARE = 0.4
"""Part of the time that is left in which the starts of a level are looked for; those found by then are planned."""
Note = Callable[[Decomposition | None, DeadEnd | None], None]
"""Told why a choice gives no starts: where its lattice ends, or None where the time was up."""


@dataclass(frozen=True)
class Batch:
    """Starts that are tried together.

    Attributes
    ----------
    starts : tuple of InitialGuess
        With the solvers that plan from them.
    refined : int
        How many of them are refined and verified at most once a motion is verified.
    fallback : bool
        Whether it is tried only while no motion is verified.
    """

    starts: tuple[InitialGuess, ...]
    refined: int
    fallback: bool = False


def batches(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    deadline: Deadline,
    listener: Listener,
    note: Note,
) -> Iterator[Batch]:
    """Yield batches: level by level the most promising starts with the first solver, then what is tried where all fail.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
    deadline : Deadline
        Joint paths that are not found by then are left out.
    listener : callable
    note : callable
        Told of decompositions whose lattice has no joint path, and of those for which there was no time.

    Yields
    ------
    Batch
    """
    curved = any(limit.guarantee.is_mean for limit in problem.limits)
    solvers = [
        solver.name for solver in solver_named(problem.task.solver.name, curved=curved)
    ]
    levels = SEARCH_LEVELS[problem.task.search.effort]
    if isinstance(problem.task_map, JointSpace):
        yield from _timings(problem, solvers)
        return
    if charts_allowed(problem, decompositions):
        yield from _in_charts(
            problem, decompositions, solvers, deadline, listener, note
        )
        levels = tuple(dataclasses.replace(level, fallback=True) for level in levels)
    if decompositions:
        yield from _in_closed_forms(
            decompositions, levels, solvers, deadline, listener, note
        )


def _timings(problem: Problem, solvers: Sequence[str]) -> Iterator[Batch]:
    """Yield batches for a path of joints: its timing alone is planned, solver after solver."""
    start = joint_space_start(problem)
    check_holding([start])
    refuse_hopeless_speeds([start])
    for solver in solvers:
        yield Batch((start.with_solver(solver),), 1, fallback=solver != solvers[0])


def _in_closed_forms(
    decompositions: Sequence[Decomposition],
    levels: Sequence[SearchLevel],
    solvers: Sequence[str],
    deadline: Deadline,
    listener: Listener,
    note: Note,
) -> Iterator[Batch]:
    """Yield batches of starts on the branches of closed forms."""
    task = decompositions[0].problem.task
    known: list[InitialGuess] = []
    for level in levels:
        if level.fallback:
            yield Batch(
                (), 0, fallback=True
            )  # the search may end here, before lattices are looked at
        starts: list[InitialGuess] = []
        rest = list(decompositions)
        while (
            rest and not starts
        ):  # decompositions without a joint path make room for others
            batch = rest[: level.decompositions]
            rest = rest[level.decompositions :]
            if task.search.guesses == "numeric":
                starts = [
                    start
                    for decomposition in batch
                    for start in numeric_starts(
                        decomposition, level.joint_paths, deadline
                    )
                ]
            else:
                starts = _from_lattices(batch, level, deadline, listener, note)
        known += starts
        check_holding(known)
        refuse_hopeless_speeds(known)
        for first in range(0, len(starts), _SIZE):
            yield Batch(
                tuple(
                    start.with_solver(solvers[0])
                    for start in starts[first : first + _SIZE]
                ),
                level.refined,
                level.fallback,
            )
    many = len(known) + len(STRATEGIES)
    tried = {(start.joint_map.redundant_joints, start.origin) for start in known}
    again = tuple(
        start.with_solver(solver) for start in known[:_SIZE] for solver in solvers[1:2]
    )
    yield Batch(again, many, fallback=True)
    for decomposition in decompositions[: level.decompositions]:
        for start in numeric_starts(decomposition, len(STRATEGIES), deadline):
            if (start.joint_map.redundant_joints, start.origin) not in tried:
                yield Batch(
                    tuple(start.with_solver(solver) for solver in solvers[:2]),
                    many,
                    fallback=True,
                )
    yield Batch(
        tuple(
            start.with_solver(solver) for solver in solvers[2:] for start in known[:2]
        ),
        many,
        fallback=True,
    )


def charts_allowed(problem: Problem, decompositions: Sequence[Decomposition]) -> bool:
    """Tell whether motions may be planned in charts: nobody asks for a choice of joints, and there is redundancy."""
    task = problem.task
    asked = (
        task.redundant_joints != "auto"
        or task.branch != "auto"
        or task.search.guesses != "lattice"
    )
    return not asked and (problem.robot.n > problem.task_map.m or not decompositions)


def _in_charts(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    solvers: Sequence[str],
    deadline: Deadline,
    listener: Listener,
    note: Note,
) -> Iterator[Batch]:
    """Yield batches of starts in charts: level by level with the first solver, then with the others."""
    known: list[InitialGuess] = []
    for level in SEARCH_LEVELS[problem.task.search.effort]:
        if level.fallback:
            yield Batch((), 0, fallback=True)
        listener("looking for joint paths on the lattice of all postures")
        starts = chart_starts(
            problem, decompositions, level, deadline.part(_LATTICE_SHARE), listener
        )
        if isinstance(starts, DeadEnd):
            note(None, starts)
            continue
        if not starts:
            note(None, None)
        known += starts
        yield Batch(
            tuple(start.with_solver(solvers[0]) for start in starts),
            level.refined,
            level.fallback,
        )
    for solver in solvers[1:]:
        yield Batch(
            tuple(start.with_solver(solver) for start in known[:_SIZE]),
            len(known),
            fallback=True,
        )


def _from_lattices(
    decompositions: Sequence[Decomposition],
    level: SearchLevel,
    deadline: Deadline,
    listener: Listener,
    note: Note,
) -> list[InitialGuess]:
    """Take one start of every choice after the other, of each those with the least estimated times first."""
    search = decompositions[0].problem.task.search
    redundancy = max(1, len(decompositions[0].redundant))
    ranked: list[tuple[int, float, int, InitialGuess]] = []
    number = itertools.count()
    deadline = deadline.part(_LATTICE_SHARE)
    jobs = processes(search.jobs, deadline)
    outcomes = list(
        each(
            _starts_of,
            decompositions,
            level,
            search.seed,
            deadline,
            jobs=jobs,
            listener=listener,
        )
    )
    for decomposition, outcome in zip(decompositions, outcomes, strict=True):
        if isinstance(outcome, DeadEnd):
            note(decomposition, outcome)
            continue
        if not outcome:
            note(decomposition, None)
        own = [
            dataclasses.replace(start, problem=decomposition.problem)
            for start in outcome
        ]
        own = sorted(own, key=lambda start: start.estimate) + numeric_starts(
            decomposition, level.numeric, deadline
        )
        ranked += [
            (place, start.estimate, next(number), start)
            for place, start in enumerate(own)
        ]
    return [
        start
        for *_, start in sorted(ranked, key=lambda item: item[:-1])[
            : max(1, level.in_closed_forms // redundancy)
        ]
    ]


def _starts_of(
    decomposition: Decomposition,
    level: SearchLevel,
    seed: int,
    deadline: Deadline,
    listener: Listener,
) -> list[InitialGuess] | DeadEnd:
    if deadline.passed:
        return []
    listener(f"looking for joint paths on the lattice of {decomposition.name}")
    return lattice_starts(decomposition, level, seed, deadline)
