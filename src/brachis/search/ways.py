"""What the search tries, wave after wave: seeds with solvers."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from brachis.deadline import Deadline
from brachis.nlp.numeric_course import STRATEGIES
from brachis.search.course import DeadEnd
from brachis.search.efforts import EFFORTS, Effort
from brachis.search.seeds import Seed, lattice_seeds, numeric_seeds
from brachis.search.solving import Listener
from brachis.search.work import Way, each, processes
from brachis.setting import Choice
from brachis.solvers import solver_named

_WAVE = 12
_CRAMPED = 0.1
_SEED_SHARE = 0.4
"""Part of the time that is left in which the seeds of a level are looked for; those found by then are planned."""
Note = Callable[[Choice, DeadEnd | None], None]
"""Told why a choice gives no seeds: where its lattice ends, or None where the time was up."""


@dataclass(frozen=True)
class Wave:
    """Ways that are tried together.

    Attributes
    ----------
    ways : tuple of Way
    refined : int
        How many of them are refined and verified at most once a motion is verified.
    last_resort : bool
        Whether it is tried only while no motion is verified.
    """

    ways: tuple[Way, ...]
    refined: int
    last_resort: bool = False


def waves(choices: Sequence[Choice], deadline: Deadline, listener: Listener, note: Note) -> Iterator[Wave]:
    """Yield waves: level by level the most promising seeds with the first solver, then what is tried where all fail.

    Parameters
    ----------
    choices : sequence of Choice
    deadline : Deadline
        Courses that are not found by then are left out.
    listener : callable
    note : callable
        Told of choices whose lattice has no course, and of those for which there was no time.

    Yields
    ------
    Wave
    """
    task = choices[0].setting.task
    solvers = [solver.name for solver in solver_named(task.solver.name)]
    known: list[Seed] = []
    for effort in EFFORTS[task.search.effort]:
        if effort.last_resort:
            yield Wave((), 0, last_resort=True)  # the search may end here, before lattices are looked at
        allowed = looked_at(choices, effort)
        seeds: list[Seed] = []
        rest = allowed or list(choices)
        while rest and not seeds:  # choices without a course make room for others
            batch, rest = rest[: effort.choices], rest[effort.choices :]
            if task.search.guesses == "numeric":
                seeds = [seed for choice in batch for seed in numeric_seeds(choice, effort.seeds, deadline)]
            else:
                seeds = _from_lattices(batch, effort, deadline, listener, note)
        known += seeds
        for first in range(0, len(seeds), _WAVE):
            yield Wave(
                tuple(Way(seed, solvers[0]) for seed in seeds[first : first + _WAVE]),
                effort.refined,
                effort.last_resort,
            )
    many, tried = len(known) + len(STRATEGIES), {(seed.choice.name, seed.origin) for seed in known}
    yield Wave(tuple(Way(seed, solver) for seed in known[:_WAVE] for solver in solvers[1:2]), many, last_resort=True)
    for choice in (allowed or choices)[: effort.choices]:
        for seed in numeric_seeds(choice, len(STRATEGIES), deadline):
            if (choice.name, seed.origin) not in tried:
                yield Wave(tuple(Way(seed, solver) for solver in solvers[:2]), many, last_resort=True)
    yield Wave(tuple(Way(seed, solver) for solver in solvers[2:] for seed in known[:2]), many, last_resort=True)


def looked_at(choices: Sequence[Choice], effort: Effort) -> list[Choice]:
    """Return the choices that a level looks at: closed forms, and polynomials where asked for, or where all is cramped.

    That is where the given start, or else end, posture is near the branch boundary of every closed form.
    """
    closed = [choice for choice in choices if choice.match.solver.kind == "closed_form"]
    setting = choices[0].setting
    given = setting.start is not None or setting.end is not None
    cramped = given and max((choice.room for choice in closed), default=0.0) < _CRAMPED
    return list(choices) if effort.polynomial or cramped else closed


def _from_lattices(
    choices: Sequence[Choice],
    effort: Effort,
    deadline: Deadline,
    listener: Listener,
    note: Note,
) -> list[Seed]:
    """Take one seed of every choice after the other, of each those with the least estimated times first."""
    search = choices[0].setting.task.search
    redundancy = max(1, len(choices[0].redundant))
    ranked: list[tuple[int, float, int, Seed]] = []
    number = itertools.count()
    jobs, deadline = processes(search.jobs), deadline.part(_SEED_SHARE)
    outcomes = list(each(_seeds_of, choices, effort, search.seed, deadline, jobs=jobs, listener=listener))
    for choice, outcome in zip(choices, outcomes, strict=True):
        if isinstance(outcome, DeadEnd):
            note(choice, outcome)
            continue
        if not outcome:
            note(choice, None)
        own = [dataclasses.replace(seed, choice=choice) for seed in outcome]  # not another process's copy
        own = sorted(own, key=lambda seed: seed.estimate) + numeric_seeds(choice, effort.numeric, deadline)
        ranked += [(place, seed.estimate, next(number), seed) for place, seed in enumerate(own)]
    return [seed for *_, seed in sorted(ranked, key=lambda item: item[:-1])[: max(1, effort.plans // redundancy)]]


def _seeds_of(
    choice: Choice, effort: Effort, seed: int, deadline: Deadline, listener: Listener
) -> list[Seed] | DeadEnd:
    if deadline.passed:
        return []
    listener(f"looking for courses on the lattice of {choice.name}")
    return lattice_seeds(choice, effort, seed, deadline)
