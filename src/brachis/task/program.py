"""The parts of a program, as the task file writes them.

A program is a list of mappings such as ``- path: [...]`` and ``- move: home``. The parts follow one another without a
gap; the arm stops between them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from brachis.common.words import write_count
from brachis.task.fields import (
    ByForm,
    ByKey,
    Flag,
    Mistake,
    Model,
    Name,
    NonEmpty,
    Number,
    Positive,
)
from brachis.task.limit_models import LimitSpec, ToolLimits
from brachis.task.messages import validate
from brachis.task.paths import (
    PathBegin,
    PathStart,
    Posture,
    RedundantJoints,
    StatedPath,
    split_path_in_frame,
)
from brachis.task.scene import SceneBody
from brachis.task.settings import Payload
from brachis.task.tolerances import TaskSpace, Tolerances

WAYS = ("path", "move", "approach", "retract")
"""Kinds of parts in which the arm moves."""
NEXT = "next"
"""Word for the posture in which the next part begins best."""


class Mark(Model):
    """An event at the start or end of a part, such as the ignition of an arc."""

    name: Name
    """Name of the event."""
    at: Literal["start", "end"] = "start"
    """End of the part at which the event occurs."""
    lead: Annotated[Number, Field(ge=-10.0, le=10.0)] = 0.0
    """Time by which the event comes earlier, s; later if negative."""


class Part(Model):
    """A part of a program."""

    kind: ClassVar[str]
    name: Name | None = None
    """Name of the part. Null: its kind and number."""
    events: tuple[Mark, ...] = ()
    """Events that are returned with their times."""

    @property
    def flies(self) -> bool:
        """Whether the arm passes on to the next part without a stop."""
        return getattr(self, "fly", False)


class FlyingPart(Part):
    """A part from which the arm may pass on to the next one without a stop."""

    fly: Flag = False
    """Whether the arm passes on to the next part without a stop; one of the two is a move."""


class LimitedPart(FlyingPart):
    """A part with limits of its own."""

    tool_limits: ToolLimits | None = None
    """Limits on the tool in this part, in place of the same ones of the task."""
    limits: LimitSpec | None = None
    """Joint limits in this part, in place of the same ones of the robot; its factors apply to them too."""


class PathPart(LimitedPart):
    """A path of the tool."""

    kind: ClassVar[str] = "path"
    path: StatedPath
    """As path of a task."""
    task_space: TaskSpace | None = None
    """As task_space of a task, which is the default."""
    path_start: PathStart = None
    """As path_start of a task. Null: the first waypoint, or the end of the part before."""
    path_frame: Name | None = None
    """As path_frame of a task."""
    path_reversed: Literal[False, True, "free"] = False
    """As path_reversed of a task. free: the planner chooses."""
    path_begin: Annotated[
        Literal["free"] | PathBegin, ByForm("free, or a number from 0 to below 1")
    ] = 0.0
    """As path_begin of a task. free: the planner chooses one of eight places, or of the stops of the path."""
    tolerances: Tolerances = Field(default_factory=Tolerances)
    """As tolerances of a task."""
    redundant_joints: RedundantJoints = "auto"
    """As redundant_joints of a task."""
    branch: Name = "auto"
    """As branch of a task."""

    @model_validator(mode="before")
    @classmethod
    def _expand(cls, content: object) -> object:
        """Split a path that is given in a frame."""
        if not isinstance(content, Mapping):
            return content
        return split_path_in_frame(content)


class MovePart(LimitedPart):
    """A move through the air."""

    kind: ClassVar[str] = "move"
    move: Annotated[
        Name | Posture,
        ByForm("next, the name of a posture, or a mapping {joints: [...]}"),
        # A program in Python may give an array.
        BeforeValidator(
            lambda move: {"joints": move} if isinstance(move, list) else move
        ),
    ]
    """Posture at the end: next (where the next part begins best), the name of a posture, or {joints: [...]}."""


class ApproachPart(Part):
    """A straight way to the start of the next path, along the tool's z axis."""

    kind: ClassVar[str] = "approach"
    approach: Positive
    """Length, m."""


class RetractPart(FlyingPart):
    """A straight way back from the end of the path before, along the tool's z axis."""

    kind: ClassVar[str] = "retract"
    retract: Positive
    """Length, m."""


class DwellPart(Part):
    """A wait at rest."""

    kind: ClassVar[str] = "dwell"
    dwell: Positive
    """Duration, s."""


class PayloadPart(Part):
    """A change of the payload for all parts that follow."""

    kind: ClassVar[str] = "payload"
    payload: Payload | None
    """As robot.payload of a task. Null: nothing."""


ProgramPart = Annotated[
    PathPart | MovePart | ApproachPart | RetractPart | DwellPart | PayloadPart,
    ByKey("a part needs exactly one kind"),
]


class _Parts(Model):
    """The parts of a program."""

    program: NonEmpty[ProgramPart]


def Program(  # noqa: N802  (made like Line and Arc)
    parts: Iterable[Part | Mapping[str, Any]],
) -> tuple[Part, ...]:
    """Make the parts of a program, which follow one another; ``+`` joins programs.

    Parameters
    ----------
    parts : iterable of mapping
        Parts in the form of a task file: ``{"path": ...}``, ``{"move": "next"}``, ``{"approach": 0.05}``,
        ``{"retract": 0.05}``, ``{"dwell": 0.5}`` or ``{"payload": ...}``, each with its other keys.

    Returns
    -------
    tuple of Part
        For the keyword ``program`` of `brachis.plan`.

    Raises
    ------
    TaskError
        A part is wrong.

    Examples
    --------
    >>> import brachis
    >>> seam = {"path": brachis.Line(by=[0.0, 0.3])}
    >>> program = brachis.Program([seam, {"dwell": 0.2}, {"move": "next"}])
    >>> [part.kind for part in program]
    ['path', 'dwell', 'move']
    """
    is_single = isinstance(parts, str | Mapping | Model)
    content = {"program": [parts] if is_single else list(parts)}
    return validate(_Parts, content, "Program").program


def part_names(parts: Iterable[Part]) -> list[str]:
    """Return the names of all parts; a part without a name is the first, second, ... of its kind."""
    counts: Counter[str] = Counter()
    names = []
    for part in parts:
        counts[part.kind] += 1
        names.append(part.name or f"{part.kind} {counts[part.kind]}")
    return names


def scene_during(
    scene: Sequence[SceneBody], parts: Sequence[Part], number: int
) -> tuple[SceneBody, ...]:
    """Return the bodies that are there during a part, whose number counts from 0."""
    names = part_names(parts)

    def is_there(body: SceneBody) -> bool:
        begin = 0 if body.since is None else names.index(body.since)
        end = len(names) if body.until is None else names.index(body.until)
        return begin <= number < end

    return tuple(filter(is_there, scene))


PATH_KEYS = (
    "path",
    "task_space",
    "path_start",
    "path_frame",
    "path_reversed",
    "path_begin",
    "tolerances",
    "redundant_joints",
    "branch",
)
"""Keys of a task that are those of a part with a path."""


def path_keys(part: PathPart) -> dict[str, Any]:
    """Return the keys of a task for the path of a part; what is free is as the path is written."""
    values = {key: getattr(part, key) for key in PATH_KEYS}
    return {key: value for key, value in values.items() if value != "free"}


def with_task_space(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of a task with a program whose paths have the task space of the task by default.

    The task itself is a move: its start may be free.
    """
    space = content.get("task_space")
    parts = content["program"]
    if isinstance(parts, Sequence) and not isinstance(parts, str):
        parts = [_with_default(part, space) for part in parts]
    return {"start": "free", **content, "program": parts, "task_space": "free"}


def _with_default(part: object, space: object) -> object:
    """Return a part with a task space by default, if it is a path."""
    if isinstance(part, Part):
        part = part.model_dump(exclude_unset=True)
    if not (isinstance(part, Mapping) and "path" in part):
        return part
    return {**part, "task_space": part.get("task_space") or space}


_MOST_FREE = 12
"""Maximum number of paths whose order is free."""


def find_mistakes(
    parts: Sequence[Part],
    order: str,
    start: object,
    end: object,
) -> Iterator[Mistake]:
    """Yield the mistakes in a program's parts and in the postures at both ends, with the names of the parts."""
    mistakes = [
        _find_wrong_names(parts),
        _find_wrong_order(parts),
        _find_wrong_start(parts, start, end),
        _find_wrong_flights(parts, is_closed=end == "start"),
        _find_wrong_end(parts, end),
    ]
    if order == "free":
        mistakes[1:] = [_find_mistakes_if_free(parts)]
    names = part_names(parts)
    for key, problem, allowed in chain.from_iterable(mistakes):
        number = re.search(r"\d+", key)
        name = f"{names[int(number[0])]}: " if number else ""
        yield key, name + problem, allowed


def _find_wrong_names(parts: Sequence[Part]) -> Iterator[Mistake]:
    """Yield names that occur twice, and events that have no time."""
    names = part_names(parts)
    for number, part in enumerate(parts):
        if names.index(names[number]) < number:
            yield f"program[{number}].name", "two parts have this name", "another name"
        if part.events and isinstance(part, PayloadPart):
            yield (
                f"program[{number}].events",
                "a change of the payload takes no time",
                "events of the part before or after",
            )
        if len(set(part.events)) < len(part.events):
            yield f"program[{number}].events", "an event occurs twice", "each once"
    if parts and isinstance(parts[-1], PayloadPart):
        key = f"program[{len(parts) - 1}].payload"
        yield key, "no motion follows this change", "a part after it"


def _find_wrong_end(parts: Sequence[Part], end: object) -> Iterator[Mistake]:
    """Yield the mistake of a program whose last move leads to no given posture."""
    ways = [number for number, part in enumerate(parts) if part.kind in WAYS]
    if end == "free" and ways and getattr(parts[ways[-1]], "move", None) == NEXT:
        yield (
            f"program[{ways[-1]}].move",
            "the last move leads to a posture that nothing determines",
            "a posture in this move, or end",
        )


def _find_wrong_order(parts: Sequence[Part]) -> Iterator[Mistake]:
    """Yield the mistakes in the order of parts."""
    kinds = [part.kind for part in parts if part.kind in WAYS]
    numbers = [i for i, part in enumerate(parts) if part.kind in WAYS]
    for number, before, kind, after in zip(
        numbers, [None, *kinds], kinds, [*kinds[1:], None], strict=False
    ):
        key = f"program[{number}]"
        part = parts[number]
        if kind == "approach" and (after != "path" or before not in ("move", None)):
            yield (
                key,
                "an approach leads to a path",
                "a path after it, and a move or nothing before it",
            )
        if kind == "retract" and (before != "path" or after not in ("move", None)):
            yield (
                key,
                "a retract leads away from a path",
                "a path before it, and a move or nothing after it",
            )
        travel = ("path_reversed", "path_begin")
        changed = [name for name in travel if getattr(part, name, False)]
        if changed and not {before, after} <= {"move", None}:
            yield (
                f"{key}.{changed[0]}",
                "a path that begins elsewhere than it is written lies between moves",
                "a move or nothing on both sides",
            )
        if isinstance(part, PathPart) and part.task_space in (None, "free"):
            yield (
                f"{key}.task_space",
                "a path needs a task space",
                "pose, position, ...; or task_space of the task, for all paths",
            )
        if isinstance(part, MovePart) and part.move == NEXT and after == "move":
            yield (
                f"{key}.move",
                "two moves meet in a posture that nothing determines",
                "a posture, or a path after the move",
            )


def _find_wrong_start(
    parts: Sequence[Part], start: object, end: object
) -> Iterator[Mistake]:
    """Yield the mistakes of a program that does not begin with a motion from somewhere."""
    kinds = [part.kind for part in parts if part.kind in WAYS]
    if parts and not kinds:
        yield "program", "nothing moves", "at least one path or move"
    elif parts and parts[0].kind == "dwell":
        yield "program[0]", "the arm waits before it has moved", "a path or move first"
    elif (
        start == "free"
        and kinds[:1] == ["move"]
        # A motion that closes begins where its last path ends.
        and (end != "start" or kinds[-1] == "move")
    ):
        yield (
            "start",
            "this key is missing: nothing else states where the program begins",
            "a posture",
        )


def _find_wrong_flights(parts: Sequence[Part], *, is_closed: bool) -> Iterator[Mistake]:
    """Yield the parts after which the arm cannot go on without a stop."""
    followers = [*parts[1:], parts[0] if is_closed and len(parts) > 1 else None]
    for number, (part, after) in enumerate(zip(parts, followers, strict=False)):
        kinds = [part.kind, getattr(after, "kind", "dwell")]
        if part.flies and not ("move" in kinds and set(kinds) <= set(WAYS)):
            yield (
                f"program[{number}].fly",
                "the arm cannot pass on without a stop here",
                "a move before or after; segments of one path follow one another without a stop",
            )


def _find_mistakes_if_free(parts: Sequence[Part]) -> Iterator[Mistake]:
    """Yield the mistakes in a program whose order is free."""
    for number, part in enumerate(parts):
        if part.flies:
            yield f"program[{number}].fly", "the arm stops before each move", "false"
    paths = [part for part in parts if isinstance(part, PathPart)]
    if not 2 <= len(paths) <= _MOST_FREE:
        yield (
            "order",
            f"the order of {write_count(len(paths), 'path')} cannot be free",
            f"2 to {_MOST_FREE} paths; or leave out order, and add moves",
        )
    for number, part in enumerate(parts):
        if not isinstance(part, PathPart):
            yield (
                f"program[{number}]",
                "with order: free, the planner adds everything between the paths",
                "paths only",
            )
