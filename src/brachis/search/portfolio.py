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

import dataclasses
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from brachis.errors import PlanningError
from brachis.result import Attempt, Candidate
from brachis.search.course import DeadEnd
from brachis.search.explain import no_motion, refuse_what_is_out_of_reach
from brachis.search.finishing import Motion
from brachis.search.solving import Listener
from brachis.search.ways import Wave, waves
from brachis.search.work import NOT_TRIED, Coarse, each, finish, plan_coarse, processes
from brachis.setting import Choice

SAME_MOTION = "same motion as another"
"""Status of a plan that agrees with one that ranks before it."""
_WORTH_IT = 2e-4
"""A plan is finished if it may be faster than the best one by more than this fraction."""
_SAME_TIME = 1e-4
_SAME_MOTION = 0.1  # rad or m
_GAIN_SLACK = 0.005
"""By which other plans may gain more from better knots than those finished."""
_COARSE_SHARE = 0.6
"""Part of the time limit after which no coarse plan is begun while nothing is verified."""
_LEAST_SHARE, _LARGEST_SHARE = 2.0, 0.15
"""Seconds that every coarse plan may take, and part of the time limit that none may exceed."""
_GRACE = 1.0
"""Seconds to finish the best plan where the time is up and nothing is verified."""


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
    """

    attempts: tuple[Attempt, ...]
    chosen: int
    motion: Motion
    family: str
    candidates: tuple[Candidate, ...]
    interrupted: bool


def find_fastest(choices: Sequence[Choice], listener: Listener) -> Found:
    """Search for the fastest verified motion.

    Parameters
    ----------
    choices : sequence of Choice
        At least one, the most promising first.
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
        Ctrl-C before any motion was verified.
    """
    search = _Search(choices, listener)
    try:
        search.run(waves(choices, search.deadline, listener, search.note_dead_end))
    except KeyboardInterrupt:
        if not search.content:
            raise
        search.interrupted = True
    return search.found()


class _Search:
    """A search on its way."""

    def __init__(self, choices: Sequence[Choice], listener: Listener) -> None:
        self._choices, self._listener = choices, listener
        self._task = choices[0].setting.task
        self._jobs = processes(self._task.search.jobs)
        self.deadline = time.monotonic() + self._task.search.time_limit
        self._candidates: list[Candidate] = []
        self._attempts: list[Attempt] = []
        self._dead_ends: dict[str, DeadEnd] = {}
        self._best: tuple[tuple[float, float], int, Motion, str] | None = None
        self._known: list[Coarse] = []
        self._gain = 1.0
        self.interrupted = False

    @property
    def content(self) -> bool:
        """Whether a verified motion is known; without refinement any motion will do."""
        return self._best is not None and self._best[0][0] == -np.inf

    def note_dead_end(self, choice: Choice, dead_end: DeadEnd) -> None:
        """Put down that a choice has no course."""
        self._dead_ends[choice.name] = dead_end
        self._candidates.append(
            Candidate(choice.match.redundant_joints, "", "lattice", "", np.inf, np.inf, np.inf, status=str(dead_end))
        )

    def run(self, plan: Iterable[Wave]) -> None:
        """Try wave after wave."""
        refused = False
        for wave in plan:
            if wave.last_resort and self.content:
                self.interrupted |= time.monotonic() > self.deadline  # lattices were left out
                return
            if wave.last_resort and not refused:
                refuse_what_is_out_of_reach(self._choices, self._candidates)
                refused = True
            if time.monotonic() > self.deadline:
                self.interrupted = True
                return
            self._finish(self._plan(wave), wave.refined)

    def _plan(self, wave: Wave) -> list[tuple[int, Coarse]]:
        """Plan the ways of a wave coarsely, and rank those that differ."""
        now = time.monotonic()
        limit = self.deadline if self.content else now + _COARSE_SHARE * (self.deadline - now)
        share = self._task.search.time_limit * min(_LARGEST_SHARE, _COARSE_SHARE / max(1, len(wave.ways)))
        share = max(_LEAST_SHARE, share)
        plans: list[tuple[int, Coarse]] = []
        for plan in each(plan_coarse, wave.ways, limit, share, jobs=self._jobs, listener=self._listener):
            plans.append((len(self._candidates), plan))
            self._candidates.append(_candidate(plan))
            self.interrupted |= plan.status == NOT_TRIED
        usable = [item for item in plans if item[1].usable]
        # In the last resort a motion that could not be verified gets another chance, with another solver.
        known = [] if wave.last_resort else self._known
        ranked: list[tuple[int, Coarse]] = []
        for number, plan in sorted(usable, key=lambda item: (_rounded(item[1].t_end), item[0])):
            if any(_agree(plan, other) for other in known):
                self._note(number, status=SAME_MOTION)
            else:
                known.append(plan)
                ranked.append((number, plan))
        return ranked

    def _finish(self, ranked: Sequence[tuple[int, Coarse]], most: int) -> None:
        """Refine and verify plans in the order of their end times while they may be the fastest."""
        jobs, left = self._jobs, most
        for first in range(0, len(ranked), jobs):
            batch = ranked[first : first + jobs]
            if not self._may_win(batch[0][1], left):
                return
            deadline = self.deadline if self.content else self.deadline + _GRACE
            outcomes = each(finish, batch, deadline, jobs=jobs, listener=self._listener)
            for (number, plan), (attempt, motion) in zip(batch, outcomes, strict=True):
                if not self._may_win(plan, left):
                    return
                left -= 1
                self._record(number, plan, attempt, motion)

    def _may_win(self, plan: Coarse, left: int) -> bool:
        """Tell whether a plan is worth finishing."""
        if time.monotonic() > self.deadline + (0.0 if self.content else _GRACE):
            self.interrupted = True
            return False
        if self._best is None or not self.content:
            return True
        return left > 0 and plan.t_end * self._gain < (1.0 - _WORTH_IT) * self._best[0][1]

    def _record(self, number: int, plan: Coarse, attempt: Attempt, motion: Motion | None) -> None:
        """Put down what became of a plan, and keep the best one."""
        self._listener(attempt.outcome)
        self._attempts.append(attempt)
        t_end = np.inf if motion is None else motion[0].t_end
        passed = motion is not None and motion[1].passed
        self._note(number, status="verified" if passed else attempt.outcome, t_end=t_end, verified=passed)
        if motion is None:
            return
        if not plan.keeps_knots:
            self._gain = min(self._gain, (1.0 - _GAIN_SLACK) * t_end / plan.t_end)
        will_do = motion[1].passed or self._task.refinement.max_rounds == 0
        merit = (-np.inf if will_do else motion[1].worst_ratio - 1.0), t_end
        if self._best is None or merit < self._best[0]:
            self._best = merit, len(self._attempts) - 1, motion, plan.family

    def _note(self, number: int, **news: object) -> None:
        self._candidates[number] = dataclasses.replace(self._candidates[number], **news)  # type: ignore[arg-type]

    def found(self) -> Found:
        """Return the best motion, or say why there is none."""
        if self._best is None:
            if self.interrupted:
                limit = self._task.search.time_limit
                problem = f"no motion was found within the time limit of {limit:g} s"
                raise PlanningError(problem, hint="Raise search.time_limit")
            raise no_motion(self._choices, self._candidates, self._dead_ends)
        _, chosen, motion, family = self._best
        order = sorted(
            self._candidates, key=lambda c: (not c.verified, *map(_rounded, (c.t_end, c.coarse, c.estimate)))
        )
        return Found(tuple(self._attempts), chosen, motion, family, tuple(order), self.interrupted)


def _rounded(time: float) -> float:
    """Leave out the digits in which processes differ, so that these do not choose."""
    return float(f"{time:.6g}")


def _candidate(plan: Coarse) -> Candidate:
    """Put a coarse plan down."""
    seed = plan.way.seed
    branch = seed.choice.match.solver.branches[seed.branch]
    names = seed.choice.match.redundant_joints
    return Candidate(names, branch, seed.origin, plan.way.solver, seed.estimate, plan.t_end, np.inf, status=plan.status)


def _agree(first: Coarse, second: Coarse) -> bool:
    """Tell whether two plans of a choice are the same motion."""
    one, other = first.way.seed, second.way.seed
    same = (one.choice.redundant, one.branch) == (other.choice.redundant, other.branch)
    if not same or abs(first.t_end - second.t_end) > _SAME_TIME * second.t_end:
        return False
    postures = [plan.problem.state(plan.reports[-1].x).q for plan in (first, second) if plan.problem is not None]
    return bool(np.abs(postures[0] - postures[1]).max() < _SAME_MOTION)
