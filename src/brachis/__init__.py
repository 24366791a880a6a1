"""Minimum-time motion of redundant robots along prescribed paths.

    import brachis
    from brachis import Line

    result = brachis.plan("task.yaml")
    result = brachis.plan("scara3", path=Line(by=[0, 1]), start=[0.52, -2.09, 2.09], task_space=["x", "y"])
    result.plot()

Planning           plan, plan_many, transcribe (the nonlinear program itself)
Many plans         sweep, SweepResult: keys of a task varied; place, Placing: workpiece or base moved to a faster place
A path             Line, Arc, Circle, Helix, Spline, joined by +; fit_path, bspline_segment from points and curves
A program          Program: paths, moves between them, approaches, dwells
A scene            Box, Sphere, Cylinder, Capsule, HalfSpace, Mesh: bodies that the robot keeps clear of
A robot            Robot, Robot.with_limits, Robot.with_payload, LimitSpec, read_limits; robots (the included ones)
A task             Task, load_task; examples (the included task files)
Results            Result, Trajectory, Samples, Candidate, FinishedCandidate, Verification, BottleneckReport
Recorded motions   import_motion (from a CSV file); compare (with a plan): Comparison; compare_run: Tracking
Controllers        export, plan_for_controller, verify_run: RunReport; Profile, load_profile, profile_names
Looking at it      Result.plot, plots, report, view, Result.bottleneck, bottleneck, verify_trajectory, export
Errors             errors; BrachisError, InputError, PlanningError, PlausibilityWarning, SlowTimingWarning
Extensions         ik (closed forms), limits, compose (arms on rails), TaskMap, task_map_of

All units are SI: m, rad, kg, s, N, Nm. For details see ``help(brachis.plan)`` and the files in ``docs/``.
"""

# The names are imported when first used, so that ``import brachis`` is quick.
from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from brachis import errors as errors
    from brachis import examples as examples
    from brachis import ik as ik
    from brachis import limits as limits
    from brachis import robots as robots
    from brachis.apps import bottleneck as bottleneck
    from brachis.apps import compose as compose
    from brachis.apps import export as export
    from brachis.apps import plots as plots
    from brachis.apps import report as report
    from brachis.apps.bottleneck import BottleneckReport as BottleneckReport
    from brachis.apps.comparison import Comparison as Comparison
    from brachis.apps.comparison import Tracking as Tracking
    from brachis.apps.comparison import compare as compare
    from brachis.apps.comparison import compare_run as compare_run
    from brachis.apps.controller import Profile as Profile
    from brachis.apps.controller import RunReport as RunReport
    from brachis.apps.controller import load_profile as load_profile
    from brachis.apps.controller import profile_names as profile_names
    from brachis.apps.controller import verify_run as verify_run
    from brachis.apps.controller_plan import plan_for_controller as plan_for_controller
    from brachis.apps.place import Placing as Placing
    from brachis.apps.place import place as place
    from brachis.apps.recording import import_motion as import_motion
    from brachis.apps.sweeps import SweepResult as SweepResult
    from brachis.apps.sweeps import sweep as sweep
    from brachis.apps.view import view as view
    from brachis.errors import BrachisError as BrachisError
    from brachis.errors import InputError as InputError
    from brachis.errors import PlanningError as PlanningError
    from brachis.path import bspline_segment as bspline_segment
    from brachis.planner import plan as plan
    from brachis.planner import plan_many as plan_many
    from brachis.planner import transcribe as transcribe
    from brachis.result import Result as Result
    from brachis.robot import Robot as Robot
    from brachis.robot import TaskMap as TaskMap
    from brachis.robot import task_map_of as task_map_of
    from brachis.robot.plausibility import PlausibilityWarning as PlausibilityWarning
    from brachis.search.stages import Candidate as Candidate
    from brachis.search.stages import FinishedCandidate as FinishedCandidate
    from brachis.task import LimitSpec as LimitSpec
    from brachis.task import Task as Task
    from brachis.task import fit_path as fit_path
    from brachis.task import load_task as load_task
    from brachis.task import read_limits as read_limits
    from brachis.task.bodies import Box as Box
    from brachis.task.bodies import Capsule as Capsule
    from brachis.task.bodies import Cylinder as Cylinder
    from brachis.task.bodies import HalfSpace as HalfSpace
    from brachis.task.bodies import Mesh as Mesh
    from brachis.task.bodies import Sphere as Sphere
    from brachis.task.constructors import Arc as Arc
    from brachis.task.constructors import Circle as Circle
    from brachis.task.constructors import Helix as Helix
    from brachis.task.constructors import Line as Line
    from brachis.task.constructors import Spline as Spline
    from brachis.task.program import Program as Program
    from brachis.timing import SlowTimingWarning as SlowTimingWarning
    from brachis.trajectory import Samples as Samples
    from brachis.trajectory import Trajectory as Trajectory
    from brachis.verify import Verification as Verification
    from brachis.verify import verify_trajectory as verify_trajectory

__version__ = "0.1.0"

_MODULES = {
    "bottleneck": "apps.bottleneck",
    "compose": "apps.compose",
    "errors": "errors",
    "examples": "examples",
    "export": "apps.export",
    "ik": "ik",
    "limits": "limits",
    "plots": "apps.plots",
    "report": "apps.report",
    "robots": "robots",
}
_NAMES = {
    "apps.bottleneck": "BottleneckReport",
    "apps.comparison": "Comparison Tracking compare compare_run",
    "apps.controller": "Profile RunReport load_profile profile_names verify_run",
    "apps.controller_plan": "plan_for_controller",
    "apps.place": "Placing place",
    "apps.recording": "import_motion",
    "apps.sweeps": "SweepResult sweep",
    "apps.view": "view",
    "errors": "BrachisError InputError PlanningError",
    "search.stages": "Candidate FinishedCandidate",
    "path": "bspline_segment",
    "planner": "plan plan_many transcribe",
    "result": "Result",
    "robot": "Robot TaskMap task_map_of",
    "robot.plausibility": "PlausibilityWarning",
    "timing": "SlowTimingWarning",
    "task": "LimitSpec Task fit_path load_task read_limits",
    "task.bodies": "Box Capsule Cylinder HalfSpace Mesh Sphere",
    "task.constructors": "Arc Circle Helix Line Spline",
    "task.program": "Program",
    "trajectory": "Samples Trajectory",
    "verify": "Verification verify_trajectory",
}
"""The public names of each module."""
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = ["__version__", *_MODULES, *_HOME]  # noqa: PLE0604  (names)


def __getattr__(name: str) -> object:
    """Import a public name when it is first used."""
    if name in _MODULES:
        return importlib.import_module(f"brachis.{_MODULES[name]}")
    if name in _HOME:
        return getattr(importlib.import_module(f"brachis.{_HOME[name]}"), name)
    from brachis.errors import suggest

    hint = None if name.startswith("_") else suggest(name, __all__, is_attribute=True)
    message = f"module 'brachis' has no attribute {name!r}"
    raise AttributeError(f"{message}. {hint}" if hint else message)


def __dir__() -> list[str]:
    """List the names for completion."""
    return list(__all__)
