"""What is asked: the task file as frozen models, its loader and its schema. No numerics."""

from brachis.task.load import check_robot_settings, load_task
from brachis.task.models import (
    Posture,
    RefinementSettings,
    SolverSettings,
    SplineSettings,
    Task,
)
from brachis.task.robot_models import FROM_URDF, FrictionSettings, LimitScale, LimitSettings, RobotSettings
from brachis.task.schema import json_schema
from brachis.task.segments import (
    ArcCenter,
    ArcSegment,
    ArcVia,
    Circle,
    CircleSegment,
    LineBy,
    LineHeading,
    LineSegment,
    LineTo,
    Segment,
    SegmentModel,
    Shape,
    SplineSegment,
    SplineThrough,
)

__all__ = [
    "FROM_URDF",
    "ArcCenter",
    "ArcSegment",
    "ArcVia",
    "Circle",
    "CircleSegment",
    "FrictionSettings",
    "LimitScale",
    "LimitSettings",
    "LineBy",
    "LineHeading",
    "LineSegment",
    "LineTo",
    "Posture",
    "RefinementSettings",
    "RobotSettings",
    "Segment",
    "SegmentModel",
    "Shape",
    "SolverSettings",
    "SplineSegment",
    "SplineSettings",
    "SplineThrough",
    "Task",
    "check_robot_settings",
    "json_schema",
    "load_task",
]
