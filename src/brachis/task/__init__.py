"""The task file as frozen models, with its loader and its schema, but without numerics."""

from brachis.task.fitted import fit_path
from brachis.task.keywords import RobotKeywords, TaskKeywords, check_keywords, task_with
from brachis.task.limit_kinds import LIMIT_KINDS, ROBOT_LIMITS, LimitKeywords
from brachis.task.limit_models import (
    FROM_URDF,
    LimitSpec,
    ProcessSpeed,
    SpeedTable,
    ToolLimits,
)
from brachis.task.limits_file import read_limits
from brachis.task.load import (
    Source,
    check_robot_settings,
    load_task,
    name_task_file,
    read_assignment,
    with_keys,
)
from brachis.task.models import Task
from brachis.task.orientation import (
    AlongTangent,
    Rotate,
    ToolPose,
    TurnTo,
)
from brachis.task.paths import Posture
from brachis.task.point_data import FitReport, FitTolerance, PointFile
from brachis.task.program import (
    PATH_KEYS,
    ApproachPart,
    DwellPart,
    LimitedPart,
    Mark,
    MovePart,
    PathPart,
    PayloadPart,
    RetractPart,
    part_names,
    path_keys,
    scene_during,
)
from brachis.task.schema import json_schema
from brachis.task.segments import (
    CsvSegment,
    LineBy,
    LineSegment,
    Segment,
)
from brachis.task.settings import (
    FREE,
    BoundarySettings,
    FrictionSettings,
    Payload,
    Placement,
    RefinementSettings,
    RobotSettings,
    SolverSettings,
    SplineSettings,
)
from brachis.task.tolerances import Tolerances

__all__ = [
    "FREE",
    "FROM_URDF",
    "LIMIT_KINDS",
    "PATH_KEYS",
    "ROBOT_LIMITS",
    "AlongTangent",
    "ApproachPart",
    "BoundarySettings",
    "CsvSegment",
    "DwellPart",
    "FitReport",
    "FitTolerance",
    "FrictionSettings",
    "LimitKeywords",
    "LimitSpec",
    "LimitedPart",
    "LineBy",
    "LineSegment",
    "Mark",
    "MovePart",
    "PathPart",
    "Payload",
    "PayloadPart",
    "Placement",
    "PointFile",
    "Posture",
    "ProcessSpeed",
    "RefinementSettings",
    "RetractPart",
    "RobotKeywords",
    "RobotSettings",
    "Rotate",
    "Segment",
    "SolverSettings",
    "Source",
    "SpeedTable",
    "SplineSettings",
    "Task",
    "TaskKeywords",
    "Tolerances",
    "ToolLimits",
    "ToolPose",
    "TurnTo",
    "check_keywords",
    "check_robot_settings",
    "fit_path",
    "json_schema",
    "load_task",
    "name_task_file",
    "part_names",
    "path_keys",
    "read_assignment",
    "read_limits",
    "scene_during",
    "task_with",
    "with_keys",
]
