"""Problems whose motions follow one another without a gap: the parts of a program."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise

import numpy as np

from brachis.errors import BrachisError
from brachis.problem.problem import Join, Problem
from brachis.task import FREE, PATH_KEYS, BoundarySettings, Mark


@dataclass(frozen=True)
class Section:
    """A part of a program, as a section of the path of its problem.

    Attributes
    ----------
    name : str
    kind : str
        ``path``, ``move``, ``approach``, ``retract`` or ``dwell``.
    s_end : float
        Path coordinate at its end; that of the section before if it is a dwell.
    marks : tuple of Mark
        Its events.
    dwell : float
        Duration of a dwell, s.
    key : str
        Key of the part in the task; empty for a move without a given posture.
    segments : int
        Number of its segments of the path.
    renamed : tuple of tuple of str
        Keys of the task, such as ``robot.payload``, with the keys of the program that replace them.
    """

    name: str
    kind: str
    s_end: float
    marks: tuple[Mark, ...]
    dwell: float = 0.0
    key: str = ""
    segments: int = 0
    renamed: tuple[tuple[str, str], ...] = ()


def key_in_program(
    key: str,
    sections: Sequence[Section],
    before: Sequence[Section] = (),
    interval: tuple[float, float] | None = None,
) -> str:
    """Return a key of the problem of some parts of a program as one of the program, for messages.

    Parameters
    ----------
    key : str
    sections, before : sequence of Section
        The parts, and those of the problem before.
    interval : tuple of float, optional
        Interval of s in which something is wrong: the message names the part in its middle.
    """
    renamed = _rename(key, sections)
    if renamed != key:
        return renamed
    head = key.partition(".")[0]
    if head in ("start", "end"):
        ends = sections if head == "end" else before
        moves = [section.key for section in ends if section.kind == "move"]
        move = next(reversed(moves), "")
        return f"{move}.move{key.removeprefix(head)}" if move else key
    paths = [section for section in sections if section.kind == "path"]
    main = (*paths, *sections)[0]
    segment = re.match(r"path\[(\d+)\]", key)
    number = int(segment[1]) if segment else -1
    # A path is checked before its approach is added.
    for section in paths:
        if 0 <= number < section.segments:
            return f"{section.key}.path[{number}]{key.partition(']')[2]}"
        number -= section.segments
    if head == "postures":
        return key
    if head in PATH_KEYS and main.key and not interval:
        return f"{main.key}.{key}"
    if interval:
        middle = np.mean(interval)
        main = next(section for section in sections if section.s_end >= middle)
    return ": ".join(filter(None, ("program", main.name, key)))


def _rename(text: str, sections: Sequence[Section]) -> str:
    """Replace keys of the task in a text by those of the program."""
    for key, replacement in sections[0].renamed:
        text = re.sub(rf"(?<![\w.]){re.escape(key)}\b", replacement, text)
    return text


def name_keys(
    error: BrachisError,
    sections: Sequence[Section],
    before: Sequence[Section] = (),
    interval: tuple[float, float] | None = None,
) -> None:
    """Name the keys of the program in an error about some of its parts; see `key_in_program`."""
    error.where = key_in_program(error.where or "", sections, before, interval)
    if error.hint:
        error.hint = _rename(error.hint, sections)
    remedies = []
    for remedy in error.remedies:
        key = key_in_program(remedy.key, sections, before)
        remedies.append(replace(remedy, key=key.rpartition(": ")[2]))
    error.remedies = tuple(remedies)


@dataclass(frozen=True, repr=False)
class ProblemChain(Problem):
    """A problem whose motion consists of the motions of other problems.

    Its legs and time laws are those of all parts; the parts have limits of their own. The arm stops between the parts,
    unless it flies.

    Attributes
    ----------
    chained : tuple of Problem
        The parts.
    sections : tuple of tuple of Section
        The parts of the program on each problem, in their order.
    is_closed : bool
        Whether the last part ends in the posture in which the first one begins.
    """

    chained: tuple[Problem, ...] = field(kw_only=True)
    sections: tuple[tuple[Section, ...], ...] = field(kw_only=True)
    is_closed: bool = field(kw_only=True)

    @classmethod
    def of_parts(
        cls,
        whole: Problem,
        parts: Sequence[Problem],
        sections: Sequence[Sequence[Section]],
        *,
        is_closed: bool,
    ) -> ProblemChain:
        """Join parts to a chain.

        Parameters
        ----------
        whole : Problem
            The move from the start of the first part to the end of the last one, with the settings of the planner.
        parts : sequence of Problem
        sections : sequence of sequence of Section
        is_closed : bool
        """
        known = {item.name: getattr(whole, item.name) for item in fields(Problem)}
        names = tuple(map(tuple, sections))
        chain = cls(**known, chained=(), sections=names, is_closed=is_closed)
        return chain.with_parts(parts)

    @property
    def flights(self) -> list[list[int]]:
        """Numbers of the parts, divided where the arm stops; a single list if the last part flies into the first."""
        last = len(self.chained) - 1
        flights: list[list[int]] = [[]]
        for number in range(last + 1):
            flights[-1].append(number)
            if number < last and not (self.flies(number) or self.closes_in_motion):
                flights.append([])
        return flights

    def only(self, numbers: Sequence[int]) -> ProblemChain:
        """Return the chain of some of the parts, or of all in another order.

        In a free order, moves are named after the paths to which they lead.
        """
        sections = [self.sections[number] for number in numbers]
        for number, ((first, *_), (after, *_)) in enumerate(pairwise(sections)):
            if first.kind == "move" and self.task.order == "free":
                sections[number] = (replace(first, name=f"to {after.name}"),)
        chained = [self.chained[number] for number in numbers]
        return replace(self, sections=tuple(sections)).with_parts(chained)

    def with_parts(self, parts: Sequence[Problem]) -> ProblemChain:
        """Return the chain with other parts, such as variants, in place of its own."""
        return replace(
            self,
            chained=tuple(parts),
            legs=tuple(leg for part in parts for leg in part.legs),
            time_laws=tuple(law for part in parts for law in part.time_laws),
        )

    @property
    def is_chain(self) -> bool:
        """True: the motion consists of the motions of the parts."""
        return True

    @property
    def parts(self) -> tuple[Problem, ...]:
        """The problems whose motions follow one another."""
        return self.chained

    def key_of(self, number: int, key: str) -> str:
        """Return a key of a part as one of the program, for messages."""
        before = self.sections[number - 1] if number else ()
        return key_in_program(key, self.sections[number], before)

    def name_keys(self, number: int, error: BrachisError) -> None:
        """Name the keys of the program in an error about a part."""
        before = self.sections[number - 1] if number else ()
        interval = getattr(error, "s_interval", None)
        name_keys(error, self.sections[number], before, interval)

    def with_part(self, number: int, part: Problem) -> Problem:
        """Return the program with another part in place of the part with a number."""
        return self.with_parts(
            (*self.chained[:number], part, *self.chained[number + 1 :])
        )

    def piece(self, numbers: Sequence[int]) -> ProblemChain:
        """Return the chain of some successive parts, which does not close."""
        changes = {"start": "free", "end": "free", "boundary": BoundarySettings()}
        task = self.task.model_copy(update=changes)
        return replace(self.only(numbers), task=task, is_closed=False)

    @property
    def closes_in_motion(self) -> bool:
        """Whether the last part flies into the first one."""
        return self.task.boundary.end_speed == FREE

    def flies(self, number: int) -> bool:
        """Tell whether the arm passes from the part with a number to the next one without a stop."""
        return self.chained[number].task.boundary.end_speed == FREE

    @property
    def joins(self) -> list[Join]:
        """Each place where two parts meet in motion, or in a posture that is free."""
        last = len(self.chained) - 1
        pairs = list(pairwise(range(last + 1)))
        if self.is_closed or self.closes_in_motion:
            pairs.append((last, 0))
        joins = []
        for before, after in pairs:
            ends = self.chained[before].end, self.chained[after].start
            orders = [0] if any(posture is None for posture in ends) else []
            if self.flies(before):
                orders += range(1, 1 + self.flying_orders)
            if orders:
                joins.append((before, after, tuple(orders)))
        return joins
