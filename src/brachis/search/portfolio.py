"""The search: guesses from lattices are ranked by the timing of their joint paths; the best are refined and verified.

1. Lattices give initial guesses, batch by batch (see `schedule`).
2. The joint paths of the guesses are improved, and the least times along them rank the candidates (see `pipeline`).
3. In the order of these times, candidates are solved over time, refined and verified, as long as they may beat the best
   verified one. Refinement slows all motions by about the same amount. So a motion that does not beat the best one
   before refinement is not refined.
4. If there is little time, or nothing is verified towards its end, a motion near a joint path is found first.
5. Other solvers, closed forms of single choices and numeric guesses are tried only while nothing is verified.

The outcome does not depend on the number of processes: work that one process would not have done is discarded.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial

import numpy as np

from brachis.common import interrupts, tolerances
from brachis.common.deadline import Deadline
from brachis.common.progress import Iteration, Listener, ignore
from brachis.common.words import name_first, write_count
from brachis.errors import BrachisError, UnreachableError
from brachis.optimise.backends import SolveStatus
from brachis.problem.problem import Decomposition, Problem
from brachis.search import pipeline
from brachis.search.chain import find_batches
from brachis.search.failure import explain_first_failures, explain_no_motion
from brachis.search.first_motion import LITTLE_TIME, find_first_motion_of
from brachis.search.given_motion import EXACT, GIVEN, given_guess
from brachis.search.holding import explain_holding, explain_postures
from brachis.search.hopeless import explain_speeds
from brachis.search.joint_path import ALL_POSTURES, NO_TIME, DeadEnd
from brachis.search.processes import process_count, run_in_processes
from brachis.search.schedule import Batch
from brachis.search.screening import is_same
from brachis.search.stages import (
    NOT_TRIED,
    SLOW,
    Candidate,
    FinishedCandidate,
    InitialGuess,
    Marks,
    RankedCandidate,
    SearchOutcome,
    begin_candidate,
    fail,
    round_end_time,
)
from brachis.trajectory import Trajectory

_LEAST_COST = 0.5
"""Knots, and limits that the phase plane does not cover, lengthen every motion. They cost a candidate at least this
fraction of the smallest cost so far. With 10 intervals, motions of a planar arm became 17 to 20 % longer."""
_RANKING_SHARE = 0.6
"""Fraction of the remaining time after which no joint path is improved while nothing is verified."""
_RESERVE = 0.3
"""Fraction of the time that is reserved for a first motion while nothing is verified."""
_LONGEST_RESERVE = 10.0
"""Maximum of this reserve, s: for a weld, a first motion takes 3 s, and three times as long on a busy machine."""
_FIRST_SHARE = 0.6
"""Fraction of the remaining time in which a first motion is sought before anything else."""
_LATER = 0.2
"""Time, s, for which the search continues after its deadline if no first motion was found."""
_REFINED = 5e-3
"""Fraction of the end time that refinement usually adds at most. If it adds more, another motion may be faster."""


class Search:
    """A search for the fastest verified motion.

    Parameters
    ----------
    problem : Problem
    decompositions : sequence of Decomposition
        The most promising ones first.
    deadline : Deadline
        When to end the search with the best motion so far, even if this is not verified.
    listener : callable

    Attributes
    ----------
    candidates : list of Candidate
        All candidates of the search.
    guesses : list of InitialGuess
        All guesses from which candidates were begun.
    best : FinishedCandidate or None
        The fastest verified candidate; if none is verified, the candidate closest to the limits.
    interrupted : bool
        Whether Ctrl-C or the time limit ended the search.
    """

    def __init__(
        self,
        problem: Problem,
        decompositions: Sequence[Decomposition],
        deadline: Deadline,
        listener: Listener,
    ) -> None:
        self.candidates: list[Candidate] = []
        self.guesses: list[InitialGuess] = []
        self.best: FinishedCandidate | None = None
        self.interrupted = False
        self._problem = problem
        self._decompositions = decompositions
        self._deadline = deadline
        self._listener = partial(self._report, listener)
        self._dead_ends: dict[str, DeadEnd] = {}
        self._unfinished_lattices: dict[str, None] = {}
        self._given_motion = ""
        self._ranked: dict[int, RankedCandidate] = {}
        self._waiting: list[int] = []
        self._finished: list[RankedCandidate] = []
        self._first_motion: FinishedCandidate | None = None
        self._reserve = min(_RESERVE * deadline.left, _LONGEST_RESERVE)
        self._least_ratio = 0.0
        self._to_beat = Marks()

    @property
    def is_satisfied(self) -> bool:
        """Whether a verified motion is known; if the task wants no refinement, any motion is enough."""
        return self.best is not None and self._merit(self.best)[0] == -np.inf

    def _merit(self, candidate: FinishedCandidate) -> tuple[float, float]:
        """Return the figures that rank motions: violation of a limit, -inf if acceptable, and end time, s."""
        if candidate.is_settled or not self._problem.task.refinement.max_rounds:
            return -np.inf, candidate.t_end
        return candidate.verification.worst_ratio - 1.0, candidate.t_end

    def _report(self, listener: Listener, text: str) -> None:
        """Tell a listener what is being done; every iteration also states the best motion so far and the time left."""
        if isinstance(text, Iteration) and self.best is not None and self.is_satisfied:
            best = f"best so far: t_E = {self.best.t_end:.4f} s"
            text = Iteration(f"{best}, {self._deadline.left:.0f} s left; {text}")
        listener(text)

    def run(
        self,
        motion: Trajectory | None = None,
        exact: FinishedCandidate | None = None,
        max_batches: int | None = None,
    ) -> None:
        """Find guesses, rank them, refine and verify the best, batch by batch.

        Parameters
        ----------
        motion : Trajectory, optional
            A motion that is tried first. If it leads to a verified motion, nothing else is tried.
        exact : FinishedCandidate, optional
            A verified plan of the same task without tolerances. It is the result unless a faster plan is found. The
            search looks close to this plan first, and elsewhere only if it found nothing there or is exhaustive.
        max_batches : int, optional
            Maximum number of batches.

        Raises
        ------
        PathError
            The path is out of reach, or at some point of it no posture is allowed at rest.
        PlanningError
            A given speed, or a limit on the mean of a load, is far out of reach.
        """
        found = self._find_guesses(motion, exact)
        for batch in itertools.islice(found, max_batches):
            if self._deadline.left < LITTLE_TIME and not self._ranked:
                soon = self._deadline.part(_FIRST_SHARE)
                self._find_first_motion(batch.guesses, soon)
            self._rank(batch)
            self._refine_and_verify(batch)
        self.interrupted |= self._latest.passed  # solves may have been cut short
        if self.interrupted and self._reserve > 0.0:
            self._find_first_motion(self.guesses, self._deadline)

    def _find_first_motion(
        self, guesses: Sequence[InitialGuess], deadline: Deadline
    ) -> None:
        """Find a motion close to the joint path of a guess, unless a motion is known; none for a program."""
        if not (self._has_motion or self._problem.is_chain):
            self._reserve = -_LATER
            self._first_motion = find_first_motion_of(guesses, deadline, self._listener)

    def _find_guesses(
        self, motion: Trajectory | None, exact: FinishedCandidate | None
    ) -> Iterator[Batch]:
        """Yield batches of initial guesses while they are worth trying."""
        if motion is not None:
            yield from self._guess_from(motion, GIVEN)
        elif exact is not None:
            self.candidates.append(exact)
            self._keep(exact)
            yield from self._guess_from(exact.trajectory, EXACT)
        goes_on = motion is None and self._problem.task.search.effort == "exhaustive"
        if self.is_satisfied and self.best is not exact and not goes_on:
            return
        is_first_fallback = True
        for batch in find_batches(
            self._problem, self._decompositions, self._latest, self._listener
        ):
            for decomposition, dead_end in batch.lattices:
                self._add_lattice(decomposition, dead_end)
            if batch.fallback and self.is_satisfied:
                return
            if self._latest.passed:
                self.interrupted = True
                if not batch.fallback:
                    self._add_guesses(batch)
                return
            if batch.fallback and is_first_fallback:
                is_first_fallback = False
                self._refuse_what_is_out_of_reach()
            yield batch

    def _guess_from(self, motion: Trajectory, origin: str) -> Iterator[Batch]:
        """Yield the guess from a known motion, if it can be used; record why the given one led to no plan."""
        outcome = "it led to no verified plan"
        try:
            guess = given_guess(self._problem, self._decompositions, motion, origin)
            yield Batch([guess], 1, fallback=False)
        except UnreachableError as error:
            outcome = str(error)
        if origin == GIVEN:
            self._given_motion = outcome

    def _rank(self, batch: Batch) -> None:
        """Improve the joint paths of a batch, and rank them by their times."""
        first = self._add_guesses(batch)
        until = self._deadline
        if not self.is_satisfied:
            until = until.part(_RANKING_SHARE)
        work = run_in_processes(
            pipeline.rank_candidate,
            batch.guesses,
            until,
            jobs=self._problem.task.search.jobs,
            listener=self._listener,
        )
        with closing(work) as outcomes:
            for number, candidate in enumerate(outcomes, first):
                self.candidates[number] = candidate
                if candidate.status == NOT_TRIED:
                    self.interrupted = True
                if isinstance(candidate, RankedCandidate):
                    self._ranked[number] = candidate
        self._waiting = self._by_time(first)

    def _refine_and_verify(self, batch: Batch) -> None:
        """Refine and verify the candidates of a batch in the order of their ranks while they may be the fastest."""
        jobs = self._problem.task.search.jobs
        # With auto, candidates are finished one by one, because the next one may not be needed.
        jobs = 1 if jobs == "auto" else process_count(jobs)
        budget = batch.refined
        while self._waiting and self._goes_on(budget):
            numbers = self._waiting[:jobs]
            work = run_in_processes(
                pipeline.finish_candidate,
                [self._ranked[number] for number in numbers],
                self._to_beat,
                self._latest,
                jobs=jobs,
                listener=self._listener,
            )
            with closing(work) as outcomes:
                for number, outcome in zip(numbers, outcomes, strict=True):
                    if number != numbers[0] and not self._goes_on(budget):
                        return
                    budget -= 1
                    candidate = outcome
                    if self._to_beat.beat(outcome):
                        slow = fail(outcome, SLOW)
                        joints = self._ranked[number].redundant_joints
                        candidate = replace(slow, redundant_joints=joints)
                    self._finish(number, candidate)
                    self._listener(candidate.describe())

    @contextlib.contextmanager
    def end_early(self) -> Iterator[None]:
        """Let Ctrl-C, or the end of the time, end the search with the best motion so far.

        Raises
        ------
        KeyboardInterrupt
            Ctrl-C was pressed before any motion was verified; the text describes the best motion so far.
        """
        is_pressed = False
        try:
            yield
        except KeyboardInterrupt:
            interrupts.clear()
            is_pressed = self.interrupted = True
        first = self._first_motion
        self._first_motion = None
        if first is not None:
            self.candidates.append(first)
            if self.best is None or self._merit(first) < self._merit(self.best):
                self._keep(first)
        if self.interrupted:
            # One of the fastest three that did not fail becomes the unverified motion.
            hopeful = [
                number
                for number in self._by_time()
                if isinstance(self.candidates[number], RankedCandidate)
            ]
            for number in hopeful[:3]:
                if self.best is None:
                    ranked = self._ranked[number]
                    candidate = pipeline.finish_candidate(
                        ranked, Marks(), Deadline(0.0), ignore
                    )
                    self._finish(number, candidate)
        if is_pressed and not self.is_satisfied:
            raise KeyboardInterrupt(self._describe_best())

    def outcome(self) -> SearchOutcome:
        """Return the outcome of the search; raise the error that explains why no motion was found."""
        if self.best is None:
            raise self.explain()
        return SearchOutcome(
            self.best, self.in_order(), self.interrupted, self.list_unfinished_work()
        )

    def explain(self) -> BrachisError:
        """Return the error that tells why no motion was found."""
        guesses = [alone for guess in self.guesses for alone in guess.alone]
        failure = explain_holding(guesses) or explain_postures(guesses)
        if failure is None and not self.interrupted:
            failure = explain_speeds(guesses, are_tried=True)
        if failure is not None:
            return failure
        # The time limit of the search may have ended every solve before the solve's own time limit.
        tried = filter(None, (candidate.reports for candidate in self.candidates))
        last = [reports[-1] for reports in tried]
        self.interrupted |= bool(last) and all(
            report.status is SolveStatus.TIME_LIMIT
            and report.wall_time < self._problem.task.solver.time_limit
            for report in last
        )
        return explain_no_motion(
            self._problem,
            self._decompositions,
            self.candidates,
            self._dead_ends,
            self._deadline,
            self.list_unfinished_work() if self.interrupted else (),
        )

    def list_unfinished_work(self) -> tuple[str, ...]:
        """Say in plain words what was not completed."""
        notes = []
        best = self.best
        if best is not None and self._given_motion and best.origin != GIVEN:
            notes.append(
                f"the plan does not start from the given motion: {self._given_motion}; the usual search was made"
            )
        if best is not None and best.not_completed:
            notes.append(best.not_completed)
        if not self.interrupted:
            return tuple(notes)
        if self._unfinished_lattices:
            names = name_first(list(self._unfinished_lattices), " | ")
            notes.append(f"the lattice of {names} was not searched completely")
        untried = sum(candidate.status == NOT_TRIED for candidate in self.candidates)
        counts = {"tried": untried, "finished": len(self._waiting)}
        unfinished = [f"{n} remained un{what}" for what, n in counts.items() if n]
        if unfinished:
            total = write_count(len(self.candidates), "candidate")
            notes.append(f"of {total}, {', '.join(unfinished)}")
        return (*notes, "the search that search.effort requires was not completed")

    def in_order(self) -> tuple[Candidate, ...]:
        """Return all candidates, the fastest verified one first, without their programs."""

        def rank(candidate: Candidate) -> tuple[float, ...]:
            times = candidate.t_end, candidate.estimate
            return (not candidate.verified, *map(round_end_time, times))

        ordered = sorted(self.candidates, key=rank)
        return tuple(candidate.without_program() for candidate in ordered)

    @property
    def _latest(self) -> Deadline:
        """Deadline of the search: earlier while nothing is verified, and later if no first motion was found."""
        if self._has_motion:
            return self._deadline
        return self._deadline.extend(-self._reserve)

    @property
    def _has_motion(self) -> bool:
        """Whether a verified motion is known, the first one included."""
        return self.is_satisfied or self._first_motion is not None

    def _by_time(self, first: int = 0) -> list[int]:
        """Return the numbers of ranked candidates, from `first` on, by the times along their joint paths."""
        return sorted(
            (number for number in self._ranked if number >= first),
            key=lambda number: (round_end_time(self._ranked[number].estimate), number),
        )

    def _add_guesses(self, batch: Batch) -> int:
        """Add guesses as untried candidates; return the number of the first one."""
        first = len(self.candidates)
        self.guesses += batch.guesses
        self.candidates += [
            begin_candidate(guess, NOT_TRIED) for guess in batch.guesses
        ]
        return first

    def _add_lattice(
        self, decomposition: Decomposition | None, dead_end: DeadEnd
    ) -> None:
        """Record that a lattice has no joint path, or that there was no time for it."""
        name = ALL_POSTURES if decomposition is None else decomposition.name
        if dead_end.cause == NO_TIME:
            self._unfinished_lattices[name] = None
            self.interrupted = True
            return
        self._dead_ends[name] = dead_end
        joints = () if decomposition is None else decomposition.match.redundant_joints
        self.candidates.append(
            Candidate(
                redundant_joints=joints,
                branch="",
                origin="lattice",
                solver="",
                estimate=np.inf,
                status=str(dead_end),
            )
        )

    def _refuse_what_is_out_of_reach(self) -> None:
        """Refuse a path that is out of reach before fallbacks are tried."""
        failure = explain_first_failures(
            self._decompositions, self.candidates, self._deadline
        )
        if failure is not None:
            raise failure

    def _goes_on(self, budget: int) -> bool:
        """Tell whether the first of the waiting candidates is worth finishing."""
        first = self._ranked[self._waiting[0]]
        if not self._may_win(first) or (self.is_satisfied and budget <= 0):
            self._waiting = []
            return False
        if self._latest.passed:
            self.interrupted = True
            return False
        return True

    def _may_win(self, candidate: RankedCandidate) -> bool:
        """Tell whether a candidate may be faster than the best motion."""
        if self.best is None or not self.is_satisfied:
            return True
        is_fast = candidate.estimate * self._least_ratio < self._to_beat.adapted
        return is_fast and not self._is_known(candidate)

    def _keep(self, candidate: FinishedCandidate) -> None:
        """Make a candidate the best one; once it is verified, other candidates have to beat it over the same knots."""
        self.best = candidate
        if self.is_satisfied:
            is_patient = self._problem.task.search.effort == "exhaustive"
            usual = (1.0 - (0.0 if is_patient else _REFINED)) * candidate.t_end
            least = min(max(candidate.adapted, usual), candidate.t_end)
            least = min(self._to_beat.adapted, (1.0 - tolerances.GAIN) * least)
            begun = np.inf if is_patient else min(self._to_beat.begun, candidate.begun)
            self._to_beat = Marks(begun, least)

    def _is_known(self, candidate: RankedCandidate) -> bool:
        """Tell whether a motion along the same joint path, in the same coordinates, is already known."""
        return any(
            candidate.redundant_joints == finished.redundant_joints
            and candidate.branch == finished.branch
            and is_same(candidate.guess, finished.guess)
            for finished in self._finished
        )

    def _finish(self, number: int, candidate: Candidate) -> None:
        """Record the outcome of a candidate, and keep the best one."""
        if number in self._waiting:
            self._waiting.remove(number)
        self.candidates[number] = candidate
        if not isinstance(candidate, FinishedCandidate):
            return
        self._finished.append(self._ranked[number])
        if np.isfinite(candidate.estimate):
            ratio = min(candidate.adapted, candidate.t_end) / candidate.estimate
            least = min(1.0 + _LEAST_COST * (ratio - 1.0), ratio)
            self._least_ratio = min(self._least_ratio or least, least)
        if self.best is None or self._merit(candidate) < self._merit(self.best):
            self._keep(candidate)

    def _describe_best(self) -> str:
        """Say by how much the best motion exceeds the limits; empty if there is no motion."""
        if self.best is None:
            return ""
        over = 100.0 * max(self.best.verification.worst_ratio - 1.0, 0.0)
        return f"the best motion so far takes {self.best.t_end:.4f} s, and exceeds a limit by {over:.2g} % (unverified)"
