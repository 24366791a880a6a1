"""Tasks defined by keywords in programs. The keywords are the keys of a task file, without its sections."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, TypedDict, Unpack

from brachis.errors import UnknownNameError
from brachis.task.fields import Model, merge, plain
from brachis.task.limit_kinds import Array, LimitKeywords
from brachis.task.limit_models import LimitSpec, ToolLimits
from brachis.task.load import Source, load_task
from brachis.task.messages import key_paths
from brachis.task.models import Task
from brachis.task.orientation import ToolPose, Transform
from brachis.task.program import Part
from brachis.task.scene import CollisionSettings, SceneBody
from brachis.task.segments import SegmentModel
from brachis.task.settings import (
    BoundarySettings,
    Payload,
    Placement,
    RefinementSettings,
    RobotSettings,
    SearchSettings,
    SolverSettings,
    SplineSettings,
    expand_solver_name,
)
from brachis.task.tolerances import Margins, Tolerances

Posture = (
    Array | Sequence[float] | Mapping[str, float] | Mapping[str, Sequence[float]] | str
)
Settings = Mapping[str, Any]


class RobotKeywords(TypedDict, total=False):
    """Keys of the ``robot`` section of a task, except the keys that name files."""

    tool_frame: str | None
    tool_offset: Placement | Settings | Transform | None
    base_frame: str | None
    workpiece_frame: str | None
    mounting: Placement | Settings | Transform | Literal["floor", "wall", "ceiling"]
    gravity: Array | Sequence[float]
    locked_joints: Mapping[str, float] | None
    payload: Payload | Settings | None
    limits: LimitSpec | LimitKeywords | Settings | None
    speed_override: float | str
    friction: Settings | None


class TaskKeywords(RobotKeywords, total=False):
    """Keys of a task. Keys of its sections ``robot``, ``boundary``, ``spline`` and ``search`` need no section.

    A posture may be an array, a list or a mapping by joint name. A path may be a single segment, or an array of points
    (n, m) whose first point is the start of the path.
    """

    path: (
        SegmentModel
        | Mapping[str, Any]
        | Sequence[SegmentModel | Mapping[str, Any] | Sequence[float]]
        | Array
    )
    program: Sequence[Part | Mapping[str, Any]]
    order: Literal["given", "free"]
    start: Posture
    end: Posture
    frames: Mapping[str, Placement | Settings | Transform]
    postures: Mapping[str, Array | Sequence[float] | Mapping[str, float]]
    path_frame: str | None
    path_reversed: bool
    path_begin: float
    path_start: (
        Array | Sequence[float] | Mapping[str, Any] | ToolPose | Transform | None
    )
    task_space: str | Sequence[str]
    redundant_joints: Sequence[str] | Literal["auto"]
    branch: str
    tool_limits: ToolLimits | Settings
    scene: Sequence[SceneBody | Settings] | Settings
    collisions: CollisionSettings | Settings
    tolerances: Tolerances | Settings
    margins: Margins | Settings
    custom_limits: Mapping[str, Settings]
    strict: bool | None
    # boundary
    start_speed: float | Literal["free"]
    end_speed: float | Literal["free"]
    periodic: bool
    # spline
    degree: int
    intervals: int | Literal["auto"]
    knots: Literal["uniform", "free"]
    rest: Literal["velocity", "full", "jerk"]
    points_per_interval: int
    # search
    effort: Literal["single", "fast", "thorough", "exhaustive"]
    time_limit: float
    seed: int
    least_motion: bool
    slower: float | str
    # whole sections, for keys that occur in several sections
    robot: RobotSettings | Settings
    boundary: BoundarySettings | Settings
    spline: SplineSettings | Settings
    search: SearchSettings | Settings
    solver: str | SolverSettings | Settings
    refinement: RefinementSettings | Settings


_SECTION_OF = {
    key: section
    for section, model in (
        ("robot", RobotSettings),
        ("boundary", BoundarySettings),
        ("spline", SplineSettings),
        ("search", SearchSettings),
    )
    for key in model.model_fields
}


def task_with(
    source: Source | None = None, /, **keywords: Unpack[TaskKeywords]
) -> Task:
    """Return a task made from keywords, or a copy of a task with some keys changed.

    Parameters
    ----------
    source : path-like, mapping or Task, optional
        The task to change; see `load_task`.
    **keywords
        See `TaskKeywords`. Mappings are merged with those of `source` key by key. All other values replace the values
        in `source`.

    Raises
    ------
    UnknownNameError
        The keyword does not exist.
    TaskError
        See `load_task`.

    Examples
    --------
    >>> import brachis
    >>> from brachis.task import task_with
    >>> task = task_with(
    ...     path=brachis.Line(by=[0.0, 0.5]), start=[0.5, -2.1, 2.1], task_space=["x", "y"], intervals=12
    ... )
    >>> task.spline.intervals, task.start.joints
    (12, (0.5, -2.1, 2.1))
    >>> task_with(task, intervals=40).spline.intervals
    40
    """
    if source is not None and not keywords:
        return load_task(source)
    check_keywords(keywords)
    content: dict[str, Any] = {"brachis": 1}
    if source is not None:
        content = load_task(source).model_dump(exclude_unset=True)
        if not content.get("path"):  # a move or a program
            content.pop("path", None)
    for key, value in keywords.items():
        change = {key: _in_full(key, value)}
        if key in _SECTION_OF:
            change = {_SECTION_OF[key]: change}
        content = merge(content, change)
    return load_task(content)


def check_keywords(
    keywords: Iterable[str], where: str = "plan", arguments: Sequence[str] = ()
) -> None:
    """Refuse unknown keywords; the message says where the key belongs, or which keyword may be meant.

    Parameters
    ----------
    keywords : iterable of str
    where : str, optional
        Name of the function that takes the keywords.
    arguments : sequence of str, optional
        Names of the other arguments of the function.

    Raises
    ------
    UnknownNameError
    """
    known = TaskKeywords.__annotations__
    name = next((name for name in keywords if name not in known), None)
    if name is None:
        return
    limits = [word for word in name.split("_") if word in LimitKeywords.__annotations__]
    paths_of_words = (key_paths(word, Task) for word in (name, *limits))
    paths = next(filter(None, paths_of_words), [])
    hint = " or ".join(_as_keyword(path.split(".")) for path in paths)
    raise UnknownNameError(
        "keyword",
        name,
        sorted((*known, *arguments)),
        where=where,
        hint=hint and f"This is a key inside another keyword: {hint}",
    )


def _as_keyword(names: Sequence[str]) -> str:
    """Write a dotted key as a keyword: ``limits={'torque': ...}``."""
    names_section = names[1:-1] and _SECTION_OF.get(names[1]) == names[0]
    first, *inner_keys = names[1:] if names_section else names
    text = "..."
    for key in reversed(inner_keys):
        text = f"{{{key!r}: {text}}}"
    return f"{first}={text}"


def _in_full(key: str, value: object) -> object:
    """Return the value of a keyword as in a task file, where postures and solver names have a longer form."""
    if key == "solver":
        return expand_solver_name(value)
    if key not in {"start", "end"} or isinstance(value, str | Model):
        return value
    if isinstance(value, Mapping) and set(value) == {"joints"}:
        return value
    return {"joints": plain(value)}
