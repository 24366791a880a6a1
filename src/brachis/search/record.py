"""What the search has seen so far: candidates, the best motion, and what is left to do.

What the search looked at, as a table.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from brachis.errors import UnreachableError, write_count
from brachis.optimise.backends import SolveStatus
from brachis.optimise.candidate import Candidate, coordinates
from brachis.problem.problem import Decomposition
from brachis.search.joint_path import ALL_POSTURES, DeadEnd
from brachis.search.too_fast import TooFast

NOT_TRIED = "not tried: the time was up"
"""Status of a candidate for which there was no time."""
SAME_MOTION = "same motion as another"
"""Status of a candidate that agrees with one that ranks before it."""
_WORTH_IT = 2e-4
"""A candidate is finished if it may be faster than the best one by more than this fraction."""
_SAME_TIME = 1e-4
_SAME_TIME_IN_CHARTS = 3e-3
"""Splines of different measures of self-motion come to end times that differ by so much for the same motion."""
_SAME_MOTION = 0.1  # rad or m
_GAIN_SLACK = 0.005
"""Better knots shorten a motion when it is finished; a candidate may gain this part more by them than any one so far."""

Numbered = tuple[int, Candidate]
"""Index among the candidates, and the candidate as it was when it was solved."""


class Record:
    """Record of a search.

    Parameters
    ----------
    refined : bool
        Whether motions are refined; if not, any motion will do.
    """

    def __init__(self, *, refined: bool) -> None:
        self._refined = refined
        self.candidates: list[Candidate] = []
        self.dead_ends: dict[str, DeadEnd] = {}
        self.best: Candidate | None = None
        self.interrupted = False
        self.too_fast: TooFast | None = None
        self.solved: list[Numbered] = []
        self._unsolved = 0
        self._waiting: list[Numbered] = []
        self._left_out: dict[str, None] = {}
        self._known: list[Candidate] = []
        self._gain = 1.0

    @property
    def content(self) -> bool:
        """Whether a verified motion is known; without refinement any motion will do."""
        return self.best is not None and self._merit(self.best)[0] == -np.inf

    def _merit(self, candidate: Candidate) -> tuple[float, float]:
        """By what finished candidates are compared: violation of a limit, -inf where it will do, and end time, s."""
        assert candidate.verification is not None
        will_do = candidate.verified or not self._refined
        return (
            -np.inf if will_do else candidate.verification.worst_ratio - 1.0
        ), candidate.t_end

    def report_dead_end(
        self, decomposition: Decomposition | None, dead_end: DeadEnd | None
    ) -> None:
        """Put down that a lattice has no joint path, or that there was no time for it; None: that of all postures."""
        name = ALL_POSTURES if decomposition is None else decomposition.name
        if dead_end is None:
            self._left_out[name] = None
            self.interrupted = True
            return
        self.dead_ends[name] = dead_end
        names = () if decomposition is None else decomposition.match.redundant_joints
        self.candidates.append(
            Candidate(names, "", "lattice", "", np.inf, str(dead_end))
        )

    def begin(self, starts: int) -> None:
        """Put down that so many starts are about to be solved."""
        self._unsolved += starts

    def add(self, candidate: Candidate) -> None:
        """Put a solved candidate down."""
        if candidate.status == NOT_TRIED:
            self.interrupted = True
        else:
            self._unsolved -= 1
        if candidate.usable:
            self.solved.append((len(self.candidates), candidate))
        self.candidates.append(candidate)

    def ranked(self, solved: Sequence[Numbered], *, again: bool) -> list[Numbered]:
        """Order candidates by their end times, without those that are a motion known before; `again` lets these in."""
        known = [] if again else self._known
        self._waiting = []
        for number, candidate in sorted(
            solved, key=lambda item: (round_end_time(item[1].coarse), item[0])
        ):
            if any(_agree(candidate, other) for other in known):
                self.candidates[number] = dataclasses.replace(
                    candidate, status=SAME_MOTION
                )
            else:
                known.append(candidate)
                self._waiting.append((number, candidate))
        return list(self._waiting)

    def may_win(self, candidate: Candidate) -> bool:
        """Tell whether a candidate may be faster than the best motion."""
        if self.best is None or not self.content:
            return True
        if (
            candidate.keeps_knots
            and self.best.keeps_knots
            and candidate.in_chart
            and self.best.in_chart
        ):
            return (
                candidate.coarse < (1.0 - _WORTH_IT) * self.best.coarse
            )  # what else they gain, both gain
        return candidate.coarse * self._gain < (1.0 - _WORTH_IT) * self.best.t_end

    def drop(self, solved: Sequence[Numbered]) -> None:
        """Put down that candidates need not be finished."""
        dropped = {number for number, _ in solved}
        self._waiting = [item for item in self._waiting if item[0] not in dropped]

    def finish(self, number: int, candidate: Candidate) -> None:
        """Put down what became of a candidate, and keep the best one."""
        self.drop([(number, candidate)])
        self.candidates[number] = candidate
        if candidate.trajectory is None:
            return
        if not candidate.keeps_knots:
            self._gain = min(
                self._gain, (1.0 - _GAIN_SLACK) * candidate.t_end / candidate.coarse
            )
        if self.best is None or self._merit(candidate) < self._merit(self.best):
            self.best = candidate

    def cut_short(self, time_limit: float) -> bool:
        """Tell whether the time for the search ended every solve, of which each may take so long by itself, s."""
        last = [
            candidate.reports[-1] for candidate in self.candidates if candidate.reports
        ]
        cut = [
            each.status is SolveStatus.TIME_LIMIT and each.wall_time < time_limit
            for each in last
        ]
        return bool(cut) and all(cut)

    def best_in_words(self) -> str:
        """Say how far the best motion is from a plan; empty where there is none."""
        if self.best is None or self.best.verification is None:
            return ""
        over = 100.0 * max(self.best.verification.worst_ratio - 1.0, 0.0)
        return f"the best motion so far takes {self.best.t_end:.4f} s, and exceeds a limit by {over:.2g} % (unverified)"

    def not_completed(self) -> tuple[str, ...]:
        """Say in plain words what was left undone."""
        parts = (
            [self.best.not_completed]
            if self.best is not None and self.best.not_completed
            else []
        )
        if not self.interrupted:
            return tuple(parts)
        if self._left_out:
            parts.append(
                f"the lattice of {' | '.join(self._left_out)} was not searched to its end"
            )
        total = len(self.candidates)
        waiting = len(self._waiting)
        counts = [f"{self._unsolved} not planned"] * bool(self._unsolved) + [
            f"{waiting} not refined"
        ] * bool(waiting)
        if counts:
            unseen = max(
                0,
                self._unsolved
                - sum(candidate.status == NOT_TRIED for candidate in self.candidates),
            )
            parts.append(
                f"of {write_count(total + unseen, 'candidate')} {', '.join(counts)}"
            )
        return (*parts, "what search.effort asks for was not tried to its end")

    def in_order(self) -> tuple[Candidate, ...]:
        """All candidates, the fastest verified one first, without their programs."""

        def rank(candidate: Candidate) -> tuple[float, ...]:
            return (
                not candidate.verified,
                *map(
                    round_end_time,
                    (candidate.t_end, candidate.coarse, candidate.estimate),
                ),
            )

        return tuple(
            candidate.without_programs()
            for candidate in sorted(self.candidates, key=rank)
        )


def round_end_time(time: float) -> float:
    """Leave out the digits in which processes differ, so that these do not choose."""
    return float(f"{time:.6g}")


def _agree(first: Candidate, second: Candidate) -> bool:
    """Tell whether a candidate is the same motion as another, and not faster."""
    same = (first.redundant_joints, first.branch) == (
        second.redundant_joints,
        second.branch,
    )
    slower = (_SAME_TIME_IN_CHARTS if first.in_chart else _SAME_TIME) * second.coarse
    if (
        not same
        or not -_WORTH_IT * second.coarse <= first.coarse - second.coarse <= slower
    ):
        return False
    postures = []
    for candidate in (first, second):
        if candidate.program is not None:
            try:
                (state,) = candidate.program.states(candidate.reports[-1].x)
            except UnreachableError:
                return False
            postures.append(state.q)
    return bool(np.abs(postures[0] - postures[1]).max() < _SAME_MOTION)


WORDS = ("joints", "branch", "origin")
TIMES = ("coarse [s]", "t_end [s]")
STATUS = "status"
"""The columns; named as in the JSON."""


def candidate_rows(candidates: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Return a row of text for each candidate, as `Candidate.to_dict` gives it; the same motion is listed once."""
    return [
        (
            coordinates(
                candidate.get("redundant_joints", ()), str(candidate.get("branch", ""))
            ),
            *(str(candidate.get(key, "")) for key in ("branch", "origin")),
            *(_seconds(candidate.get(key)) for key in ("coarse", "t_end")),
            str(candidate.get("status", "")),
        )
        for candidate in candidates
        if candidate.get("status") != SAME_MOTION
    ]


def _seconds(value: object) -> str:
    return (
        f"{value:.4f}"
        if isinstance(value, int | float) and math.isfinite(value)
        else ""
    )
