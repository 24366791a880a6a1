"""Reading a sweep file, listing its plans, and running a plan.

A plan is recognised by all the data that decide its outcome.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import brachis
from brachis import planner
from brachis.apps.sweeps.settings import SweepSettings
from brachis.common.files import Kind, check_kind, file_name, read_text
from brachis.errors import (
    BrachisError,
    BrachisWarning,
    ClusterError,
    TaskError,
    UnknownNameError,
)
from brachis.problem.problem import Problem
from brachis.robot import Robot
from brachis.robot.from_task import robot_from_settings
from brachis.robot.urdf import read_file
from brachis.task import Task, with_keys
from brachis.task.load import LARGEST_TASK, task_from
from brachis.task.messages import show, validate
from brachis.task.yaml_reader import read_yaml


@dataclass(frozen=True, eq=False)
class Plan:
    """A plan as it is sent to a worker, which then needs no files.

    Attributes
    ----------
    digest : str
        Hash of all other attributes, 16 hexadecimal digits. Equal plans are run only once.
    task : Task
        Task, with the content of all its files.
    urdf : str
        Text of the robot's URDF.
    version : str
        Version of brachis that is to run the plan.
    """

    digest: str
    task: Task
    urdf: str
    version: str


VERIFIED = "verified"
UNVERIFIED = "unverified"
FAILED = "failed"


@dataclass(frozen=True)
class PlanOutcome:
    """The outcome of a plan.

    Attributes
    ----------
    facts : dict
        Values of `brachis.apps.sweeps.result.COLUMNS`. Missing values are null.
    motion : bytes or None
        The saved trajectory, an npz archive.
    """

    facts: dict[str, Any]
    motion: bytes | None = None

    @classmethod
    def of_error(
        cls, error: BaseException, wall_time: float | None = None, *, message: str = ""
    ) -> PlanOutcome:
        """Return the outcome of a failed plan, with the error's message unless a different one is given."""
        kind = type(error).__name__
        facts = {
            "status": FAILED,
            "error": kind,
            "message": message or str(error) or kind,
            "wall_time_s": wall_time,
        }
        return cls(facts)


SweepRow = tuple[Mapping[str, Any], Plan | BrachisError]
"""One row of the sweep's table: the values of the varied keys, and the plan, or an error if the task is invalid."""


@dataclass(frozen=True)
class SweepPlan:
    """A sweep that has been read but not run.

    Attributes
    ----------
    settings : SweepSettings
    base : mapping
        Content of the task, which has not been checked yet.
    rows : tuple of SweepRow
    """

    settings: SweepSettings
    base: Mapping[str, Any]
    rows: tuple[SweepRow, ...]


def load_sweep(source: str | os.PathLike[str] | Mapping[str, Any]) -> SweepPlan:
    """Read a sweep, make its tasks, and check its keys.

    Parameters
    ----------
    source : path or mapping
        Sweep file, or its content. In a mapping, ``task`` may be a `Task`.

    Returns
    -------
    SweepPlan

    Raises
    ------
    TaskError
        The sweep or its task is invalid, or a key causes an error in all plans that set it. If only some values of a
        key cause errors, their plans become rows with the error.
    """
    content: object = source
    name = "sweep"
    folder = Path.cwd()
    if not isinstance(source, Mapping):
        path = file_name(source, "source")
        check_kind(path, Kind.SWEEP, TaskError)
        content = _read(path, folder)
        name = str(path)
        folder = path.absolute().parent
    elif isinstance(source.get("task"), Task):
        content = {**source, "task": source["task"].to_dict()}
    settings = validate(SweepSettings, content, name)
    base: object = settings.task
    task_name = f"{name}: task"
    if isinstance(base, str):
        path = folder / base
        base = _read(path, folder)
        task_name = str(path)
        folder = path.parent
    if not isinstance(base, Mapping):
        raise TaskError(
            "the task is not a mapping of keys", found=show(base), where=task_name
        )
    base = with_keys(base, settings.fixed)
    rows = tuple(
        (changes, _plan(base, changes, task_name, folder))
        for changes in settings.changes()
    )
    _check_keys(settings, rows, name)
    return SweepPlan(settings, base, rows)


def _read(path: Path, folder: Path) -> object:
    text = read_text(path, where=str(path), folder=folder, largest=LARGEST_TASK)
    return read_yaml(text, str(path))


def _plan(
    base: Mapping[str, Any], changes: Mapping[str, Any], name: str, folder: Path
) -> Plan | BrachisError:
    try:
        task = task_from(with_keys(base, changes), name, folder, {})
        if task.robot.urdf is None:
            raise TaskError(
                "the robot is missing",
                where=f"{name}: robot.urdf",
                hint="Set this key to the path of the URDF",
            )
        urdf = read_file(Path(task.robot.urdf))
    except BrachisError as error:
        return error
    # Plans already run in parallel, and the number of processes must not change the digest.
    search = task.search.model_copy(update={"jobs": 1})
    task = task.model_copy(update={"search": search})
    known = task.to_dict()
    # Only the text of the URDF matters, not its location.
    known["robot"].pop("urdf", None)
    said = json.dumps([known, urdf, brachis.__version__], sort_keys=True)
    digest = hashlib.sha256(said.encode()).hexdigest()[:16]
    return Plan(digest, task, urdf, brachis.__version__)


def _check_keys(settings: SweepSettings, rows: Sequence[SweepRow], name: str) -> None:
    """Raise an error for keys that are wrong in every task, and for names that the robot does not have.

    Raises
    ------
    TaskError
    """

    @cache
    def find_error(plan: Plan | BrachisError) -> BrachisError | None:
        """Return the error of a task that is invalid or contains an unknown name."""
        if isinstance(plan, BrachisError):
            return plan
        try:
            Problem.of(robot_of(plan), plan.task)
        except UnknownNameError as error:
            return error
        except BrachisError:  # other values of the same key may be valid
            return None
        return None

    refused = {}
    for key in settings.keys or ("task",):
        plans = [plan for changes, plan in rows if key in changes or not changes]
        plans.sort(key=lambda plan: isinstance(plan, BrachisError))
        if all(map(find_error, plans)):
            refused[key] = (
                f"an error in every plan that sets this key ({len(plans)}); the first: {find_error(plans[0])}"
            )
    if refused:
        # A single wrong key makes the plans of all other keys fail as well.
        named = [key for key, text in refused.items() if key in text]
        key = (named or [*refused])[0]
        raise TaskError(refused[key], where=f"{name}: {key}")


def robot_of(plan: Plan) -> Robot:
    """Create the robot of a plan without reading a file."""
    return robot_from_settings(plan.task.robot, urdf_text=plan.urdf)


def run_plan(plan: Plan) -> PlanOutcome:
    """Run a plan. Workers call this function.

    Raises
    ------
    ClusterError
        This process has a different version of brachis than the process that runs the sweep.
    """
    if plan.version != brachis.__version__:
        raise ClusterError(
            "a worker has a different version of brachis",
            found=brachis.__version__,
            allowed=plan.version,
            hint="Install the same version for all workers",
        )
    began = time.perf_counter()
    try:
        with warnings.catch_warnings():  # warnings are among the remarks of the outcome
            warnings.simplefilter("ignore", BrachisWarning)
            result = planner.plan(
                robot_of(plan), plan.task, progress=False, check_advice=False
            )
        wall_time = time.perf_counter() - began
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "motion.npz"
            result.save(path)
            motion = path.read_bytes()
    except Exception as error:  # noqa: BLE001  (a failure of one plan among thousands must not end the others)
        return PlanOutcome.of_error(error, time.perf_counter() - began)
    remarks = [str(warning) for warning in result.warnings]
    remarks += [f"not completed: {step}" for step in result.not_completed]
    facts = {
        "status": VERIFIED if result.verified else UNVERIFIED,
        "t_end_s": result.t_end,
        "worst_ratio": result.verification.worst_ratio,
        "path_error": result.verification.path_error,
        "chosen_joints": ", ".join(result.trajectory.redundant_joints),
        "chosen_branch": result.trajectory.branch,
        "chosen_solver": result.solver_report.solver,
        "iterations": sum(report.iterations for report in result.candidate.reports),
        "wall_time_s": wall_time,
        "remarks": "; ".join(remarks) or None,
    }
    return PlanOutcome(facts, motion)
