"""The problems of a program: every move, and every path with its approach and retract, is bound to the robot.

Successive paths with the same settings form one path with stops, and so do a path, its approach and its retract.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from brachis.common import tolerances
from brachis.errors import PathError, TaskError
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
    SpeedTable,
    Task,
    ToolLimits,
    name_of,
    path_keys,
    scene_during,
)
from brachis.task.fields import POSITION
from brachis.task.limit_models import without_defaults
from brachis.task.messages import validate
from brachis.task.orientation import ToolPose
from brachis.task.points.units import quaternions_of
from brachis.task.program import NEXT, Part
from brachis.task.scene import SceneBody
from brachis.task.segments import LineSegment, LineTo, SegmentModel
from brachis.task.settings import Payload

_PLACES = len(POSITION)


def bind_task(
    robot: Robot, task: Task, own_limits: Sequence[LimitModel] = ()
) -> Problem:
    """Bind a task, or all parts of its program, to a robot; raise InputError as `Problem.of` does."""
    if not task.program:
        return Problem.of(robot, task, own_limits)
    lasting = tuple(body for body in task.scene if body.since == body.until is None)
    whole_task = task.model_copy(update={"scene": lasting})
    whole = replace(Problem.of(robot, whole_task, own_limits), task=task)
    ways = list(_ways(task) if task.order == "given" else _free_ways(task))
    ends = [way.end for way in ways]
    if ends[-1] == "free":
        ends[-1] = task.start if task.end == "start" else task.end
    problems: list[Problem] = []
    sections: list[list[Section]] = []
    begins = [task.start, *ends[:-1]]
    for way, *postures in zip(ways, begins, ends, strict=True):
        changed = _robot_of(robot, way)
        before = problems[-1] if problems else None
        stated = dict(zip(("start", "end"), postures, strict=True))
        part_task = _task_of(way, changed, task, before, stated)
        problem = Problem.of(changed, part_task, own_limits)
        if before is not None:
            _check_meet(before, problem, way)
        problems.append(problem)
        sections.append(list(_sections(way, problem)))
    is_closed = task.end == "start" and task.start == "free"
    if is_closed:
        _check_meet(problems[-1], problems[0], ways[0])
    for way, problem in zip(ways, problems, strict=True):
        if any(limit.guarantee.is_mean for limit in problem.limits):
            raise TaskError(
                "a program cannot have limits on means over its time",
                where=f"{way.key}, robot.limits.rms_torque",
                allowed="no such limit; verify the motion of the program against it",
            )
    waits = [way.wait for way in ways]
    return ProblemChain.of_parts(whole, problems, waits, sections, is_closed=is_closed)


@dataclass
class _Way:
    """A move, or successive parts along one path, with the numbers of its parts, the payload and the scene."""

    payload: Payload | None
    scene: tuple[SceneBody, ...]
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

    def goes_on_with(self, way: _Way) -> bool:
        """Tell whether the only part of another way belongs to the same path."""
        ((_, part),) = way.parts
        if isinstance(part, DwellPart):
            return True
        if (way.payload, way.scene) != (self.payload, self.scene):
            return False
        if isinstance(part, RetractPart):
            return True
        paths = self.of(PathPart)
        if not isinstance(part, PathPart) or self.of(MovePart):
            return False
        if not paths:
            return True
        # A path that states where it begins may not begin where the one before ends.
        is_same = part.path_start is None and _settings(paths[-1]) == _settings(part)
        return is_same and not _has_places(part.tool_limits)


def _has_places(limits: ToolLimits | None) -> bool:
    """Tell whether limits on the tool state values of s, which are those of a path alone."""
    if limits is None:
        return False
    return bool(limits.process_speed) or isinstance(limits.speed, SpeedTable)


def _settings(part: PathPart) -> dict[str, Any]:
    """Return everything of a part but its path."""
    return part.model_dump(exclude={"name", "path", "path_start", "events"})


def _ways(task: Task) -> Iterator[_Way]:
    """Yield the ways of a program."""
    payload = task.robot.payload
    way = None
    for number, part in enumerate(task.program):
        if isinstance(part, PayloadPart):
            payload = part.payload
            continue
        begun = _Way(
            payload, scene_during(task.scene, task.program, number), [(number, part)]
        )
        if way is not None and way.goes_on_with(begun):
            way.parts += begun.parts
            continue
        if way is not None:
            yield way
        way = begun
    if way is not None:
        yield way


def _free_ways(task: Task) -> Iterator[_Way]:
    """Yield every path of a program whose order is free, with a move before, between and after them as needed."""
    payload = task.robot.payload
    move = (0, MovePart(move=NEXT, name="move"))
    for number, part in enumerate(task.program):
        if number or task.start != "free":
            yield _Way(payload, task.scene, [move])
        yield _Way(payload, task.scene, [(number, part)])
    if task.end != "free":
        yield _Way(payload, task.scene, [move])


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


def _task_of(
    way: _Way,
    robot: Robot,
    task: Task,
    before: Problem | None,
    stated: Mapping[str, Posture | str],
) -> Task:
    """Return the task of a way. `before` is the problem of the way before, `stated` are the postures at both ends."""
    if not way.of(LimitedPart):
        raise TaskError(
            "the payload or the scene changes between a path and its approach or retract",
            where=way.key,
            allowed="a path in place of the approach or retract",
        )
    limited = way.of(LimitedPart)[0]
    changes: dict[str, Any] = {
        "program": (),
        "order": "given",
        "robot": robot.settings,
        "scene": way.scene,
        # A scene may be empty during a part: the mode is that of the whole program.
        "collisions": task.collisions.model_copy(update={"mode": task.collision_mode}),
        **stated,
        "tool_limits": limited.tool_limits or task.tool_limits,
    }
    if isinstance(limited, MovePart):
        return task.model_copy(update=changes)
    changes |= path_keys(limited)
    segments = _segments(way)
    ending = segments[-1].model_copy(update={"stop": False, "dwell": 0.0})
    changes["path"] = (*segments[:-1], ending)
    if changes["path_start"] is None and before is not None:
        changes["path_start"] = _end_of(before, changes)
    approaches = way.of(ApproachPart)
    retracts = way.of(RetractPart)
    if (approaches or retracts) and _has_places(limited.tool_limits):
        raise TaskError(
            "with an approach or a retract, values of s are not those of the path alone",
            where=f"{way.key}.tool_limits",
            allowed="speed in the segments of the path",
        )
    if approaches or retracts:
        free = {"end": "free", "start": "free" if approaches else stated["start"]}
        plain = task.model_copy(update=changes | free)
        _, task_map = bind(robot, plain.task_space, plain.tolerances)
        path = path_of(task_map, validate(Task, plain, way.key))
        if approaches:
            changes["path_start"] = _pose(path, 0.0, approaches[0].approach, way)
            to = tuple(_pose(path, 0.0).position)
            line = LineSegment(line=LineTo(to=to), stop=True, dwell=_first_wait(way))
            changes["path"] = (line, *changes["path"])
        if retracts:
            away = _pose(path, 1.0, retracts[0].retract, way)
            stopping = segments[-1].model_copy(update={"stop": True})
            line = LineSegment(line=LineTo(to=tuple(away.position)))
            changes["path"] = (*changes["path"][:-1], stopping, line)
    return validate(Task, task.model_copy(update=changes), way.key)


def _check_meet(before: Problem, after: Problem, way: _Way) -> None:
    """Refuse two paths that do not meet, with no move between them."""
    (last,) = before.path.sample(np.ones(1)).target
    (first,) = after.path.sample(np.zeros(1)).target
    if len(last) != len(first) or not len(first):
        return
    miss = float(np.abs(after.task_map.difference(first, last)).max())
    if miss > tolerances.WRITTEN:
        raise PathError(
            "the path does not begin where the path before ends",
            where=f"{way.key}.path_start",
            found=f"{miss:.3g} m or rad apart",
            allowed=f"at most {tolerances.WRITTEN:g}",
            hint="Put {move: next} between them",
        )


def _end_of(
    before: Problem, keys: Mapping[str, Any]
) -> ToolPose | tuple[float, ...] | None:
    """Return the end of the path before, if it has the same coordinates as a path with certain keys."""
    if any(
        getattr(before.task, key) != keys[key] for key in ("task_space", "path_frame")
    ):
        return None
    (target,) = before.path.sample(np.ones(1)).target
    if len(target) == _PLACES + 9:
        return _pose(before.path, 1.0)
    frame = before.path.frame
    return tuple((target if frame is None else frame.to_frame(target)).tolist())


def _segments(way: _Way) -> list[SegmentModel]:
    """Return the segments of the paths of a way, with stops between the paths and the dwells between them."""
    segments: list[SegmentModel] = []
    last = len(way.parts) - 1
    for number, (_, part) in enumerate(way.parts):
        if isinstance(part, PathPart):
            if segments:
                segments[-1] = segments[-1].model_copy(update={"stop": True})
            segments += part.path
        elif isinstance(part, DwellPart) and segments and number < last:
            waits = {"stop": True, "dwell": segments[-1].dwell + part.dwell}
            segments[-1] = segments[-1].model_copy(update=waits)
    return segments


def _first_wait(way: _Way) -> float:
    """Return the time for which the arm waits between the approach and the path, s."""
    total = 0.0
    for _, part in way.parts:
        if isinstance(part, PathPart):
            break
        total += part.dwell if isinstance(part, DwellPart) else 0.0
    return total


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
        dwell = part.dwell if isinstance(part, DwellPart) else 0.0
        name = name_of(part, number + 1)
        yield Section(name, part.kind, s_end, part.events, dwell)
