"""The problems of a program: every move, and every path with its approach and retract, is bound to the robot.

Successive paths with the same settings form one path with stops, and so do a path, its approach and its retract.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import product, takewhile
from typing import Any

import numpy as np

from brachis.common import tolerances
from brachis.errors import InputError, PathError, TaskError
from brachis.path import OffPathError, Path, path_of, posture_hint
from brachis.path.rotations import rotation_of
from brachis.problem.chain import ProblemChain, Section, name_keys
from brachis.problem.problem import Problem
from brachis.robot import Robot, bind
from brachis.robot.custom_limits import LimitModel
from brachis.robot.from_task import replace_limits
from brachis.task import (
    FREE,
    ApproachPart,
    BoundarySettings,
    DwellPart,
    LimitedPart,
    LimitSpec,
    MovePart,
    PathPart,
    PayloadPart,
    Posture,
    RetractPart,
    SpeedTable,
    Task,
    ToolLimits,
    part_names,
    path_keys,
    scene_during,
)
from brachis.task.fields import POSITION
from brachis.task.limit_models import without_defaults
from brachis.task.load import with_start
from brachis.task.messages import validate
from brachis.task.orientation import ToolPose
from brachis.task.points.units import quaternions_of
from brachis.task.program import NEXT, Part
from brachis.task.scene import SceneBody
from brachis.task.segments import LineSegment, LineTo, SegmentModel
from brachis.task.settings import Payload

_PLACES = len(POSITION)
_BEGINS = 8
"""Number of places, evenly spaced, at which a closed path may begin if the planner chooses."""


def bind_task(
    robot: Robot, task: Task, own_limits: Sequence[LimitModel] = ()
) -> Problem:
    """Bind a task, or all parts of its program, to a robot; raise InputError as `Problem.of` does."""
    if not task.program:
        return Problem.of(robot, task, own_limits)
    lasting = tuple(body for body in task.scene if body.since == body.until is None)
    parts = [
        part.model_copy(update={"name": name})
        for part, name in zip(task.program, part_names(task.program), strict=True)
    ]
    named = task.model_copy(update={"program": parts})
    divide = _stretches if task.order == "given" else _free_stretches
    stretches = list(divide(named))
    closing = FREE if stretches[-1].flies else 0.0
    boundary = task.boundary.model_copy(
        update={"start_speed": closing, "end_speed": closing}
    )
    bounded = task.model_copy(update={"boundary": boundary})
    whole = Problem.of(robot, bounded.with_scene(lasting), own_limits)
    whole = replace(whole, task=bounded)
    ends = [stretch.end for stretch in stretches]
    if ends[-1] == "free":
        ends[-1] = task.start if task.end == "start" else task.end
    problems: list[Problem] = []
    sections: list[list[Section]] = []
    begins = [task.start, *ends[:-1]]
    flights = [stretches[-1].flies, *(stretch.flies for stretch in stretches)]
    for number, (stretch, *postures) in enumerate(
        zip(stretches, begins, ends, strict=True)
    ):
        before = problems[-1] if problems else None
        stated: dict[str, Any] = dict(zip(("start", "end"), postures, strict=True))
        begins_flying, ends_flying = flights[number : number + 2]
        stated["boundary"] = BoundarySettings(
            start_speed=FREE if begins_flying else 0.0,
            end_speed=FREE if ends_flying else 0.0,
        )
        previous = stretches[number - 1].sections if number else []
        with _in_program(task, stretch.sections, previous):
            changed = _robot_of(robot, stretch)
            part_task = _task_of(stretch, changed, task, before, stated)
            problem = Problem.of(changed, part_task, own_limits).waiting(stretch.wait)
            tasks = _variants(stretch, part_task, problem.path)
            variants = [
                Problem.of(changed, variant, own_limits).waiting(stretch.wait)
                for variant in tasks
            ]
        problem = replace(problem, variants=tuple(variants))
        if before is not None:
            _check_meet(before, problem, stretch)
        problems.append(problem)
        sections.append(list(_sections(stretch, problem)))
    goal = problems[-1].end
    if goal is not None and "free" not in (task.end, stretches[-1].end):
        _check_end(robot, goal, whole.end, stretches[-1])
    is_closed = task.end == "start" and task.start == "free"
    if is_closed:
        _check_meet(problems[-1], problems[0], stretches[0])
    for stretch, problem in zip(stretches, problems, strict=True):
        if any(limit.guarantee.is_mean for limit in problem.limits):
            raise TaskError(
                "a program cannot have limits on means over its time",
                where=f"{stretch.key}, robot.limits.rms_torque",
                allowed="no such limit; verify the motion of the program against it",
            )
    return ProblemChain.of_parts(whole, problems, sections, is_closed=is_closed)


@contextmanager
def _in_program(
    task: Task, sections: Sequence[Section], before: Sequence[Section]
) -> Iterator[None]:
    """Name the keys of the program in errors about some of its parts; `before` are the parts before them."""
    try:
        yield
    except OffPathError as error:
        error.where = f"{sections[0].key}: {sections[0].name}"
        advice = "Put {move: next} before it"
        if error.name == "end":
            error.where = "end"
            back = "back to its start" if task.end == "start" else "to its end"
            error.problem = f"the program does not lead {back} posture"
            advice = "Add {move: next} as the last part"
        error.put_advice(advice)
        raise
    except InputError as error:
        name_keys(error, sections, before)
        raise


def _check_end(
    robot: Robot, goal: np.ndarray, end: np.ndarray | None, stretch: _Stretch
) -> None:
    """Refuse a last move to a posture other than that at the end."""
    if end is None or np.abs(goal - end).max() > tolerances.WRITTEN:
        raise TaskError(
            "the last move leads to a posture other than the end",
            where=f"{stretch.key}.move",
            allowed="next, which leads to the end; or end: free",
            hint=posture_hint(robot, goal),
        )


@dataclass
class _Stretch:
    """A move, or successive parts along one path, with the numbers of its parts, the payload and the scene."""

    payload: Payload | None
    scene: tuple[SceneBody, ...]
    parts: list[tuple[int, Part]] = field(default_factory=list)
    payload_key: str = "robot.payload"

    def of(self, kind: type[Part]) -> list[Any]:
        """Return the parts of a kind."""
        return [part for _, part in self.parts if isinstance(part, kind)]

    @property
    def key(self) -> str:
        """Key of the path or the move, for messages; of the first part if there is none."""
        limited = [entry for entry in self.parts if isinstance(entry[1], LimitedPart)]
        number, _ = (*limited, *self.parts)[0]
        return f"program[{number}]"

    @property
    def sections(self) -> list[Section]:
        """The parts as sections, before their ends along the path are known."""
        renamed = [("robot.payload", self.payload_key)]
        for part in self.of(LimitedPart)[:1]:
            limits = part.limits or LimitSpec()
            renamed += [
                (f"robot.limits.{kind}", f"{self.key}.limits.{kind}")
                for kind in without_defaults(limits)
            ]
        return [
            Section(
                part.name or "",
                part.kind,
                np.nan,
                part.events,
                dwell=getattr(part, "dwell", 0.0),
                key="" if getattr(part, "move", "") == NEXT else f"program[{number}]",
                segments=len(getattr(part, "path", ()))
                or int(part.kind in ("approach", "retract")),
                renamed=tuple(renamed),
            )
            for number, part in self.parts
        ]

    @property
    def end(self) -> Posture | str:
        """Posture at the end; ``free`` if the planner chooses it."""
        moves = self.of(MovePart)
        return moves[0].move if moves and moves[0].move != NEXT else "free"

    @property
    def flies(self) -> bool:
        """Whether the arm passes on to the next stretch without a stop."""
        return self.parts[-1][1].flies

    @property
    def wait(self) -> float:
        """Time for which the arm waits at the end, s."""
        last = takewhile(lambda part: part.kind == "dwell", reversed(self.sections))
        return sum(part.dwell for part in last)

    def goes_on_with(self, stretch: _Stretch) -> bool:
        """Tell whether the only part of another stretch belongs to the same path."""
        ((_, part),) = stretch.parts
        if isinstance(part, DwellPart):
            return True
        if (stretch.payload, stretch.scene) != (self.payload, self.scene):
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
    return part.model_dump(exclude={"name", "path", "path_start", "events", "fly"})


def _stretches(task: Task) -> Iterator[_Stretch]:
    """Yield the stretches of a program."""
    payload = task.robot.payload
    key = "robot.payload"
    stretch = None
    for number, part in enumerate(task.program):
        if isinstance(part, PayloadPart):
            payload = part.payload
            key = f"program[{number}].payload"
            continue
        scene = scene_during(task.scene, task.program, number)
        begun = _Stretch(payload, scene, [(number, part)], key)
        if stretch is not None and stretch.goes_on_with(begun):
            stretch.parts += begun.parts
            continue
        if stretch is not None:
            yield stretch
        stretch = begun
    if stretch is not None:
        yield stretch


def _free_stretches(task: Task) -> Iterator[_Stretch]:
    """Yield every path of a program whose order is free, with a move before, between and after them as needed."""
    payload = task.robot.payload
    move = (0, MovePart(move=NEXT, name="to the end"))
    for number, part in enumerate(task.program):
        if number or task.start != "free":
            yield _Stretch(payload, task.scene, [move])
        yield _Stretch(payload, task.scene, [(number, part)])
    if task.end != "free":
        yield _Stretch(payload, task.scene, [move])


def _robot_of(robot: Robot, stretch: _Stretch) -> Robot:
    """Return the robot with the payload and the limits of a stretch."""
    payload = stretch.payload
    if payload != robot.settings.payload:
        stated = {"mass": None} if payload is None else payload.model_dump()
        robot = robot.with_payload(**stated)
    for part in stretch.of(LimitedPart)[:1]:
        if part.limits is not None:
            robot = replace_limits(robot, part.limits)
    return robot


def _task_of(
    stretch: _Stretch,
    robot: Robot,
    task: Task,
    before: Problem | None,
    stated: Mapping[str, Any],
) -> Task:
    """Return the task of a stretch, given the problem of the one before, and the postures and speeds at both ends."""
    if not stretch.of(LimitedPart):
        raise TaskError(
            "the payload or the scene changes between a path and its approach or retract",
            allowed="a path in place of the approach or retract",
        )
    task = task.with_scene(stretch.scene)
    limited = stretch.of(LimitedPart)[0]
    tool_limits = limited.tool_limits or ToolLimits()
    stated_keys = tool_limits.model_dump(exclude_defaults=True)
    own = {key: getattr(tool_limits, key) for key in stated_keys}
    changes: dict[str, Any] = {
        "program": (),
        "order": "given",
        "robot": robot.settings,
        **stated,
        "tool_limits": task.tool_limits.model_copy(update=own),
    }
    if isinstance(limited, MovePart):
        return _checked(task, changes)
    changes |= path_keys(limited)
    segments = _segments(stretch)
    ending = segments[-1].model_copy(update={"stop": False, "dwell": 0.0})
    changes["path"] = (*segments[:-1], ending)
    if changes["path_start"] is None and before is not None:
        changes["path_start"] = _end_of(before, changes)
    approaches = stretch.of(ApproachPart)
    retracts = stretch.of(RetractPart)
    is_open = "free" in (limited.path_reversed, limited.path_begin)
    if (approaches or retracts or is_open) and _has_places(changes["tool_limits"]):
        raise TaskError(
            "values of s are not those of the path alone with an approach, a retract or a travel that is free",
            where="tool_limits",
            allowed="speed in the segments of the path",
        )
    if approaches or retracts:
        free = {"end": "free", "start": "free" if approaches else stated["start"]}
        plain = _checked(task, changes | free)
        _, task_map = bind(robot, plain.task_space, plain.tolerances)
        path = path_of(task_map, plain)
        if approaches:
            changes["path_start"] = _pose(path, 0.0, approaches[0].approach)
            to = tuple(_pose(path, 0.0).position)
            first = takewhile(lambda part: part.kind != "path", stretch.sections)
            wait = sum(part.dwell for part in first)
            line = LineSegment(line=LineTo(to=to), stop=True, dwell=wait)
            changes["path"] = (line, *changes["path"])
        if retracts:
            away = _pose(path, 1.0, retracts[0].retract)
            stopping = segments[-1].model_copy(update={"stop": True})
            line = LineSegment(line=LineTo(to=tuple(away.position)))
            changes["path"] = (*changes["path"][:-1], stopping, line)
    return _checked(task, changes)


def _checked(task: Task, changes: Mapping[str, Any]) -> Task:
    """Return a task with changes, whose path may state where it begins."""
    return with_start(validate(Task, task.model_copy(update=changes), ""), "")


def _variants(stretch: _Stretch, task: Task, path: Path) -> Iterator[Task]:
    """Yield the task of a stretch, given with its path, for every other way in which the path may be travelled."""
    for part in stretch.of(PathPart):
        turns = [part.path_reversed]
        if part.path_reversed == "free":
            turns = [False, True]
        begins = [part.path_begin]
        if part.path_begin == "free":
            stops = [s for s, dwell in path.dwells.items() if not dwell]
            places = np.append(
                np.arange(_BEGINS) / _BEGINS, np.abs(float(turns[0]) - np.array(stops))
            )
            begins = np.unique(places.round(9)).tolist()
        for begin, turn in list(product(begins, turns))[1:]:
            keys = {"path_reversed": turn, "path_begin": begin}
            yield task.model_copy(update=keys)


def _check_meet(before: Problem, after: Problem, stretch: _Stretch) -> None:
    """Refuse two paths that do not meet, with no move between them."""
    (last,) = before.path.sample(np.ones(1)).target
    (first,) = after.path.sample(np.zeros(1)).target
    if len(last) != len(first) or not len(first):
        return
    miss = float(np.abs(after.task_map.difference(first, last)).max())
    if miss > tolerances.WRITTEN:
        raise PathError(
            "the path does not begin where the path before ends",
            where=f"{stretch.key}.path_start",
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


def _segments(stretch: _Stretch) -> list[SegmentModel]:
    """Return the segments of the paths of a stretch, with stops between the paths and the dwells between them."""
    segments: list[SegmentModel] = []
    last = len(stretch.parts) - 1
    for number, (_, part) in enumerate(stretch.parts):
        if isinstance(part, PathPart):
            if segments:
                segments[-1] = segments[-1].model_copy(update={"stop": True})
            segments += part.path
        elif isinstance(part, DwellPart) and segments and number < last:
            waits = {"stop": True, "dwell": segments[-1].dwell + part.dwell}
            segments[-1] = segments[-1].model_copy(update=waits)
    return segments


def _pose(path: Path, s: float, back: float = 0.0) -> ToolPose:
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
            allowed="task_space: pose or pose_free_roll",
        )
    rotation = target[_PLACES:].reshape(3, 3)
    position = target[:_PLACES] - back * rotation[:, 2]
    turn = quaternions_of(rotation_of(rotation)).tolist()
    content = {"position": position.tolist(), "quaternion_wxyz": turn}
    return ToolPose.model_validate(content)


def _sections(stretch: _Stretch, problem: Problem) -> Iterator[Section]:
    """Yield the sections of the path of a stretch, one for each part."""
    segments = problem.task.path
    stopping = [number for number, segment in enumerate(segments) if segment.stop]
    count = 0
    s_end = 0.0
    for section in stretch.sections:
        count += section.segments
        if section.kind == "move" or count >= len(segments):
            s_end = 1.0
        elif section.segments:
            s_end = float(problem.path.stops[stopping.index(count - 1)])
        yield replace(section, s_end=s_end)
