"""What is asked: the task file as frozen models, its loader and its schema. No numerics."""

from brachis.task.fitted import fit_path
from brachis.task.keywords import TaskKeywords, check_keywords, task_with
from brachis.task.limit_kinds import LIMIT_KINDS, LimitKeywords, LimitScale
from brachis.task.limit_models import (
    FROM_URDF,
    LimitSpec,
    ProcessSpeed,
    SpeedTable,
    ToolLimits,
)
from brachis.task.limits_file import LimitsFile, read_limits
from brachis.task.load import (
    Source,
    check_robot_settings,
    load_task,
    read_assignment,
    set_key,
    with_keys,
)
from brachis.task.models import Posture, Task
from brachis.task.orientation import (
    AlongTangent,
    Attitude,
    Rotate,
    Rotation,
    Tangent,
    Target,
    ToolPose,
    TurnTo,
)
from brachis.task.point_data import FitReport, FitTolerance, PointFile
from brachis.task.schema import json_schema
from brachis.task.segments import (
    ArcSegment,
    BSplineCurve,
    BSplineSegment,
    CsvSegment,
    LineBy,
    LineSegment,
    Segment,
    SegmentModel,
    SplineSegment,
    SplineThrough,
    TurnSegment,
)
from brachis.task.settings import (
    BoundarySettings,
    FrictionSettings,
    InertiaMatrix,
    Payload,
    Placement,
    RefinementSettings,
    RobotSettings,
    SearchSettings,
    SolverSettings,
    SplineSettings,
)
from brachis.task.tolerances import Tolerances

__all__ = [
    "FROM_URDF",
    "LIMIT_KINDS",
    "AlongTangent",
    "ArcSegment",
    "Attitude",
    "BSplineCurve",
    "BSplineSegment",
    "BoundarySettings",
    "CsvSegment",
    "FitReport",
    "FitTolerance",
    "FrictionSettings",
    "InertiaMatrix",
    "LimitKeywords",
    "LimitScale",
    "LimitSpec",
    "LimitsFile",
    "LineBy",
    "LineSegment",
    "Payload",
    "Placement",
    "PointFile",
    "Posture",
    "ProcessSpeed",
    "RefinementSettings",
    "RobotSettings",
    "Rotate",
    "Rotation",
    "SearchSettings",
    "Segment",
    "SegmentModel",
    "SolverSettings",
    "Source",
    "SpeedTable",
    "SplineSegment",
    "SplineSettings",
    "SplineThrough",
    "Tangent",
    "Target",
    "Task",
    "TaskKeywords",
    "Tolerances",
    "ToolLimits",
    "ToolPose",
    "TurnSegment",
    "TurnTo",
    "check_keywords",
    "check_robot_settings",
    "fit_path",
    "json_schema",
    "load_task",
    "read_assignment",
    "read_limits",
    "set_key",
    "task_with",
    "with_keys",
]
