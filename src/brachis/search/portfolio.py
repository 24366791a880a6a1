"""The search: starts from lattices, solved coarsely, ranked, the best finished.

1. Lattices give starts (see `schedule`); they are solved at the first collocation points.
2. Candidates that agree are merged. In the order of their end times the others are refined and verified, as long as they
   may beat the best verified one: refinement adds rows, so that over the same knots and in the same coordinates the
   coarse end time of an optimum bounds its refined one from below. In charts, where the coordinates may still be
   changed, coarse end times are compared with each other.
3. Only while nothing is verified, other solvers, the closed forms of single choices and numeric guesses are tried.

What comes out does not depend on the number of processes: work that one process would not have done is thrown away.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing

from brachis.common import interrupts
from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.optimise.candidate import Candidate, InitialGuess
from brachis.problem.problem import Decomposition, Problem
from brachis.search import candidates
from brachis.search.failure import no_motion, out_of_time, refuse_what_is_out_of_reach
from brachis.search.holding import explain_holding
from brachis.search.processes import each, processes
from brachis.search.record import NOT_TRIED, Numbered, Record, round_end_time
from brachis.search.schedule import Batch, batches
from brachis.search.too_fast import out_of_reach, unlikely

_COARSE_SHARE = 0.6
"""Part of the time limit after which no start is solved while nothing is verified."""
_LEAST_SHARE = 2.0
"""Seconds that the solve from any start may take, however many starts there are."""
_LARGEST_SHARE = 0.15
"""Part of the time limit that the solve from one start may take at most."""
_GRACE = 1.0
"""Seconds to finish the best candidate where the time is up and nothing is verified."""
_LAST_CHANCES = 3
"""Candidates of which one becomes the unverified motion where none could be finished."""


def find_fastest(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    deadline: Deadline,
    listener: Listener,
    first: InitialGuess | None = None,
) -> Record:
    """Search for the fastest verified motion.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
        The most promising first.
    deadline : Deadline
        When to return the best motion so far; one that is not verified where none is.
    listener : callable
    first : InitialGuess, optional
        Tried alone; nothing else is where it leads to a verified motion.

    Returns
    -------
    Record
        With a best candidate: the fastest verified one, or the one nearest to the limits.

    Raises
    ------
    PathError
        The path is out of reach, or no posture along it is allowed at rest.
    PlanningError
        No motion was found.
    KeyboardInterrupt
        Ctrl-C before any motion was verified; its text tells of the best one, if there is one.
    """
    search = _Search(problem, decompositions, deadline, listener)
    record = search.record
    try:
        if first is not None:
            search.run([Batch((first,), 1)])
        if not record.content:
            search.run(
                batches(
                    problem, decompositions, deadline, listener, record.report_dead_end
                )
            )
    except KeyboardInterrupt:
        interrupts.clear()
        record.interrupted = True
        search.take_what_there_is()
        if not record.content:
            raise KeyboardInterrupt(record.best_in_words()) from None
    if record.best is not None:
        return record
    if record.too_fast is not None:
        raise record.too_fast.error
    heavy = explain_holding(
        [
            candidate.start
            for candidate in record.candidates
            if candidate.start is not None
        ]
    )
    if heavy is not None:
        raise heavy
    if record.interrupted or record.cut_short(problem.task.solver.time_limit):
        record.interrupted = True
        raise out_of_time(problem.task, record.not_completed())
    raise no_motion(
        problem, decompositions, record.candidates, record.dead_ends, deadline
    )


def is_planned(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    deadline: Deadline,
    most: int | None = None,
) -> bool | None:
    """Tell whether a verified motion is found by the first batches of a search.

    Parameters
    ----------
    problem, decompositions, deadline
        See `find_fastest`.
    most : int, optional
        How many batches are tried; all of them where it is left out.

    Returns
    -------
    bool or None
        None where there may be one yet: not all batches were tried, or the robot has more joint paths than these have.
    """

    def listener(_text: str) -> None:
        """Hear nothing."""

    search = _Search(problem, decompositions, deadline, listener)
    schedule = batches(
        problem, decompositions, deadline, listener, search.record.report_dead_end
    )
    search.run(itertools.islice(schedule, most))
    best = search.record.best
    if best is not None and best.verified:
        return True
    return None if most or problem.robot.n > problem.task_map.m else False


class _Search:
    """A search on its way."""

    def __init__(
        self,
        problem: Problem,
        decompositions: Sequence[Decomposition],
        deadline: Deadline,
        listener: Listener,
    ) -> None:
        self._decompositions = decompositions
        self._deadline = deadline
        self._listener = listener
        self._task = problem.task
        self.record = Record(refined=self._task.refinement.max_rounds > 0)

    @property
    def _jobs(self) -> int:
        return processes(self._task.search.jobs, self._deadline)

    @property
    def _latest(self) -> Deadline:
        """When the last work ends: later while nothing is verified."""
        return self._deadline if self.record.content else self._deadline.extend(_GRACE)

    def run(self, schedule: Iterable[Batch]) -> None:
        """Try batch after batch."""
        refused = False
        for batch in schedule:
            if batch.fallback and self.record.content:
                return
            if self._deadline.passed:
                self.record.begin(0 if batch.fallback else len(batch.starts))
                self.record.interrupted = True
                break
            if batch.fallback and not refused:
                refuse_what_is_out_of_reach(
                    self._decompositions, self.record.candidates, self._deadline
                )
                self._refuse_what_is_too_fast()
                refused = True
            self._finish(self._solve(batch), batch.refined)
        if self.record.interrupted:
            self.take_what_there_is()

    def _refuse_what_is_too_fast(self) -> None:
        """Find out whether a least speed is to blame that nothing was found, and refuse one that is far too high."""
        limit = self._deadline.part(_COARSE_SHARE).within(_LEAST_SHARE)
        record = self.record
        record.too_fast = out_of_reach(
            record.candidates,
            lambda start: candidates.solve_candidate(start, limit, self._listener),
        )
        if record.too_fast is not None and unlikely(record.too_fast):
            raise record.too_fast.error

    def _solve(self, batch: Batch) -> list[Numbered]:
        """Solve the starts of a batch coarsely, and rank those that differ."""
        record = self.record
        known = len(self.record.solved)
        record.begin(len(batch.starts))
        limit = self._deadline if record.content else self._deadline.part(_COARSE_SHARE)
        share = self._task.search.time_limit * min(
            _LARGEST_SHARE, _COARSE_SHARE / max(1, len(batch.starts))
        )
        work = (
            _solved_in_time,
            batch.starts,
            candidates.solve_candidate,
            limit,
            max(_LEAST_SHARE, share),
        )
        with closing(each(*work, jobs=self._jobs, listener=self._listener)) as outcomes:
            for candidate in outcomes:
                record.add(candidate)
        # In the last resort a motion that could not be verified gets another chance, with another solver.
        return record.ranked(record.solved[known:], again=batch.fallback)

    def _finish(self, ranked: Sequence[Numbered], most: int) -> None:
        """Refine and verify candidates in the order of their end times while they may be the fastest."""
        jobs = self._jobs
        left = most
        for first in range(0, len(ranked), jobs):
            batch = ranked[first : first + jobs]
            if not self._goes_on(ranked[first:], left):
                return
            work = (
                candidates.finish_candidate,
                [candidate for _, candidate in batch],
                self._latest,
            )
            with closing(each(*work, jobs=jobs, listener=self._listener)) as outcomes:
                for place, candidate in enumerate(outcomes):
                    if place and not self._goes_on(ranked[first + place :], left):
                        return
                    left -= 1
                    self.record.finish(batch[place][0], candidate)
                    self._listener(
                        f"{candidate.solver}: t_E = {candidate.t_end:.4f} s, {candidate.status}"
                    )

    def _goes_on(self, ranked: Sequence[Numbered], left: int) -> bool:
        """Tell whether the first one of the candidates that are left is worth finishing."""
        if not self.record.may_win(ranked[0][1]) or (self.record.content and left <= 0):
            self.record.drop(ranked)
            return False
        if self._latest.passed:
            self.record.interrupted = True
            return False
        return True

    def take_what_there_is(self) -> None:
        """Verify the best candidates as they are until one gives a motion, where none is known."""
        over = Deadline(0.0)
        for number, candidate in sorted(
            self.record.solved, key=lambda item: round_end_time(item[1].coarse)
        )[:_LAST_CHANCES]:
            if self.record.best is not None:
                return
            self.record.finish(
                number, candidates.finish_candidate(candidate, over, lambda _text: None)
            )


def _solved_in_time(
    start: InitialGuess,
    solve: Callable[[InitialGuess, Deadline, Listener], Candidate],
    deadline: Deadline,
    share: float,
    listener: Listener,
) -> Candidate:
    """Solve from a start within its share of the time, s, unless the time is up."""
    if deadline.passed:
        return Candidate.of(start, NOT_TRIED)
    return solve(start, deadline.within(share), listener)
