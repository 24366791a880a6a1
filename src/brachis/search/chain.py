"""The search over a program: joint paths of all its paths, joined by moves, by dynamic programming.

The nodes are joint paths of each path. The price of a move between two of them is its least time in joint space, with
the limits of the postures at which it ends. The best chains are improved as a whole.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from brachis import ik
from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.errors import PathError, TaskError
from brachis.optimise.backends import solvers_for
from brachis.problem.chain import ProblemChain
from brachis.problem.problem import Decomposition, Decompositions, Problem
from brachis.search.guesses import SEARCH_LEVELS, SearchLevel, joint_paths_in_charts
from brachis.search.joint_path import DeadEnd
from brachis.search.lattice import step_lengths
from brachis.search.moves import move_guesses
from brachis.search.order import find_orders
from brachis.search.schedule import Batch, batches, has_charts
from brachis.search.stages import ChainGuess, InitialGuess

_SHARE = 0.4
"""Fraction of the remaining time in which the joint paths of all paths are sought."""
_NODES = 96
"""Number of joint paths of all paths among which the best order is sought."""
_TRIED = 6
"""Number of chains after which none is passable."""
_BESIDE = 4
"""Number of the best chains so far to whose ends joint paths of the next path should be close."""
_AS_FAST = 1.1
"""Factor on the time of the best chain up to which other chains count as fast. Without it, a program of a UR10 took
1.60 s in place of 1.31 s."""
_KEPT = 24
"""Number of chains that are kept at each joint path."""
_PATHS = 3
"""Number of paths up to which as many chains are improved as joint paths of a single path."""
_APART = 0.5
"""Distance between the ends of two joint paths, rad or m, below which chains count as the same. On nine programs of
three paths, the best chain of four such that are apart took half the processor time of the best of twelve, and was at
most 0.1 % slower."""


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

    @property
    def variant(self) -> Problem | None:
        """The problem of the joint path."""
        return None if self.guess is None else self.guess.problem


@dataclass(frozen=True, eq=False)
class _Chain:
    """Options for the first parts of a program, and the time of these parts, s."""

    options: tuple[_Option, ...] = ()
    time: float = 0.0


def find_batches(
    problem: Problem,
    decompositions: Sequence[Decomposition],
    deadline: Deadline,
    listener: Listener,
) -> Iterator[Batch]:
    """Yield the guesses of a task or of a program; see `brachis.search.schedule.batches`.

    Raises
    ------
    PathError
        No joint path of one of the paths was found.
    TaskError
        Nothing determines the posture in which the program begins.
    """
    if not isinstance(problem, ProblemChain):
        yield from batches(problem, decompositions, deadline, listener)
        return
    level = SEARCH_LEVELS[problem.task.search.effort][0]
    families = getattr(decompositions, "families", ())
    search = _ChainSearch(problem, families, level, deadline.part(_SHARE), listener)
    solvers = solvers_for(problem.task.solver.name)
    guesses = search.best_guesses()
    for solver in solvers:
        with_solver = [replace(guess, solver=solver.name) for guess in guesses]
        yield Batch(with_solver, level.refined, fallback=solver is not solvers[0])


@dataclass(frozen=True, eq=False)
class _ChainSearch:
    """A search over the parts of a program; see `find_batches`."""

    problem: ProblemChain
    families: Sequence[ik.Family]
    level: SearchLevel
    deadline: Deadline
    listener: Listener

    @property
    def _level_of_moves(self) -> SearchLevel:
        """Level at which joint paths of moves round obstacles are sought."""
        return replace(self.level, in_charts=1)

    def best_guesses(self) -> list[ChainGuess]:
        """Return guesses of the whole program, the fastest first."""
        if self.problem.task.order == "free":
            return self._guesses_in_any_order()
        parts = self.problem.parts
        start = self.problem.start
        first = 0
        if start is not None:
            chains = [_Chain((_Option(np.array([start, start])),))]
        elif self.problem.is_closed or parts[0].task_map.m:
            # A motion that closes may be searched from any path on.
            first = next(i for i, part in enumerate(parts) if part.task_map.m)
            chains = [_Chain()]
        else:
            raise TaskError(
                "nothing determines the posture in which the program begins",
                where="start",
                found="free, before a move",
                allowed="a posture; or end: start, for a motion that closes",
            )
        order = [*range(first, len(parts)), *range(first)]
        chains = self._extend(chains, order)
        chains = sorted(chains, key=lambda chain: chain.time)
        return self._passable(partial(self.guess_of, order=order), chains)

    def _passable(
        self, guess_of: Callable[[_Chain], ChainGuess], chains: Sequence[_Chain]
    ) -> list[ChainGuess]:
        """Return the guesses of the best distinct chains whose moves get round what is in their way."""
        paths = sum(bool(part.task_map.m) for part in self.problem.parts)
        count = max(1, self.level.in_charts * _PATHS // max(paths, _PATHS))
        found: list[ChainGuess] = []
        blocked: list[PathError] = []
        chosen: list[np.ndarray] = []
        for chain in chains:
            if len(found) == count or (len(blocked) == _TRIED and not found):
                break
            ends = np.array([option.ends for option in chain.options])
            if any(np.abs(ends - other).max() < _APART for other in chosen):
                continue
            chosen.append(ends)
            try:
                found.append(guess_of(chain))
            except PathError as error:
                blocked.append(error)
        if not found:
            raise blocked[0]
        return found

    def _guesses_in_any_order(self) -> list[ChainGuess]:
        """Return guesses of the whole program in the best orders of its paths, the fastest first."""
        problem = self.problem
        parts = problem.parts
        paths = [number for number, part in enumerate(parts) if part.task_map.m]
        move = next(part for part in parts if not part.task_map.m)
        nodes: list[tuple[int, _Option]] = []
        beside = []
        if problem.start is not None:
            beside.append(_Chain((_Option(np.array([problem.start] * 2)),)))
        for number in paths:
            options = self._options(number, beside)
            prices = [option.time for option in options]
            if beside:
                ends = np.array([option.ends[0] for option in options])
                home = [
                    price_moves(move, ends, chain.options[-1].ends[-1])
                    for chain in beside
                ]
                prices = np.min(home, axis=0) + prices
            # The best joint path of every variant comes first: which is best depends on the order.
            ranked: list[tuple[int, int, int]] = []
            variants: Counter[int] = Counter()
            for place, i in enumerate(np.argsort(prices, kind="stable").tolist()):
                variant = id(options[i].variant)
                ranked.append((variants[variant], place, i))
                variants[variant] += 1
            ranked.sort()
            chosen = [options[i] for *_, i in ranked[: _NODES // len(paths)]]
            nodes += [(number, option) for option in chosen]
            beside = beside or [_Chain((option,)) for option in chosen]
        groups = np.array([paths.index(number) for number, _ in nodes])
        times = np.array([option.time for _, option in nodes])
        begins = np.array([option.ends[0] for _, option in nodes])
        ends = np.array([option.ends[1] for _, option in nodes])
        prices = (
            np.array([price_moves(move, ends, begin) for begin in begins]).T + times
        )
        zeros = np.zeros(len(nodes))
        if problem.is_closed:
            found = []
            for root in np.flatnonzero(groups == 0):
                first = np.where(np.arange(len(nodes)) == root, times, np.inf)
                back = price_moves(move, ends, begins[root])
                found += find_orders(prices, first, back, groups, _KEPT)
        else:
            start, end = problem.start, problem.end
            first = times + (
                zeros if start is None else price_moves(move, begins, start)
            )
            last = zeros if end is None else price_moves(move, ends, end)
            found = find_orders(prices, first, last, groups, _KEPT)
        found.sort(key=lambda way: way[0])
        chains = [
            _Chain(tuple(nodes[node][1] for node in way), time) for time, way in found
        ]
        orders = {
            id(chain): [nodes[node][0] for node in way]
            for chain, (_, way) in zip(chains, found, strict=True)
        }
        return self._passable(
            lambda chain: self._guess_in_order(chain, orders[id(chain)]), chains
        )

    def _guess_in_order(self, chain: _Chain, visited: Sequence[int]) -> ChainGuess:
        """Return the guess of the program with its paths, given by their numbers, in an order."""
        problem = self.problem
        paths = iter(visited)
        order = [
            next(paths) if part.task_map.m else number
            for number, part in enumerate(problem.parts)
        ]
        options = list(chain.options)
        if problem.start is not None:
            options.insert(0, _Option(np.array([problem.start] * 2)))
        if problem.end is not None:
            options.append(_Option(np.array([problem.end] * 2)))
        elif problem.is_closed:
            options.append(_Option(options[0].ends[[0, 0]]))
        search = replace(self, problem=problem.only(order))
        return search.guess_of(_Chain(tuple(options), chain.time), range(len(order)))

    def _extend(self, chains: list[_Chain], order: Sequence[int]) -> list[_Chain]:
        """Continue chains with parts, given by their numbers."""
        if not order:
            return chains
        number, *others = order
        part = self.problem.parts[number]
        if part.task_map.m:
            return self._extend(self._through(chains, number), others)
        if part.end is not None:
            goal = _Option(np.array([part.end, part.end]))
            return self._extend(self._move(chains, part, [goal]), others)
        if others:
            options = self._options(others[0], chains)
            return self._extend(self._move(chains, part, options), others[1:])
        # The last move leads to where the motion began.
        closed = []
        for chain in chains:
            goal = _Option(chain.options[0].ends[[0, 0]])
            closed += self._move([chain], part, [goal])
        return closed

    def _name_of(self, number: int) -> str:
        """Return the name of the path of a problem, whose approach comes before it."""
        sections = self.problem.sections[number]
        return next(section.name for section in sections if section.kind == "path")

    def _through(self, chains: list[_Chain], number: int) -> list[_Chain]:
        """Continue the best chains with a path that begins where they end."""
        longer = []
        for chain in sorted(chains, key=lambda chain: chain.time)[:_BESIDE]:
            start = None
            if chain.options:
                start = self._end_on_path(chain.options[-1], number)
            for option in self._options(number, [chain], start):
                time = chain.time + option.time
                longer.append(_Chain((*chain.options, option), time))
        return longer

    def _end_on_path(self, option: _Option, number: int) -> np.ndarray:
        """Return the posture at the end of an option with the virtual joints of the path that follows."""
        robot = self.problem.parts[number].robot
        if option.guess is None:
            return robot.posture(option.ends[-1].tolist(), "program")
        (posture,) = option.guess.postures_at(np.ones(1))
        if len(posture) != robot.n:
            name = self._name_of(number)
            raise TaskError(
                "two paths with different tolerances or task spaces meet",
                where=f"program: {name}",
                allowed="a move between them",
            )
        return posture

    def _move(
        self, chains: list[_Chain], part: Problem, options: Sequence[_Option]
    ) -> list[_Chain]:
        """Continue chains with a move to each option; keep the fastest chains to each."""
        begins = np.array([chain.options[-1].ends[-1] for chain in chains])
        longer = []
        for option in options:
            prices = price_moves(part, begins, option.ends[0])
            times = prices + [chain.time for chain in chains]
            for best in np.argsort(times, kind="stable")[:_KEPT]:
                chain = chains[best]
                time = float(times[best]) + option.time
                longer.append(_Chain((*chain.options, option), time))
        return longer

    def _options(
        self,
        number: int,
        chains: Sequence[_Chain],
        start: np.ndarray | None = None,
    ) -> list[_Option]:
        """Find joint paths of a path, close to the postures where chains end and to a given posture after it.

        With a start posture, all begin there.
        """
        part = self.problem.parts[number]
        name = self._name_of(number)
        self.listener(f"looking for joint paths of {name}")
        best = sorted(chains, key=lambda chain: chain.time)[:_BESIDE]
        # A slow chain whose end happens to be close to a posture would count as much as the fastest one.
        longest = _AS_FAST * best[0].time if best else 0.0
        before = [
            chain.options[-1].ends[-1]
            for chain in best
            if chain.options and chain.time <= longest
        ]
        after = None
        if number + 1 < len(self.problem.parts):
            after = self.problem.parts[number + 1].end
        beside = (
            np.unique(before, axis=0) if before else None,
            None if after is None else after[None],
        )
        guesses: list[InitialGuess] = []
        errors: list[PathError] = []
        deadline = self.deadline.part(1.0 / len(self.problem.parts))
        for variant in (part, *part.variants):
            if guesses and deadline.passed:
                break
            first = variant.start if start is None else start
            changed = replace(variant, beside=beside, start=first)
            try:
                of_variant = self._guesses(changed, name)
            except PathError as error:
                errors.append(error)
                continue
            guesses += [replace(guess, problem=variant) for guess in of_variant]
        if not guesses:
            raise errors[0]
        return [
            _Option(
                guess.postures_at(np.array([0.0, 1.0]))[:, : self.problem.robot.n],
                guess.estimate,
                guess,
            )
            for guess in guesses
        ]

    def _guesses(self, part: Problem, name: str) -> list[InitialGuess]:
        """Find joint paths of a path."""
        own = Decompositions(part, self.families)
        dead_ends: list[DeadEnd] = []
        if has_charts(part, own):
            found = joint_paths_in_charts(part, own, self.level, self.deadline)
            if not isinstance(found, DeadEnd):
                return found
            dead_ends.append(found)
        for batch in batches(part, own, self.deadline, self.listener):
            if batch.guesses:
                return list(batch.guesses)
            dead_ends += [dead_end for _, dead_end in batch.lattices]
        why = f": {dead_ends[0]}" if dead_ends else ""
        raise PathError(
            f"no joint path of {name} was found{why}",
            s_interval=dead_ends[0].interval if dead_ends else None,
            where="program",
        )

    def guess_of(self, chain: _Chain, order: Sequence[int]) -> ChainGuess:
        """Return the guess of a chain; raise PathError if no move gets round what is in its way."""
        options = list(chain.options)
        guesses: dict[int, InitialGuess] = {}
        here = None if self.problem.start is None else options.pop(0).ends[-1]
        for number in order:
            part = self.problem.parts[number]
            option = options[0]
            if part.task_map.m:
                assert option.guess is not None
                guesses[number] = option.guess
            else:
                assert here is not None
                move = replace(part, start=here, end=option.ends[0])
                known = (self._level_of_moves, self.deadline, self.listener)
                guess = move_guesses(move, *known)[0]
                guesses[number] = replace(guess, problem=part)
            if part.task_map.m or option.guess is None:
                options.pop(0)
            here = option.ends[-1] if part.task_map.m else option.ends[0]
        in_order = [guesses[number] for number in sorted(guesses)]
        problem = self.problem.with_parts([guess.problem for guess in in_order])
        return ChainGuess.of_parts(problem, in_order, chain.time)


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
