"""Tasks of all kinds for `ablation`: the examples, and what the other benchmarks draw.

Their names say what they are: an example's number, or the benchmark's robot and number, and then what is changed. All
are planned in one process, and without a limit on time that would decide.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import brachis
import joint_paths
import mixed_cases
import phases
import random_lines
import scenes
import third_order_plans
from brachis.errors import BrachisError
from brachis.robot.from_task import robot_for
from brachis.task import Task, load_task
from tolerances import RANGES

Changes = Mapping[str, Any]

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = {
    "search.least_motion": False,
    "search.jobs": 1,
    "search.time_limit": 3600.0,
    "solver.time_limit": 3600.0,
}
"""Of all tasks."""
AUTO = {"spline.intervals": "auto"}
VELOCITY = {"spline.intervals": "auto", "spline.rest": "velocity"}
AT_REST = {"spline.rest": "velocity"}
OPEN = {"redundant_joints": "auto"}

FREE = {"start": "free", "path_start": [1.732, 0], **OPEN}
EIGHT = {"robot.limits.torque": 8.0}
EXAMPLES: tuple[tuple[int, str, Changes], ...] = (
    (1, "as it is", {}),
    (1, "auto, velocity", {**VELOCITY, **OPEN}),
    (1, "auto", {**AUTO, **OPEN}),
    (1, "free start", FREE),
    (1, "free start, auto", {**FREE, **VELOCITY}),
    (1, "free knots", {"spline.knots": "free", "spline.intervals": 10}),
    (1, "free knots, open", {"spline.knots": "free", "spline.intervals": 8, **OPEN}),
    (1, "thorough", {**OPEN, "search.effort": "thorough"}),
    (1, "exhaustive", {**OPEN, "search.effort": "exhaustive"}),
    (1, "numeric guesses", {"search.guesses": "numeric"}),
    (1, "60 intervals", {"spline.intervals": 60}),
    (1, "60 intervals, open", {"spline.intervals": 60, **OPEN}),
    (1, "torque rate 20", {"robot.limits.torque_rate": 20.0, **OPEN}),
    (1, "torque rate 60", {"robot.limits.torque_rate": 60.0, **OPEN}),
    (1, "torque rate 300", {"robot.limits.torque_rate": 300.0, **OPEN}),
    (1, "torque rate 60, auto", {"robot.limits.torque_rate": 60.0, **OPEN, **AUTO}),
    (1, "jerk 20", {"robot.limits.jerk": 20.0, **OPEN}),
    (1, "jerk 20, auto", {"robot.limits.jerk": 20.0, **OPEN, **AUTO}),
    (1, "rms 5", {"robot.limits.rms_torque": 5.0, **OPEN}),
    (1, "rms 5, auto", {"robot.limits.rms_torque": 5.0, **OPEN, **AUTO}),
    (3, "as it is", {}),
    (3, "auto", {**VELOCITY, **OPEN}),
    (3, "rms", {"robot.limits.rms_torque": {"joint_2": 60.0}, **OPEN}),
    (3, "torque rate", {"robot.limits.torque_rate": 4000.0, **OPEN}),
    (4, "as it is", {}),
    (4, "open", OPEN),
    (4, "auto", {**VELOCITY, **OPEN}),
    (6, "as it is", {}),
    (6, "auto", {**VELOCITY, **OPEN}),
    (7, "as it is", {}),
    (7, "auto, velocity", VELOCITY),
    (9, "as it is", {}),
    (9, "open", OPEN),
    (9, "auto", AUTO),
    (10, "as it is", {}),
    (10, "auto", AUTO),
    (10, "free start", {"start": "free", "path_start": [1.732, 0]}),
    (11, "as it is", {}),
    (13, "as it is", {}),
    (13, "open", OPEN),
    (13, "auto", AUTO),
    (14, "as it is", {}),
    (15, "as it is", {}),
    (15, "auto", VELOCITY),
    (16, "as it is", {}),
)
"""Numbers of examples, with words and keys for what is changed."""
FROM_MOTIONS: tuple[tuple[int, str, Changes, Changes], ...] = (
    (1, "from 8 Nm", OPEN, EIGHT),
    (1, "from 8 Nm, auto", {**OPEN, **VELOCITY}, EIGHT),
    (3, "from another line", OPEN, {"path": [{"line": {"by": [0, 0.7, 0.05]}}]}),
)
"""The same for plans that start from a motion; the last keys are those of the motion's own task."""
FORCES = (5.0, 50.0, 500.0, 5000.0)
"""Forces of slides, N."""
TOLERANCES = (
    ("panda", 0),
    ("xarm7", 0),
    ("iiwa14", 4),
    ("ur10_rail", 4),
    ("panda", 4),
    ("iiwa14", 7),
    ("tx90l_rail", 7),
)
"""Robots and numbers of those that get tolerances, one kind after the other."""
SCENES = (
    ("scara3", 0),
    ("scara3", 1),
    ("planar4", 0),
    ("planar4", 1),
    ("planar4", 2),
    ("iiwa14", 0),
    ("panda", 0),
    ("tx90l_rail", 1),
)
"""Robots and numbers of scenes."""


@dataclass(frozen=True)
class AblationTask:
    """A task of the ablation.

    Attributes
    ----------
    name : str
    make : callable
        Returns the task, or its content.
    changes : mapping
        Keys of the task that are changed.
    from_changes : mapping
        Where it is not empty the plan starts from the motion of the task with these changes.
    """

    name: str
    make: Callable[[], Any]
    changes: Changes = field(default_factory=dict)
    from_changes: Changes = field(default_factory=dict)

    def load(self) -> Task:
        """Load the task."""
        return load_task(self.make(), changes={**SETTINGS, **self.changes})

    @property
    def motion(self) -> brachis.Trajectory | None:
        """The motion to start from."""
        if not self.from_changes:
            return None
        task = load_task(self.load(), changes=self.from_changes)
        return brachis.plan(task).trajectory


@cache
def folder() -> Path:
    """Return where the files of drawn tasks are kept from one run to the next; they name the URDFs of this clone."""
    name = "-".join(("brachis-ablation", *ROOT.parts[1:]))
    path = Path(tempfile.gettempdir()) / name
    path.mkdir(exist_ok=True)
    return path


def example(number: int) -> Path:
    """Return the file of an example."""
    (path,) = (ROOT / "examples").glob(f"{number:02d}_*.yaml")
    return path


def mixed(robot: str, number: int) -> Path:
    """Return the file of a task of `mixed_cases`."""
    return mixed_cases.case(robot, 0, number, folder()).task


def tolerance(robot: str, number: int, kind: int) -> Task:
    """Return a task of `mixed_cases` whose tool may leave the path within one of the ranges of `tolerances`."""
    return load_task(mixed(robot, number), changes={"tolerances": RANGES[kind]})


def slide(force: float) -> dict[str, Any]:
    """Return a slide of 25 kg over 1 m at no more than 0.5 m/s, by a force, N."""
    task = phases.sliding([{"line": {"by": [1.0]}}], locked=True)
    limits = {"torque": {"x_axis": force}, "velocity": {"x_axis": 0.5}}
    task["robot"]["limits"] = limits
    return {**task, "spline": {}}


def scara_line(number: int) -> dict[str, Any]:
    """Return a task of `random_lines`."""
    urdf = ROOT / "robots/scara3/robot.urdf"
    limits = {"torque": 10.0, "velocity": None}
    robot = brachis.Robot.from_urdf(
        urdf, gravity=[0, 0, 0], limits=brachis.LimitSpec(**limits)
    )
    *_, task = random_lines.random_tasks(robot, 0, number + 1)
    start = {"joints": task["start"]["joints"].tolist()}
    (segment,) = task["path"]
    to = np.array(segment["line"]["to"]).tolist()
    settings = {"urdf": str(urdf), "gravity": [0, 0, 0], "limits": limits}
    path = [{"line": {"to": to}}]
    return {**task, "robot": settings, "start": start, "path": path}


def jerk_path(number: int) -> dict[str, Any]:
    """Return a task of `joint_paths` with limits on the jerk, as `jerk_paths` draws them, which needs copp-py."""
    content = joint_paths.case(number, 60).to_dict()
    rng = np.random.default_rng(number + 10_000)
    acceleration = np.array(content["robot"]["limits"]["acceleration"])
    jerk = acceleration * rng.uniform(10.0, 30.0, len(acceleration))
    content["robot"]["limits"]["jerk"] = jerk.round(1).tolist()
    content["spline"]["rest"] = "full"
    return content


def scene(robot: str, number: int) -> dict[str, Any]:
    """Return a task of `scenes`: the first obstacle stands in the way of the motion without obstacles."""
    path = folder() / f"scene-{robot}-{number}.yaml"
    if path.exists():
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    made = mixed_cases.case(robot, 0, number, folder())
    task = load_task(made.task, changes={**VELOCITY, **SETTINGS})
    rng = np.random.default_rng([0, number, scenes.ROBOTS.index(robot)])
    joints = made.joint_path[:, : robot_for(None, task.robot).n]
    motion = brachis.plan(load_task(task, changes=scenes.QUICK), strict=False)
    q = motion.trajectory.position(np.linspace(0.0, motion.t_end, 60))
    q = q[:, : joints.shape[1]]
    bodies = scenes.draw(rng, task, joints, q, tall=robot in scenes.PLANAR)
    if bodies is None:
        raise BrachisError("no scene could be drawn")
    content = load_task(task, changes={"scene": bodies}).to_dict()
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return content


def iiwa_position(number: int) -> dict[str, Any]:
    """Return a random line of the iiwa's tool, whose orientation is free: four redundant joints."""
    rng = np.random.default_rng([number, 7])
    by = rng.normal(size=3)
    by *= rng.uniform(0.15, 0.4) / np.linalg.norm(by)
    line = {"line": {"by": by.round(3).tolist()}}
    return phases.iiwa("position", [line], spline={})


@cache
def phase_tasks() -> dict[str, dict[str, Any]]:
    """Return the tasks of `phases` by their names."""
    known = {name: content for name, (content, _) in phases.known().items()}
    return {**known, **phases.arms(), **phases.squares(), **phases.refused()}


def in_phases(name: str) -> dict[str, Any]:
    """Return a task of `phases`."""
    return phase_tasks()[name]


def every_task() -> list[AblationTask]:
    """List all tasks, the quick ones of all kinds first."""
    return [*_examples(), *_phases(), *_timings(), *_drawn(), *_hard()]


def _examples() -> list[AblationTask]:
    """List the examples with changes."""
    tasks = []
    for number, words, changes in EXAMPLES:
        name = f"{number:02d} {words}"
        tasks.append(AblationTask(name, partial(example, number), changes))
    for number, words, changes, from_changes in FROM_MOTIONS:
        name = f"{number:02d} {words}"
        make = partial(example, number)
        tasks.append(AblationTask(name, make, changes, from_changes))
    return tasks


def _phases() -> list[AblationTask]:
    """List tasks with stops, dwells and given speeds."""
    quick = ("slide, stop", "slide, dwell", "slide, 0.1 m/s", "gantry, 0.5 m/s")
    names = [*quick, *phases.arms(), *phases.squares(), *phases.refused()]
    is_slow = [any(word in name for word in ("0.02", "0.05")) for name in names]
    pairs = zip(names, is_slow, strict=True)
    return [
        AblationTask(name, partial(in_phases, name)) for name, slow in pairs if not slow
    ]


def _timings() -> list[AblationTask]:
    """List tasks without redundant joints."""
    tasks = []
    for force in FORCES:
        make = partial(slide, force)
        tasks.append(AblationTask(f"slide {force:g} N", make))
        tasks.append(AblationTask(f"slide {force:g} N, velocity", make, AT_REST))
    tasks += [
        AblationTask(f"joint path {number}", partial(joint_paths.case, number, "auto"))
        for number in range(5)
    ]
    make = partial(joint_paths.case, 1, 150)
    tasks.append(AblationTask("joint path 1, 150 intervals", make))
    tasks += [
        AblationTask(f"jerk path {number}", partial(jerk_path, number))
        for number in range(4)
    ]
    tasks.append(AblationTask("jerk path 0, auto", partial(jerk_path, 0), AUTO))
    return tasks


def _drawn() -> list[AblationTask]:
    """List tasks that are drawn at random."""
    tasks = [
        AblationTask(
            f"third order {number}", partial(third_order_plans.task_of, number)
        )
        for number in range(14)
    ]
    tasks += [
        AblationTask(f"scara line {number}", partial(scara_line, number))
        for number in range(8)
    ]
    for robot in mixed_cases.ROBOTS:
        for number in range(6):
            make = partial(mixed, robot, number)
            tasks.append(AblationTask(f"{robot}-{number}", make))
        for number in (1, 3, 5):
            make = partial(mixed, robot, number)
            tasks.append(AblationTask(f"{robot}-{number}, auto", make, VELOCITY))
    return tasks


def _hard() -> list[AblationTask]:
    """List tasks with many redundant joints, tolerances and scenes."""
    tasks = []
    for number in range(3):
        make = partial(iiwa_position, number)
        few = {"spline.intervals": 20}
        tasks.append(AblationTask(f"iiwa position {number}, 20 intervals", make, few))
        tasks.append(AblationTask(f"iiwa position {number}", make))
    for kind, (robot, number) in enumerate(TOLERANCES):
        make = partial(tolerance, robot, number, kind % len(RANGES))
        name = f"tolerance {robot}-{number}"
        tasks.append(AblationTask(name, make, {"spline.intervals": 12}))
    for robot, number in SCENES:
        make = partial(scene, robot, number)
        few = {"spline.intervals": 20}
        tasks.append(AblationTask(f"scene {robot}-{number}", make, few))
    return tasks
