"""What the search tries, batch after batch: starts with solvers."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from brachis.attempt import Start
from brachis.deadline import Deadline
from brachis.nlp.numeric_course import STRATEGIES
from brachis.search.course import DeadEnd
from brachis.search.efforts import EFFORTS, Effort
from brachis.search.processes import each, processes
from brachis.search.solving import Listener
from brachis.search.starts import lattice_starts, numeric_starts
from brachis.setting import Choice
from brachis.solvers import solver_named

_SIZE = 12
_CRAMPED = 0.1
_SEED_SHARE = 0.4
"""Part of the time that is left in which the starts of a level are looked for; those found by then are planned."""
Note = Callable[[Choice, DeadEnd | None], None]
"""Told why a choice gives no starts: where its lattice ends, or None where the time was up."""


@dataclass(frozen=True)
class Batch:
    """Starts that are tried together.

    Attributes
    ----------
    starts : tuple of Start
        With the solvers that plan from them.
    refined : int
        How many of them are refined and verified at most once a motion is verified.
    last_resort : bool
        Whether it is tried only while no motion is verified.
    """

    starts: tuple[Start, ...]
    refined: int
    last_resort: bool = False


def batches(choices: Sequence[Choice], deadline: Deadline, listener: Listener, note: Note) -> Iterator[Batch]:
    """Yield batches: level by level the most promising starts with the first solver, then what is tried where all fail.

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
    Batch
    """
    task = choices[0].setting.task
    solvers = [solver.name for solver in solver_named(task.solver.name)]
    known: list[Start] = []
    for effort in EFFORTS[task.search.effort]:
        if effort.last_resort:
            yield Batch((), 0, last_resort=True)  # the search may end here, before lattices are looked at
        allowed = looked_at(choices, effort)
        starts: list[Start] = []
        rest = allowed or list(choices)
        while rest and not starts:  # choices without a course make room for others
            batch, rest = rest[: effort.choices], rest[effort.choices :]
            if task.search.guesses == "numeric":
                starts = [start for choice in batch for start in numeric_starts(choice, effort.seeds, deadline)]
            else:
                starts = _from_lattices(batch, effort, deadline, listener, note)
        known += starts
        for first in range(0, len(starts), _SIZE):
            yield Batch(
                tuple(start.with_solver(solvers[0]) for start in starts[first : first + _SIZE]),
                effort.refined,
                effort.last_resort,
            )
    many, tried = len(known) + len(STRATEGIES), {(start.choice.name, start.origin) for start in known}
    again = tuple(start.with_solver(solver) for start in known[:_SIZE] for solver in solvers[1:2])
    yield Batch(again, many, last_resort=True)
    for choice in (allowed or choices)[: effort.choices]:
        for start in numeric_starts(choice, len(STRATEGIES), deadline):
            if (choice.name, start.origin) not in tried:
                yield Batch(tuple(start.with_solver(solver) for solver in solvers[:2]), many, last_resort=True)
    yield Batch(
        tuple(start.with_solver(solver) for solver in solvers[2:] for start in known[:2]), many, last_resort=True
    )


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
) -> list[Start]:
    """Take one start of every choice after the other, of each those with the least estimated times first."""
    search = choices[0].setting.task.search
    redundancy = max(1, len(choices[0].redundant))
    ranked: list[tuple[int, float, int, Start]] = []
    number = itertools.count()
    jobs, deadline = processes(search.jobs), deadline.part(_SEED_SHARE)
    outcomes = list(each(_starts_of, choices, effort, search.seed, deadline, jobs=jobs, listener=listener))
    for choice, outcome in zip(choices, outcomes, strict=True):
        if isinstance(outcome, DeadEnd):
            note(choice, outcome)
            continue
        if not outcome:
            note(choice, None)
        own = [dataclasses.replace(start, choice=choice) for start in outcome]  # not another process's copy
        own = sorted(own, key=lambda start: start.estimate) + numeric_starts(choice, effort.numeric, deadline)
        ranked += [(place, start.estimate, next(number), start) for place, start in enumerate(own)]
    return [start for *_, start in sorted(ranked, key=lambda item: item[:-1])[: max(1, effort.plans // redundancy)]]


def _starts_of(
    choice: Choice, effort: Effort, seed: int, deadline: Deadline, listener: Listener
) -> list[Start] | DeadEnd:
    if deadline.passed:
        return []
    listener(f"looking for courses on the lattice of {choice.name}")
    return lattice_starts(choice, effort, seed, deadline)
