"""The search over a program: joint paths of all its paths, joined by moves, by dynamic programming.

The nodes are joint paths of each path. The price of a move between two of them is its least time in joint space, with
the limits of the postures at which it ends. The best chains become guesses of the program.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from brachis import ik
from brachis.common import tolerances
from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.errors import BrachisError, PathError, TaskError
from brachis.optimise.backends import solvers_for
from brachis.problem.chain import ProblemChain
from brachis.problem.problem import Decomposition, Decompositions, Problem
from brachis.search.failure import explain_no_motion, explain_reach
from brachis.search.guesses import SEARCH_LEVELS, SearchLevel, joint_paths_in_charts
from brachis.search.joint_path import ALL_POSTURES, DeadEnd
from brachis.search.moves import move_guesses, price_moves
from brachis.search.schedule import Batch, batches, has_charts
from brachis.search.stages import ChainGuess, InitialGuess

_SHARE = 0.4
"""Fraction of the remaining time in which the joint paths of all paths are sought."""
_NODES = 96
"""Number of joint paths of all paths among which the best order is sought."""
_PASSES = 2
"""Maximum number of times that joint paths beside others are added. On the one of 15 sets of paths that made a third
pass, it took 3 s and gained nothing. With no pass, two of seven sets of five paths were 5 and 8 % above their best
order."""
_TRIED = 6
"""Number of chains after which none is passable."""
_FASTEST = 4
"""Number of the fastest chains so far to whose ends joint paths of the next path should be close."""
_AS_FAST = 1.1
"""Factor on the time of the best chain up to which other chains count as fast. Without it, a program of a UR10 took
1.60 s in place of 1.31 s."""
_MUCH_SLOWER = 1.5
"""Factor on the time of the best chain above which chains are not improved. A chain that was 1.3 times as slow became
as fast as the best, and one that was 1.7 times as slow stayed so."""
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
    """A joint path of a part of a program, or a posture at which a move may begin or end.

    Attributes
    ----------
    ends : (2, n) ndarray
        Postures at both ends, without virtual joints.
    number : int
        Number of the part; -1 for a posture.
    time : float
        Time along the joint path, s.
    guess : InitialGuess or None
        None for a move, whose joint path is sought later, and for a posture.
    """

    ends: np.ndarray
    number: int = -1
    time: float = 0.0
    guess: InitialGuess | None = None

    @classmethod
    def at(cls, posture: np.ndarray) -> _Option:
        """Return a posture, (n,), as an option."""
        return cls(np.array([posture, posture]))


@dataclass(frozen=True, eq=False)
class _Chain:
    """Options for the first parts of a program, one for each part, with the postures that are given between them.

    Attributes
    ----------
    options : tuple of _Option
    time : float
        Time of these parts, s.
    """

    options: tuple[_Option, ...] = ()
    time: float = 0.0

    @property
    def parts(self) -> list[_Option]:
        """The options of the parts, without postures."""
        return [option for option in self.options if option.number >= 0]

    def followed_by(self, *options: _Option) -> _Chain:
        """Return the chain with further options."""
        time = self.time
        for option in options:
            time += option.time
        return _Chain((*self.options, *options), time)


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
    prices: dict[tuple[_Option, _Option], float] = field(default_factory=dict)
    """Least times of moves from option to option, s."""

    def best_guesses(self) -> list[ChainGuess]:
        """Return guesses of the whole program, the fastest first."""
        start = self.problem.start
        begun = _Chain(() if start is None else (_Option.at(start),))
        is_free = self.problem.task.order == "free"
        visit = self._visit_in_any_order if is_free else self._visit_in_order
        chains = sorted(visit(begun), key=lambda chain: chain.time)
        return self._passable(chains)

    def _passable(self, chains: Sequence[_Chain]) -> list[ChainGuess]:
        """Return the guesses of the best distinct chains whose moves get round what is in their way."""
        paths = sum(bool(part.task_map.m) for part in self.problem.parts)
        count = max(1, self.level.in_charts * _PATHS // max(paths, _PATHS))
        guesses: list[ChainGuess] = []
        blocked: list[PathError] = []
        chosen: list[np.ndarray] = []
        for chain in chains:
            is_slow = chain.time > _MUCH_SLOWER * chains[0].time
            if len(guesses) == count or (guesses and is_slow):
                break
            if len(blocked) == _TRIED and not guesses:
                break
            ends = np.array([option.ends for option in chain.options])
            if any(np.abs(ends - other).max() < _APART for other in chosen):
                continue
            chosen.append(ends)
            try:
                guesses.append(self._guess_of(chain))
            except PathError as error:
                blocked.append(error)
        if not guesses:
            raise blocked[0]
        return guesses

    def _guess_of(self, chain: _Chain) -> ChainGuess:
        """Return the guess of a chain; raise PathError if no move gets round what is in its way."""
        problem = self.problem
        options = chain.parts
        if problem.task.order == "free":
            options = [
                option
                for option in options
                if option.guess
                or np.ptp(option.ends, axis=0).max() > tolerances.WRITTEN
            ]
            problem = problem.only([option.number for option in options])
        else:
            options.sort(key=lambda option: option.number)
        guesses: list[InitialGuess] = []
        level = replace(self.level, in_charts=1)
        for option, part in zip(options, problem.parts, strict=True):
            guess = option.guess
            if guess is None:
                start, end = option.ends
                move = replace(part, start=start, end=end)
                try:
                    guess = move_guesses(move, level, self.deadline, self.listener)[0]
                except PathError as error:
                    name = problem.sections[len(guesses)][0].name
                    error.where = f"program: {name}"
                    raise
            if not part.task_map.m:
                guess = replace(guess, problem=part)
            guesses.append(guess)
        problem = problem.with_parts([guess.problem for guess in guesses])
        return ChainGuess.of_parts(problem, guesses, chain.time)

    def _visit_in_order(self, begun: _Chain) -> list[_Chain]:
        """Return chains of all parts in their order."""
        parts = self.problem.parts
        first = 0
        if not begun.options:
            # A motion that closes may be searched from any path on.
            first = next(i for i, part in enumerate(parts) if part.task_map.m)
        chains = [begun]
        numbers = iter([*range(first, len(parts)), *range(first)])
        for number in numbers:
            if parts[number].task_map.m:
                chains = self._go_through(chains, number)
                continue
            path = None if parts[number].end is not None else next(numbers, None)
            if path is None:
                chains = self._move_to_posture(chains, number)
            else:
                chains = self._move(chains, number, self._options(path, chains))
        return chains

    def _ends_of(self, guess: InitialGuess) -> np.ndarray:
        """Return the postures at both ends of a guess, (2, n), without virtual joints."""
        return guess.postures_at(np.array([0.0, 1.0]))[:, : self.problem.robot.n]

    def _visit_in_any_order(self, begun: _Chain) -> list[_Chain]:
        """Return the fastest chains through all paths, exactly, by dynamic programming over sets of visited paths.

        M. Held and R. M. Karp, A dynamic programming approach to sequencing problems, Journal of the Society for
        Industrial and Applied Mathematics 10(1), 1962. Of each path one of several options is visited.
        """
        parts = self.problem.parts
        paths = [number for number, part in enumerate(parts) if part.task_map.m]
        options = self._options_of_all(paths, begun)
        chains = self._join_in_any_order(options, begun)
        order: list[int] = []
        # Joint paths close to those before them in the best order are added, until this order stays.
        for _ in range(_PASSES):
            best = min(chains, key=lambda chain: chain.time)
            last = order
            order = [option.number for option in best.parts if option.guess]
            if order == last or self.deadline.passed:
                break
            for option in self._fastest_in_order(order, begun):
                options[paths.index(option.number)].append(option)
            chains = self._join_in_any_order(options, begun)
        return chains

    def _fastest_in_order(self, numbers: Sequence[int], begun: _Chain) -> set[_Option]:
        """Return the joint paths of the fastest chains through paths in a given order."""
        chains = [begun]
        for number in numbers:
            options = self._options(number, chains)
            if begun.options or number != numbers[0]:
                chains = self._move(chains, number - 1, options)
            else:
                chains = [begun.followed_by(option) for option in options]
        chains = sorted(chains, key=lambda chain: chain.time)[:_KEPT]
        return {option for chain in chains for option in chain.parts if option.guess}

    def _join_in_any_order(
        self, options: Sequence[Sequence[_Option]], begun: _Chain
    ) -> list[_Chain]:
        """Return the fastest chains through one option of each path."""
        parts = self.problem.parts
        begins = [[begun.followed_by(option) for option in some] for some in options]
        if begun.options:
            roots = [{0: [begun]}]
        elif self.problem.is_closed:
            roots = [{1: [chain]} for chain in begins[0]]
        else:
            roots = [{1 << place: chains for place, chains in enumerate(begins)}]
        complete: list[_Chain] = []
        for visited_by in roots:
            for visited in range((1 << len(options)) - 1):
                chains = visited_by.pop(visited, [])
                for place, some in enumerate(options):
                    if chains and not visited >> place & 1:
                        number = len(chains[0].parts)
                        more = self._move(chains, number, some, 1)
                        visited_by.setdefault(visited | 1 << place, []).extend(more)
            chains = visited_by.popitem()[1]
            if not parts[-1].task_map.m:
                chains = self._move_to_posture(chains, len(parts) - 1)
            complete += chains
        return complete

    def _options_of_all(
        self, paths: Sequence[int], begun: _Chain
    ) -> list[list[_Option]]:
        """Return the best options for each of several paths, close to the start and to options of the paths before."""
        nearby = [begun] if begun.options else []
        options_of_all: list[list[_Option]] = []
        for number in paths:
            # A chain to the best option of each earlier path counts like the start.
            beside = [_Chain((some[0],)) for some in options_of_all]
            options = self._options(number, [*nearby, *beside])
            times = np.array([option.time for option in options])
            prices = self._price(number - 1, nearby, options).min(
                axis=0, initial=np.inf
            )
            prices = times + (prices if nearby else 0.0)
            # The best joint path of every variant comes first: which is best depends on the order.
            order = np.argsort(prices, kind="stable")
            guesses = [options[i].guess for i in order]
            variants = [id(guess and guess.problem) for guess in guesses]
            ranks = [
                variants[:place].count(variant)
                for place, variant in enumerate(variants)
            ]
            order = order[np.argsort(ranks, kind="stable")]
            chosen = order[: _NODES // len(paths)]
            options_of_all.append([options[i] for i in chosen])
            nearby = nearby or [
                begun.followed_by(option) for option in options_of_all[0]
            ]
        return options_of_all

    def _name_of(self, number: int) -> str:
        """Return the name of the path of a problem, whose approach comes before it."""
        sections = self.problem.sections[number]
        return next(section.name for section in sections if section.kind == "path")

    def _go_through(self, chains: list[_Chain], number: int) -> list[_Chain]:
        """Continue the best chains with a path that begins where they end."""
        longer = []
        for chain in sorted(chains, key=lambda chain: chain.time)[:_FASTEST]:
            start = None
            if chain.options:
                start = self._end_on_path(chain.options[-1], number)
            options = self._options(number, [chain], start)
            longer += [chain.followed_by(option) for option in options]
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
        self,
        chains: Sequence[_Chain],
        number: int,
        goals: Sequence[_Option],
        kept: int = _KEPT,
    ) -> list[_Chain]:
        """Continue chains with a move to each goal and with the goal; keep the fastest chains to each."""
        longer = []
        prices = self._price(number, chains, goals)
        times = prices + np.array([[chain.time] for chain in chains])
        order = np.argsort(times, axis=0, kind="stable")[:kept]
        for goal, best_chains, to_goal in zip(goals, order.T, prices.T, strict=True):
            for best in best_chains:
                chain = chains[best]
                ends = np.array([chain.options[-1].ends[-1], goal.ends[0]])
                move = _Option(ends, number, float(to_goal[best]))
                longer.append(chain.followed_by(move, goal))
        return longer

    def _move_to_posture(self, chains: Sequence[_Chain], number: int) -> list[_Chain]:
        """Continue chains with a move to the posture that the program gives, or else to where the motion began."""
        end = self.problem.parts[number].end
        if end is not None:
            return self._move(chains, number, [_Option.at(end)])
        closed = []
        for chain in chains:
            goal = _Option.at(chain.options[0].ends[0])
            closed += self._move([chain], number, [goal])
        return closed

    def _price(
        self, number: int, chains: Sequence[_Chain], goals: Sequence[_Option]
    ) -> np.ndarray:
        """Return the least times of moves, s, from the end of each chain to each goal.

        The time of a move between two options does not depend on its place in the program.
        """
        ends = [chain.options[-1] for chain in chains]
        pairs = list(itertools.product(ends, goals))
        unknown = [pair for pair in dict.fromkeys(pairs) if pair not in self.prices]
        if unknown:
            begins = np.array([begin.ends[-1] for begin, _ in unknown])
            stops = np.array([goal.ends[0] for _, goal in unknown])
            times = price_moves(self.problem.parts[number], begins, stops)
            self.prices.update(zip(unknown, times.tolist(), strict=True))
        prices = [self.prices[pair] for pair in pairs]
        return np.reshape(prices, (len(ends), len(goals)))

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
        fastest = sorted(chains, key=lambda chain: chain.time)[:_FASTEST]
        # A slow chain whose end happens to be close to a posture would count as much as the fastest one.
        before = [
            chain.options[-1].ends[-1]
            for chain in fastest
            if chain.options and chain.time <= _AS_FAST * fastest[0].time
        ]
        after = None
        if number + 1 < len(self.problem.parts):
            after = self.problem.parts[number + 1].end
        beside = (
            np.unique(before, axis=0) if before else None,
            None if after is None else after[None],
        )
        guesses: list[InitialGuess] = []
        errors: list[BrachisError] = []
        deadline = self.deadline.part(1.0 / len(self.problem.parts))
        for variant in (part, *part.variants):
            if guesses and deadline.passed:
                break
            first = variant.start if start is None else start
            changed = replace(variant, beside=beside, start=first)
            try:
                of_variant = self._guesses(changed)
            except BrachisError as error:
                self.problem.name_keys(number, error)
                errors.append(error)
                continue
            guesses += [replace(guess, problem=variant) for guess in of_variant]
        if not guesses:
            raise errors[0]
        return [
            _Option(
                self._ends_of(guess),
                number,
                guess.estimate,
                guess,
            )
            for guess in guesses
        ]

    def _guesses(self, part: Problem) -> list[InitialGuess]:
        """Find joint paths of a path."""
        own = Decompositions(part, self.families)
        dead_ends: dict[str, DeadEnd] = {}
        if has_charts(part, own):
            guesses = joint_paths_in_charts(part, own, self.level, self.deadline)
            if not isinstance(guesses, DeadEnd):
                return guesses
            dead_ends[ALL_POSTURES] = guesses
        reason = None
        for batch in batches(part, own, self.deadline, self.listener):
            if batch.guesses:
                return list(batch.guesses)
            for decomposition, dead_end in batch.lattices:
                name = ALL_POSTURES if decomposition is None else decomposition.name
                dead_ends[name] = dead_end
            if batch.fallback and dead_ends and own and reason is None:
                reason = explain_reach(own[0], self.deadline)
                if isinstance(reason, PathError):
                    raise reason
        raise explain_no_motion(part, own, (), dead_ends, self.deadline)
