"""What the search has seen so far: candidates, attempts, the best motion, and what is left to do."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.result import Attempt, Candidate
from brachis.search.course import DeadEnd
from brachis.search.finishing import Motion
from brachis.search.work import NOT_TRIED, Coarse
from brachis.setting import Choice

SAME_MOTION = "same motion as another"
"""Status of a plan that agrees with one that ranks before it."""
_WORTH_IT = 2e-4
"""A plan is finished if it may be faster than the best one by more than this fraction."""
_SAME_TIME = 1e-4
_SAME_MOTION = 0.1  # rad or m
_GAIN_SLACK = 0.005
"""By which other plans may gain more from better knots than those finished."""

Numbered = tuple[int, Coarse]
"""Index of the candidate, and its plan."""


@dataclass(frozen=True)
class Best:
    """The best motion so far.

    Attributes
    ----------
    merit : tuple of float
        By which motions are compared: violation of a limit, -inf where it will do, and end time, s.
    attempt : int
        Index of the attempt that gave it.
    motion : Motion
    family : str
        Of its closed form.
    """

    merit: tuple[float, float]
    attempt: int
    motion: Motion
    family: str

    def __str__(self) -> str:
        """Say how far it is from a plan."""
        trajectory, verification = self.motion
        over = 100.0 * max(verification.worst_ratio - 1.0, 0.0)
        return (
            f"the best motion so far takes {trajectory.t_end:.4f} s, and exceeds a limit by {over:.2g} % (unverified)"
        )


class Book:
    """Record of a search.

    Parameters
    ----------
    refined : bool
        Whether motions are refined; if not, any motion will do.
    """

    def __init__(self, *, refined: bool) -> None:
        self._refined = refined
        self.candidates: list[Candidate] = []
        self.attempts: list[Attempt] = []
        self.dead_ends: dict[str, DeadEnd] = {}
        self.best: Best | None = None
        self.interrupted = False
        self.plans: list[Numbered] = []
        self._begun = 0
        self._waiting: list[Numbered] = []
        self._left_out: dict[str, None] = {}
        self._known: list[Coarse] = []
        self._gain = 1.0

    @property
    def content(self) -> bool:
        """Whether a verified motion is known; without refinement any motion will do."""
        return self.best is not None and self.best.merit[0] == -np.inf

    def note_choice(self, choice: Choice, dead_end: DeadEnd | None) -> None:
        """Put down that a choice has no course, or that there was no time to look for one."""
        if dead_end is None:
            self._left_out[choice.name] = None
            self.interrupted = True
            return
        self.dead_ends[choice.name] = dead_end
        names = choice.match.redundant_joints
        self.candidates.append(Candidate(names, "", "lattice", "", np.inf, np.inf, np.inf, status=str(dead_end)))

    def begin(self, ways: int) -> None:
        """Put down that so many ways are about to be planned."""
        self._begun += ways

    def add(self, plan: Coarse) -> None:
        """Put a coarse plan down."""
        if plan.status == NOT_TRIED:
            self.interrupted = True
        else:
            self._begun -= 1
        if plan.usable:
            self.plans.append((len(self.candidates), plan))
        self.candidates.append(_candidate(plan))

    def ranked(self, plans: Sequence[Numbered], *, again: bool) -> list[Numbered]:
        """Order plans by their end times, without those that are a motion known before; `again` lets these in."""
        known = [] if again else self._known
        self._waiting = []
        for number, plan in sorted(plans, key=lambda item: (rounded(item[1].t_end), item[0])):
            if any(_agree(plan, other) for other in known):
                self._note(number, status=SAME_MOTION)
            else:
                known.append(plan)
                self._waiting.append((number, plan))
        return list(self._waiting)

    def may_win(self, plan: Coarse) -> bool:
        """Tell whether a plan may be faster than the best motion."""
        return self.best is None or not self.content or plan.t_end * self._gain < (1.0 - _WORTH_IT) * self.best.merit[1]

    def drop(self, plans: Sequence[Numbered]) -> None:
        """Put down that plans need not be finished."""
        dropped = {number for number, _ in plans}
        self._waiting = [item for item in self._waiting if item[0] not in dropped]

    def record(self, number: int, plan: Coarse, attempt: Attempt, motion: Motion | None) -> None:
        """Put down what became of a plan, and keep the best one."""
        self.drop([(number, plan)])
        self.attempts.append(attempt)
        t_end = np.inf if motion is None else motion[0].t_end
        passed = motion is not None and motion[1].passed
        self._note(number, status="verified" if passed else attempt.outcome, t_end=t_end, verified=passed)
        if motion is None:
            return
        if not plan.keeps_knots:
            self._gain = min(self._gain, (1.0 - _GAIN_SLACK) * t_end / plan.t_end)
        will_do = motion[1].passed or not self._refined
        merit = (-np.inf if will_do else motion[1].worst_ratio - 1.0), t_end
        if self.best is None or merit < self.best.merit:
            self.best = Best(merit, len(self.attempts) - 1, motion, plan.family)

    def undone(self) -> tuple[str, ...]:
        """Say in plain words what was left undone."""
        chosen = "" if self.best is None else self.attempts[self.best.attempt].undone
        parts = [chosen] if chosen else []
        if not self.interrupted:
            return tuple(parts)
        if self._left_out:
            parts.append(f"the lattice of {' | '.join(self._left_out)} was not searched to its end")
        total, waiting = len(self.candidates), len(self._waiting)
        counts = [f"{self._begun} not planned"] * bool(self._begun) + [f"{waiting} not refined"] * bool(waiting)
        if counts:
            unseen = max(0, self._begun - sum(candidate.status == NOT_TRIED for candidate in self.candidates))
            parts.append(f"of {total + unseen} candidates {', '.join(counts)}")
        return (*parts, "what search.effort asks for was not tried to its end")

    def _note(self, number: int, **news: object) -> None:
        self.candidates[number] = dataclasses.replace(self.candidates[number], **news)  # type: ignore[arg-type]


def rounded(time: float) -> float:
    """Leave out the digits in which processes differ, so that these do not choose."""
    return float(f"{time:.6g}")


def _candidate(plan: Coarse) -> Candidate:
    """Describe a coarse plan."""
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
    states = [plan.program.states(plan.reports[-1].x) for plan in (first, second) if plan.program is not None]
    gaps = [np.abs(mine.q - its.q).max() for mine, its in zip(*states, strict=True)]
    return bool(max(gaps) < _SAME_MOTION)
