"""The problems of a program: every move, and every path with its approach and retract, is bound to the robot.

Successive paths with the same settings form one path with stops, and so do a path, its approach and its retract.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from brachis.errors import PathError
from brachis.path import Path, path_of
from brachis.path.rotations import rotation_of
from brachis.problem.chain import ProblemChain, Section
from brachis.problem.problem import Problem
from brachis.robot import Robot, bind
from brachis.robot.custom_limits import LimitModel
from brachis.task import (
    ApproachPart,
    DwellPart,
    LimitedPart,
    MovePart,
    PathPart,
    PayloadPart,
    Posture,
    RetractPart,
    Task,
    name_of,
    path_keys,
)
from brachis.task.fields import POSITION
from brachis.task.limit_models import without_defaults
from brachis.task.messages import validate
from brachis.task.orientation import ToolPose
from brachis.task.points.units import quaternions_of
from brachis.task.program import NEXT, Part
from brachis.task.segments import LineSegment, LineTo, SegmentModel
from brachis.task.settings import Payload

_PLACES = len(POSITION)


def bind_task(
    robot: Robot, task: Task, own_limits: Sequence[LimitModel] = ()
) -> Problem:
    """Bind a task, or all parts of its program, to a robot; raise InputError as `Problem.of` does."""
    whole = Problem.of(robot, task, own_limits)
    if not task.program:
        return whole
    ways = list(_ways(task) if task.order == "given" else _free_ways(task))
    ends = [way.end for way in ways]
    if ends[-1] == "free":
        ends[-1] = task.start if task.end == "start" else task.end
    problems: list[Problem] = []
    sections: list[list[Section]] = []
    begins = [task.start, *ends[:-1]]
    for way, *postures in zip(ways, begins, ends, strict=True):
        changed = _robot_of(robot, way)
        before = problems[-1].path if problems else None
        part_task = _task_of(way, changed, task, before)
        stated = dict(zip(("start", "end"), postures, strict=True))
        part_task = part_task.model_copy(update=stated)
        problem = Problem.of(changed, part_task, own_limits)
        problems.append(problem)
        sections.append(list(_sections(way, problem)))
    is_closed = task.end == "start" and task.start == "free"
    waits = [way.wait for way in ways]
    return ProblemChain.of_parts(whole, problems, waits, sections, is_closed=is_closed)


@dataclass
class _Way:
    """A move, or successive parts along one path, with the numbers of its parts and the payload."""

    payload: Payload | None
    parts: list[tuple[int, Part]] = field(default_factory=list)

    def of(self, kind: type[Part]) -> list[Any]:
        """Return the parts of a kind."""
        return [part for _, part in self.parts if isinstance(part, kind)]

    @property
    def key(self) -> str:
        """Key of the first part, for messages."""
        return f"program[{self.parts[0][0]}]"

    @property
    def end(self) -> Posture | str:
        """Posture at the end; ``free`` if the planner chooses it."""
        moves = self.of(MovePart)
        return moves[0].move if moves and moves[0].move != NEXT else "free"

    @property
    def wait(self) -> float:
        """Time for which the arm waits at the end, s."""
        total = 0.0
        for _, part in reversed(self.parts):
            if not isinstance(part, DwellPart):
                break
            total += part.dwell
        return total

    def goes_on_with(self, part: Part) -> bool:
        """Tell whether a part belongs to the same path."""
        if isinstance(part, DwellPart | RetractPart):
            return True
        paths = self.of(PathPart)
        if not isinstance(part, PathPart) or self.of(MovePart):
            return False
        return not paths or _settings(paths[-1]) == _settings(part)


def _settings(part: PathPart) -> dict[str, Any]:
    """Return everything of a part but its path."""
    return part.model_dump(exclude={"name", "path", "path_start", "events"})


def _ways(task: Task) -> Iterator[_Way]:
    """Yield the ways of a program."""
    payload = task.robot.payload
    way = None
    for numbered in enumerate(task.program):
        part = numbered[1]
        if isinstance(part, PayloadPart):
            payload = part.payload
            continue
        is_same = way is not None and way.payload == payload
        if way is not None and is_same and way.goes_on_with(part):
            way.parts.append(numbered)
            continue
        if way is not None:
            yield way
        way = _Way(payload, [numbered])
    if way is not None:
        yield way


def _free_ways(task: Task) -> Iterator[_Way]:
    """Yield every path of a program whose order is free, with a move before, between and after them as needed."""
    payload = task.robot.payload
    move = (0, MovePart(move=NEXT, name="move"))
    for number, part in enumerate(task.program):
        if number or task.start != "free":
            yield _Way(payload, [move])
        yield _Way(payload, [(number, part)])
    if task.end != "free":
        yield _Way(payload, [move])


def _robot_of(robot: Robot, way: _Way) -> Robot:
    """Return the robot with the payload and the limits of a way."""
    payload = way.payload
    if payload != robot.settings.payload:
        stated = {"mass": None} if payload is None else payload.model_dump()
        robot = robot.with_payload(**stated)
    for part in way.of(LimitedPart)[:1]:
        if part.limits is not None:
            robot = robot.with_limits(**without_defaults(part.limits))
    return robot


def _task_of(way: _Way, robot: Robot, task: Task, before: Path | None) -> Task:
    """Return the task of a way with free ends. `before` is the path of the way before."""
    limited = way.of(LimitedPart)[0]
    changes: dict[str, Any] = {
        "program": (),
        "robot": robot.settings,
        "start": "free",
        "end": "free",
        "tool_limits": limited.tool_limits or task.tool_limits,
    }
    if isinstance(limited, MovePart):
        return task.model_copy(update=changes)
    changes |= path_keys(limited)
    segments = _segments(way)
    ending = segments[-1].model_copy(update={"stop": False, "dwell": 0.0})
    changes["path"] = (*segments[:-1], ending)
    if changes["path_start"] is None and before is not None and before.positions:
        changes["path_start"] = _pose(before, 1.0)
    plain = task.model_copy(update=changes)
    approaches = way.of(ApproachPart)
    retracts = way.of(RetractPart)
    if approaches or retracts:
        _, task_map = bind(robot, plain.task_space, plain.tolerances)
        path = path_of(task_map, validate(Task, plain, way.key))
        if approaches:
            changes["path_start"] = _pose(path, 0.0, approaches[0].approach, way)
            to = tuple(_pose(path, 0.0).position)
            line = LineSegment(line=LineTo(to=to), stop=True)
            changes["path"] = (line, *changes["path"])
        if retracts:
            away = _pose(path, 1.0, retracts[0].retract, way)
            stopping = segments[-1].model_copy(update={"stop": True})
            line = LineSegment(line=LineTo(to=tuple(away.position)))
            changes["path"] = (*changes["path"][:-1], stopping, line)
    return validate(Task, task.model_copy(update=changes), way.key)


def _segments(way: _Way) -> list[SegmentModel]:
    """Return the segments of the paths of a way, with stops between the paths and the dwells between them."""
    segments: list[SegmentModel] = []
    last = len(way.parts) - 1
    for number, (_, part) in enumerate(way.parts):
        if isinstance(part, PathPart):
            if segments:
                segments[-1] = segments[-1].model_copy(update={"stop": True})
            segments += part.path
        elif isinstance(part, DwellPart) and number < last:
            waits = {"stop": True, "dwell": segments[-1].dwell + part.dwell}
            segments[-1] = segments[-1].model_copy(update=waits)
    return segments


def _pose(path: Path, s: float, back: float = 0.0, way: _Way | None = None) -> ToolPose:
    """Return a pose of a path, in its frame, moved back along the tool's z axis.

    Raises
    ------
    PathError
        The path does not prescribe a position with the direction of the tool.
    """
    (target,) = path.sample(np.array([s])).target
    if path.frame is not None:
        target = path.frame.to_frame(target)
    if len(target) != _PLACES + 9:
        raise PathError(
            "an approach or a retract needs a path that prescribes the direction of the tool",
            where=None if way is None else way.key,
            allowed="task_space: pose or pose_free_roll",
        )
    rotation = target[_PLACES:].reshape(3, 3)
    position = target[:_PLACES] - back * rotation[:, 2]
    turn = quaternions_of(rotation_of(rotation)).tolist()
    content = {"position": position.tolist(), "quaternion_wxyz": turn}
    return ToolPose.model_validate(content)


def _sections(way: _Way, problem: Problem) -> Iterator[Section]:
    """Yield the sections of the path of a way, one for each part."""
    segments = problem.task.path
    stopping = [number for number, segment in enumerate(segments) if segment.stop]
    count = 0
    s_end = 0.0
    for number, part in way.parts:
        if isinstance(part, PathPart):
            count += len(part.path)
        elif not isinstance(part, DwellPart):
            count += 1
        if not isinstance(part, DwellPart):
            is_last = count >= len(segments)
            s_end = (
                1.0 if is_last else float(problem.path.stops[stopping.index(count - 1)])
            )
        yield Section(name_of(part, number + 1), part.kind, s_end, part.events)
