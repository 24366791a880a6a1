"""Minimum-time motion of redundant robots along prescribed paths.

The names below are the public interface; they are imported when first used, so that ``import brachis`` is quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from brachis import bottleneck as bottleneck
    from brachis import compose as compose
    from brachis.attempt import Attempt as Attempt
    from brachis.bottleneck import BottleneckReport as BottleneckReport
    from brachis.errors import BrachisError as BrachisError
    from brachis.errors import InputError as InputError
    from brachis.errors import PlanningError as PlanningError
    from brachis.path import bspline_segment as bspline_segment
    from brachis.planner import plan as plan
    from brachis.planner import transcribe as transcribe
    from brachis.plausibility import PlausibilityWarning as PlausibilityWarning
    from brachis.result import Result as Result
    from brachis.robot import Robot as Robot
    from brachis.robot import TaskMap as TaskMap
    from brachis.robot import task_map_of as task_map_of
    from brachis.sweeps import SweepResult as SweepResult
    from brachis.sweeps import sweep as sweep
    from brachis.task import LimitSpec as LimitSpec
    from brachis.task import Task as Task
    from brachis.task import fit_path as fit_path
    from brachis.task import load_task as load_task
    from brachis.task import read_limits as read_limits
    from brachis.trajectory import Trajectory as Trajectory
    from brachis.verify import Verification as Verification
    from brachis.verify import verify_trajectory as verify_trajectory

__version__ = "0.1.0"

_STAGES = ("bottleneck", "compose")
_HOME = {
    "BottleneckReport": "brachis.bottleneck",
    "BrachisError": "brachis.errors",
    "Attempt": "brachis.attempt",
    "InputError": "brachis.errors",
    "LimitSpec": "brachis.task",
    "PlanningError": "brachis.errors",
    "PlausibilityWarning": "brachis.plausibility",
    "Result": "brachis.result",
    "Robot": "brachis.robot",
    "SweepResult": "brachis.sweeps",
    "Task": "brachis.task",
    "TaskMap": "brachis.robot",
    "Trajectory": "brachis.trajectory",
    "Verification": "brachis.verify",
    "bspline_segment": "brachis.path",
    "fit_path": "brachis.task",
    "load_task": "brachis.task",
    "plan": "brachis.planner",
    "read_limits": "brachis.task",
    "sweep": "brachis.sweeps",
    "task_map_of": "brachis.robot",
    "transcribe": "brachis.planner",
    "verify_trajectory": "brachis.verify",
}

__all__ = [
    "Attempt",
    "BottleneckReport",
    "BrachisError",
    "InputError",
    "LimitSpec",
    "PlanningError",
    "PlausibilityWarning",
    "Result",
    "Robot",
    "SweepResult",
    "Task",
    "TaskMap",
    "Trajectory",
    "Verification",
    "__version__",
    "bottleneck",
    "bspline_segment",
    "compose",
    "fit_path",
    "load_task",
    "plan",
    "read_limits",
    "sweep",
    "task_map_of",
    "transcribe",
    "verify_trajectory",
]


def __getattr__(name: str) -> object:
    """Import a public name when it is first used."""
    if name in _STAGES:
        return importlib.import_module(f"brachis.{name}")
    if name not in _HOME:
        message = f"module 'brachis' has no attribute {name!r}"
        raise AttributeError(message)
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    """Names for completion."""
    return list(__all__)
