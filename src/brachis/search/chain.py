"""The search over a program: joint paths of all its paths, joined by moves, by dynamic programming.

The nodes are joint paths of each path. The price of a move between two of them is its least time in joint space, with
the limits of the postures at which it ends. The best chains are improved as a whole.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.errors import PathError, TaskError
from brachis.optimise.backends import solvers_for
from brachis.problem.chain import ProblemChain
from brachis.problem.problem import Decompositions, Problem
from brachis.search.guesses import SEARCH_LEVELS, SearchLevel, joint_paths_in_charts
from brachis.search.joint_path import DeadEnd
from brachis.search.lattice import step_lengths
from brachis.search.moves import guess_along
from brachis.search.schedule import Batch, batches, has_charts
from brachis.search.screening import screen
from brachis.search.stages import ChainGuess, InitialGuess

_SHARE = 0.4
"""Fraction of the remaining time in which the joint paths of all paths are sought."""
_SCREENED = 3
"""Number of chains that are improved for each one that is kept."""
_SAME = 1e-6
"""Difference of two postures below which they are the same, rad or m."""


@dataclass(frozen=True, eq=False)
class _Option:
    """A joint path of a path, or the posture at the end of a move.

    Attributes
    ----------
    ends : (2, n) ndarray
        Postures at both ends, without virtual joints.
    time : float
        Time along the joint path, s.
    guess : InitialGuess or None
        None for a posture.
    """

    ends: np.ndarray
    time: float = 0.0
    guess: InitialGuess | None = None


@dataclass(frozen=True, eq=False)
class _Chain:
    """Options for the first parts of a program, and the time of these parts, s."""

    options: tuple[_Option, ...] = ()
    time: float = 0.0


def chain_batches(
    problem: ProblemChain,
    decompositions: Decompositions,
    deadline: Deadline,
    listener: Listener,
) -> Iterator[Batch]:
    """Yield the guesses of a program; see `brachis.search.schedule.batches`.

    Raises
    ------
    PathError
        No joint path of one of the paths was found.
    TaskError
        Nothing determines the posture in which the program begins.
    """
    level = SEARCH_LEVELS[problem.task.search.effort][0]
    search = _ChainSearch(
        problem, decompositions, level, deadline.part(_SHARE), listener
    )
    chains = search.best_chains()[: _SCREENED * level.in_charts]
    guesses = [search.guess(chain) for chain in chains]
    first, *others = solvers_for(problem.task.solver.name)
    guesses = [replace(guess, solver=first.name) for guess in guesses]
    guesses = screen(guesses, level.in_charts, deadline, listener)
    yield Batch(guesses, level.refined, fallback=False)
    for solver in others:
        with_solver = [replace(guess, solver=solver.name) for guess in guesses]
        yield Batch(with_solver, level.refined)


@dataclass(frozen=True, eq=False)
class _ChainSearch:
    """A search over the parts of a program; see `chain_batches`."""

    problem: ProblemChain
    decompositions: Decompositions
    level: SearchLevel
    deadline: Deadline
    listener: Listener

    @cached_property
    def _joints(self) -> int:
        """Number of joints of the robot without virtual joints."""
        return self.problem.robot.n

    def best_chains(self) -> list[_Chain]:
        """Return chains of options for all parts, the fastest first."""
        parts = self.problem.parts
        start = self.problem.start
        if start is None and not parts[0].task_map.m:
            raise TaskError(
                "nothing determines the posture in which the program begins",
                where="start",
                found="free, before a move",
                allowed="a posture",
            )
        chains = [_Chain()]
        if start is not None:
            chains = [_Chain((_Option(np.array([start, start])),))]
        return self._extend(chains, 0)

    def _extend(self, chains: list[_Chain], number: int) -> list[_Chain]:
        """Continue chains with the parts from a number on."""
        parts = self.problem.parts
        if number == len(parts):
            return sorted(chains, key=lambda chain: chain.time)
        part = parts[number]
        if part.task_map.m:
            return self._extend(self._through(chains, part, number), number + 1)
        if part.end is not None:
            goal = _Option(np.array([part.end, part.end]))
            return self._extend(self._move(chains, part, [goal]), number + 1)
        after = parts[number + 1]
        options = self._options(after, number + 1, chains)
        moved = self._move(chains, part, options)
        return self._extend(moved, number + 2)

    def _through(
        self, chains: list[_Chain], part: Problem, number: int
    ) -> list[_Chain]:
        """Continue chains with a path that begins where they end."""
        longer = []
        for chain in chains:
            start = chain.options[-1].ends[-1] if chain.options else None
            begun = part if start is None else replace(part, start=start)
            for option in self._options(begun, number, [chain]):
                guess = option.guess and replace(option.guess, problem=part)
                option = replace(option, guess=guess)
                time = chain.time + option.time
                longer.append(_Chain((*chain.options, option), time))
        return longer

    def _move(
        self, chains: list[_Chain], part: Problem, options: Sequence[_Option]
    ) -> list[_Chain]:
        """Continue chains with a move to each option; keep the fastest chains to each."""
        begins = np.array([chain.options[-1].ends[-1] for chain in chains])
        longer = []
        for option in options:
            prices = price_moves(part, begins, option.ends[0])
            times = prices + [chain.time for chain in chains]
            for best in np.argsort(times, kind="stable")[: self.level.in_charts]:
                chain = chains[best]
                time = float(times[best]) + option.time
                longer.append(_Chain((*chain.options, option), time))
        return longer

    def _options(
        self, part: Problem, number: int, chains: Sequence[_Chain]
    ) -> list[_Option]:
        """Find joint paths of a path, close to the postures where chains end and to a given posture after it."""
        name = self.problem.sections[number][0].name
        self.listener(f"looking for joint paths of {name}")
        before = [chain.options[-1].ends[-1] for chain in chains if chain.options]
        after = None
        if number + 1 < len(self.problem.parts):
            after = self.problem.parts[number + 1].end
        beside = (
            np.unique(before, axis=0) if before else None,
            None if after is None else after[None],
        )
        guesses = self._guesses(replace(part, beside=beside))
        return [
            _Option(
                guess.postures_at(np.array([0.0, 1.0]))[:, : self._joints],
                guess.estimate,
                replace(guess, problem=replace(part, beside=(None, None))),
            )
            for guess in guesses
        ]

    def _guesses(self, part: Problem) -> list[InitialGuess]:
        """Find joint paths of a path."""
        own = Decompositions(part, self.decompositions.families)
        if has_charts(part, own):
            found = joint_paths_in_charts(part, own, self.level, self.deadline)
            if not isinstance(found, DeadEnd):
                return found
        for batch in batches(part, own, self.deadline, self.listener):
            if batch.guesses:
                return list(batch.guesses)
        raise PathError("no joint path was found", where="program")

    def guess(self, chain: _Chain) -> ChainGuess:
        """Return the guess of a chain, with straight joint lines as moves."""
        options = list(chain.options)
        here = options.pop(0).ends[-1] if self.problem.start is not None else None
        guesses = []
        for part in self.problem.parts:
            if part.task_map.m:
                option = options.pop(0)
                guess = option.guess
                assert guess is not None
            else:
                assert here is not None
                option = options[0]
                if option.guess is None:
                    options.pop(0)
                guess = guess_along(part, np.array([here, option.ends[0]]), "line")
            guesses.append(guess)
            here = option.ends[-1] if part.task_map.m else option.ends[0]
        return ChainGuess.of_parts(self.problem, guesses, chain.time)


def price_moves(part: Problem, begins: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Estimate the least times, (K,), s, of moves from postures, (K, n), to a posture, (n,).

    With limits on accelerations and torques at the average posture, a straight joint line takes 2 sqrt(A), and with
    limits on velocities B + A / B if it reaches them; see `step_lengths` for A and B.
    """
    middle = 0.5 * (begins + end)
    lengths = step_lengths(part.limits, middle, end - begins, np.arange(len(begins)))
    by_acceleration, by_velocity = lengths
    slow = np.sqrt(by_acceleration) < by_velocity
    fraction = np.divide(
        by_acceleration, by_velocity, where=slow, out=np.zeros_like(begins[:, 0])
    )
    return np.where(slow, by_velocity + fraction, 2.0 * np.sqrt(by_acceleration))
