"""The search: choices of redundant joints x branches x seeds, planned coarsely, ranked, the best finished.

1. The lattice of every choice gives seeds; those with the least estimated times are planned at the first collocation
   points.
2. Plans that agree are merged. In the order of their end times the others are refined and verified, as long as they
   may beat the best verified one: refinement adds rows, so that the coarse end time of an optimum bounds its refined
   one from below.
3. Only while nothing is verified, other solvers and numeric guesses are tried.

What comes out does not depend on the number of processes: work that one process would not have done is thrown away.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass

from brachis import interrupts
from brachis.deadline import Deadline
from brachis.errors import PlanningError
from brachis.result import Attempt, Candidate
from brachis.search.book import Book, Numbered, rounded
from brachis.search.explain import no_motion, refuse_what_is_out_of_reach
from brachis.search.finishing import Motion
from brachis.search.solving import Listener
from brachis.search.ways import Wave, waves
from brachis.search.work import each, finish, plan_coarse, processes
from brachis.setting import Choice

_COARSE_SHARE = 0.6
"""Part of the time limit after which no coarse plan is begun while nothing is verified."""
_LEAST_SHARE, _LARGEST_SHARE = 2.0, 0.15
"""Seconds that every coarse plan may take, and part of the time limit that none may exceed."""
_GRACE = 1.0
"""Seconds to finish the best plan where the time is up and nothing is verified."""
_LAST_CHANCES = 3
"""Plans of which one becomes the unverified motion where none could be finished."""


@dataclass(frozen=True)
class Found:
    """What the search found.

    Attributes
    ----------
    attempts : tuple of Attempt
        All that was finished.
    chosen : int
        Index of the attempt that gave the motion: the fastest verified one, or the one nearest to the limits.
    motion : Motion
    family : str
        Of its closed form.
    candidates : tuple of Candidate
        The fastest verified one first.
    interrupted : bool
        Whether Ctrl-C or the time limit ended the search.
    undone : tuple of str
        What was left undone, in plain words.
    """

    attempts: tuple[Attempt, ...]
    chosen: int
    motion: Motion
    family: str
    candidates: tuple[Candidate, ...]
    interrupted: bool
    undone: tuple[str, ...]


def find_fastest(choices: Sequence[Choice], deadline: Deadline, listener: Listener) -> Found:
    """Search for the fastest verified motion.

    Parameters
    ----------
    choices : sequence of Choice
        At least one, the most promising first.
    deadline : Deadline
        When to return the best motion so far; one that is not verified where none is.
    listener : callable

    Returns
    -------
    Found

    Raises
    ------
    PathError
        The path is out of reach, or too heavy to hold.
    PlanningError
        No motion was found.
    KeyboardInterrupt
        Ctrl-C before any motion was verified; its text tells of the best one, if there is one.
    """
    search = _Search(choices, deadline, listener)
    try:
        search.run(waves(choices, deadline, listener, search.book.note_choice))
    except KeyboardInterrupt:
        interrupts.forget()
        search.book.interrupted = True
        search.take_what_there_is()
        if not search.book.content:
            raise KeyboardInterrupt(str(search.book.best or "")) from None
    return search.found()


class _Search:
    """A search on its way."""

    def __init__(self, choices: Sequence[Choice], deadline: Deadline, listener: Listener) -> None:
        self._choices, self._deadline, self._listener = choices, deadline, listener
        self._task = choices[0].setting.task
        self._jobs = processes(self._task.search.jobs)
        self.book = Book(refined=self._task.refinement.max_rounds > 0)

    @property
    def _latest(self) -> Deadline:
        """When the last work ends: later while nothing is verified."""
        return self._deadline if self.book.content else self._deadline.extended(_GRACE)

    def run(self, plan: Iterable[Wave]) -> None:
        """Try wave after wave."""
        refused = False
        for wave in plan:
            if wave.last_resort and self.book.content:
                return
            if self._deadline.passed:
                self.book.begin(len(wave.ways))
                self.book.interrupted = True
                break
            if wave.last_resort and not refused:
                refuse_what_is_out_of_reach(self._choices, self.book.candidates)
                refused = True
            self._finish(self._plan(wave), wave.refined)
        if self.book.interrupted:
            self.take_what_there_is()

    def _plan(self, wave: Wave) -> list[Numbered]:
        """Plan the ways of a wave coarsely, and rank those that differ."""
        book, known = self.book, len(self.book.plans)
        book.begin(len(wave.ways))
        limit = self._deadline if book.content else self._deadline.part(_COARSE_SHARE)
        share = self._task.search.time_limit * min(_LARGEST_SHARE, _COARSE_SHARE / max(1, len(wave.ways)))
        share = max(_LEAST_SHARE, share)
        with closing(each(plan_coarse, wave.ways, limit, share, jobs=self._jobs, listener=self._listener)) as outcomes:
            for plan in outcomes:
                book.add(plan)
        # In the last resort a motion that could not be verified gets another chance, with another solver.
        return book.ranked(book.plans[known:], again=wave.last_resort)

    def _finish(self, ranked: Sequence[Numbered], most: int) -> None:
        """Refine and verify plans in the order of their end times while they may be the fastest."""
        jobs, left = self._jobs, most
        for first in range(0, len(ranked), jobs):
            batch = ranked[first : first + jobs]
            if not self._goes_on(ranked[first:], left):
                return
            with closing(each(finish, batch, self._latest, jobs=jobs, listener=self._listener)) as outcomes:
                for place, (attempt, motion) in enumerate(outcomes):
                    if place and not self._goes_on(ranked[first + place :], left):
                        return
                    left -= 1
                    self.book.record(*batch[place], attempt, motion)
                    self._listener(attempt.outcome)

    def _goes_on(self, ranked: Sequence[Numbered], left: int) -> bool:
        """Tell whether the first one of the plans that are left is worth finishing."""
        if not self.book.may_win(ranked[0][1]) or (self.book.content and left <= 0):
            self.book.drop(ranked)
            return False
        if self._latest.passed:
            self.book.interrupted = True
            return False
        return True

    def take_what_there_is(self) -> None:
        """Verify the best plans as they are until one gives a motion, where none is known."""
        over = Deadline(0.0)
        for number, plan in sorted(self.book.plans, key=lambda item: rounded(item[1].t_end))[:_LAST_CHANCES]:
            if self.book.best is not None:
                return
            self.book.record(number, plan, *finish((number, plan), over, lambda _text: None))

    def found(self) -> Found:
        """Return the best motion, or say why there is none."""
        book, best = self.book, self.book.best
        if best is None:
            if book.interrupted:
                limit = self._task.search.time_limit
                left = "; ".join(book.undone())
                problem = f"no motion was found within the time limit of {limit:g} s: {left}"
                raise PlanningError(problem, hint="Raise search.time_limit")
            raise no_motion(self._choices, book.candidates, book.dead_ends)
        order = sorted(book.candidates, key=lambda c: (not c.verified, *map(rounded, (c.t_end, c.coarse, c.estimate))))
        return Found(
            tuple(book.attempts), best.attempt, best.motion, best.family, tuple(order), book.interrupted, book.undone()
        )
