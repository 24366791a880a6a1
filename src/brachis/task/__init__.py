"""What is asked: the task file as frozen models, its loader and its schema. No numerics."""

from brachis.task.arrays import fit_path
from brachis.task.boundary import BoundarySettings
from brachis.task.bspline_curve import BSplineCurve
from brachis.task.keys import read_assignment, set_key, with_keys
from brachis.task.keywords import TaskKeywords, check_keywords, task_with
from brachis.task.limit_models import FROM_URDF, LimitKeywords, LimitScale, LimitSpec
from brachis.task.limits_file import LimitsFile, read_limits
from brachis.task.load import Source, check_robot_settings, load_task
from brachis.task.models import Posture, Task
from brachis.task.mounting_models import InertiaMatrix, Payload, Placement
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
from brachis.task.planning_models import RefinementSettings, SearchSettings, SolverSettings, SplineSettings
from brachis.task.point_data import FileUnits, FitReport, FitTolerance, PointFile
from brachis.task.robot_models import FrictionSettings, RobotSettings
from brachis.task.schema import json_schema
from brachis.task.segments import (
    ArcSegment,
    BSplineSegment,
    CircleSegment,
    CsvSegment,
    HelixSegment,
    LineSegment,
    MovingSegment,
    Segment,
    SegmentModel,
    SplineSegment,
    TurnSegment,
)
from brachis.task.shapes import ArcCenter, ArcVia, Circle, Helix, LineBy, LineHeading, LineTo, Shape, SplineThrough
from brachis.task.tool_limits import ProcessSpeed, SpeedTable, ToolLimits

__all__ = [
    "FROM_URDF",
    "AlongTangent",
    "ArcCenter",
    "ArcSegment",
    "ArcVia",
    "Attitude",
    "BSplineCurve",
    "BSplineSegment",
    "BoundarySettings",
    "Circle",
    "CircleSegment",
    "CsvSegment",
    "FileUnits",
    "FitReport",
    "FitTolerance",
    "FrictionSettings",
    "Helix",
    "HelixSegment",
    "InertiaMatrix",
    "LimitKeywords",
    "LimitScale",
    "LimitSpec",
    "LimitsFile",
    "LineBy",
    "LineHeading",
    "LineSegment",
    "LineTo",
    "MovingSegment",
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
    "Shape",
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
