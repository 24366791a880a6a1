"""Moves a workpiece or the base, within ranges, to where the motion is faster.

The end time jumps where another branch or another way round an obstacle becomes the best, and it falls smoothly between
the jumps. So plans at seeded places find good regions. From the best of them, steps against the gradient follow, which
comes from the multipliers of each plan. A step that gives no faster motion is shortened. Each step starts from the
motion before it, so that it stays in its region.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np
import yaml

from brachis.common.arguments import count
from brachis.common.progress import Listener, report_progress
from brachis.common.summary import Summary
from brachis.errors import BrachisError, InputError, check_names
from brachis.explain.placement import (
    BASE,
    COORDINATES,
    PATH,
    find_obstacle,
    list_movable,
    move_in_task,
    pivot_of,
    transform_about,
)
from brachis.planner import plan, plan_many, read_arguments
from brachis.problem.problem import Problem
from brachis.problem.program import bind_task
from brachis.result import Result
from brachis.robot import Robot
from brachis.task import Source, Task, TaskKeywords
from brachis.task.program import PathPart
from brachis.task.settings import FramePlacement

WORKPIECE = "workpiece"
"""Word for the frame of all paths, and name of the frame that is added for paths in the world."""
RANGES = {
    name if unit == "m" else f"{name}_deg": (
        name,
        1.0 if unit == "m" else np.pi / 180.0,
    )
    for name, unit in COORDINATES.items()
}
"""Coordinates for which the user gives ranges: the coordinate of a placement, and its factor to m or rad."""
_QUICK: TaskKeywords = {"effort": "single", "least_motion": False}
"""Settings of all plans but the first and the last one."""
_DESCENTS = 2
"""Number of places from which steps are taken."""
_FIRST_RADIUS = 0.25
"""Length of the first step, as a fraction of the ranges."""
_LONGEST_RADIUS = 0.5
"""Length of the longest step, as a fraction of the ranges."""
_SHORTEST_RADIUS = 0.01
"""Length below which no step is taken, as a fraction of the ranges."""
_SHORTER = 0.4
_LONGER = 2.0
"""Factors on the length of the next step after a step that gave no faster motion, and after a good one."""
_GOOD = 0.5
"""Fraction of the predicted gain from which a step counts as good."""
_LEAST_GAIN = 1e-3
"""Fraction of the end time that a step must gain; plans of the same task differ by as much."""


@dataclass(frozen=True)
class Trial:
    """A place that was tried.

    Attributes
    ----------
    change : dict of str to float
        Change of the placement, m and degrees, by the names in `RANGES`.
    t_end : float
        End time, s; infinite without a verified motion.
    """

    change: dict[str, float]
    t_end: float


@dataclass(frozen=True, repr=False)
class Placing(Summary):
    """A faster place for a workpiece or the base.

    Attributes
    ----------
    moved : str
        Name of the frame, or ``base``.
    change : dict of str to float
        How the placement changed, m and degrees, along and about the axes of the world.
    task : Task
        The changed task.
    before, after : Result
        Plans of the task as it was, and of the changed task.
    trials : tuple of Trial
        All places that were tried, in their order.
    """

    moved: str
    change: dict[str, float]
    task: Task
    before: Result
    after: Result
    trials: tuple[Trial, ...]

    @property
    def gain(self) -> float:
        """Fraction of the end time that the change saves."""
        return 1.0 - self.after.t_end / self.before.t_end

    def summary(self) -> Mapping[str, object]:
        """Return the entries that are shown to the user."""
        return {
            "moved": self.moved,
            "by": write_change(self.change) or "nothing",
            "end time before": f"{self.before.t_end:.4f} s",
            "end time after": f"{self.after.t_end:.4f} s",
            "gain": f"{100.0 * self.gain:.1f} %",
            "places tried": len(self.trials),
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "moved": self.moved,
            "change": self.change,
            "t_end_before": self.before.t_end,
            "t_end": self.after.t_end,
            "gain": self.gain,
            "verified": self.after.verified,
            "trials": [
                {"change": trial.change, "t_end": trial.t_end}
                for trial in self.trials
                if np.isfinite(trial.t_end)
            ],
        }


def write_task(task: Task) -> str:
    """Write a task as YAML, without the keys that have their defaults."""
    content = task.model_dump(mode="json", exclude_defaults=True)
    return yaml.safe_dump({"brachis": task.brachis, **content}, sort_keys=False)


def write_change(change: Mapping[str, float]) -> str:
    """Write a change of a placement with units; coordinates that stay are left out."""
    return ", ".join(
        f"{name.removesuffix('_deg')} {value:+.4g} {'deg' if name.endswith('_deg') else 'm'}"
        for name, value in change.items()
        if value
    )


def read_range(text: str) -> tuple[str, tuple[float, float]]:
    """Read a range such as ``x=-0.2,0.2``.

    Raises
    ------
    InputError
    """
    name, _, ends = text.partition("=")
    try:
        low, high = map(float, ends.split(","))
    except ValueError:
        raise InputError(
            "this is not a range",
            where="--range",
            found=text,
            allowed="NAME=FROM,TO, such as x=-0.2,0.2",
        ) from None
    return name, (low, high)


def place(
    robot_or_task: Source | Robot | None = None,
    /,
    task: Source | None = None,
    *,
    move: str = WORKPIECE,
    ranges: Mapping[str, tuple[float, float]],
    starts: int = 4,
    steps: int = 8,
    jobs: int = 1,
    listener: Listener | None = None,
    progress: bool | None = None,
    **keywords: Unpack[TaskKeywords],
) -> Placing:
    """Move a workpiece or the base to where the motion is faster.

    Parameters
    ----------
    robot_or_task, task, **keywords
        As for `brachis.plan`.
    move : str, optional
        Name of a frame of the task, ``base``, or ``workpiece`` for the frame of all paths. Bodies of the scene that are
        placed in the frame move with it. If the paths are given in the world, a frame is added to the task.
    ranges : mapping of str to (float, float)
        Smallest and largest change of each coordinate: ``x``, ``y`` and ``z`` along the axes of the world, m;
        ``roll_deg``, ``pitch_deg`` and ``yaw_deg`` about them, degrees. Other coordinates stay.
    starts : int, optional
        Number of places that are tried first, the present one included.
    steps : int, optional
        Maximum number of steps from each of the best two places.
    jobs : int, optional
        Number of processes for the first places.
    listener, progress
        As for `brachis.plan`.

    Returns
    -------
    Placing

    Raises
    ------
    InputError
        The task or a range is wrong, or a given posture holds the path in its place.
    PlanningError
        The task as it is has no plan.

    Examples
    --------
    >>> import brachis
    >>> placing = brachis.place(
    ...     "scara3",
    ...     start="free",
    ...     path_start=[1.5, -0.3],
    ...     path=brachis.Line(by=[0.0, 0.6]),
    ...     task_space=["x", "y"],
    ...     ranges={"x": (-0.2, 0.2)},
    ...     starts=1,
    ...     steps=1,
    ... )
    >>> placing.after.t_end <= placing.before.t_end
    True
    """
    _check_ranges(ranges)
    with report_progress(listener, progress) as report:
        robot, loaded = read_arguments(robot_or_task, task, keywords)
        problem = bind_task(robot, loaded)
        search = _Search.of(problem, loaded, move, ranges, report)
        report("planning the task as it is")
        before = plan(robot, loaded, listener=listener, progress=False)
        start_places = [search.present]
        if starts > 1:
            from scipy.stats import qmc

            sampler = qmc.Halton(len(ranges), seed=loaded.search.seed)
            start_places += list(sampler.random(count(starts, "starts") - 1))
        candidates = search.plan_starts(robot, start_places, before, jobs)
        candidates = sorted(candidates, key=lambda candidate: candidate[1].t_end)
        best = (search.present, before)
        for candidate in candidates[:_DESCENTS]:
            found = search.descend(robot, *candidate, steps)
            best = min(best, found, key=lambda pair: pair[1].t_end)
        place_found, after = best
        if after is not before:
            report("planning the task at the best place")
            after = _faster(after, search.plan_at(robot, place_found, is_final=True))
    return Placing(
        moved=search.moved,
        change=search.change_at(place_found),
        task=search.task_at(place_found),
        before=before,
        after=after,
        trials=tuple(search.trials),
    )


def _faster(first: Result, second: Result | None) -> Result:
    """Return the faster of two results; the second one may be missing."""
    return first if second is None or first.t_end <= second.t_end else second


def _check_ranges(ranges: Mapping[str, tuple[float, float]]) -> None:
    """Refuse unknown coordinates, and ranges without a width."""
    check_names("coordinate", ranges, RANGES, "ranges")
    if not ranges:
        raise InputError(
            "no range is given, so nothing can be moved",
            where="ranges",
            allowed="a range for at least one coordinate, such as x: (-0.2, 0.2)",
        )
    for name, pair in ranges.items():
        values = np.array(pair, dtype=float)
        if values.shape != (2,) or not np.isfinite(values).all() or np.ptp(values) <= 0:
            raise InputError(
                "this is not a range",
                where=f"ranges.{name}",
                found=pair,
                allowed="a smaller and a larger number, such as (-0.2, 0.2)",
            )


def add_workpiece(task: Task, name: str) -> Task:
    """Return the task with all paths in the world given in a new frame at the world's origin."""
    program = tuple(
        part.model_copy(update={"path_frame": name})
        if isinstance(part, PathPart) and part.path_frame is None
        else part
        for part in task.program
    )
    changes: dict[str, Any] = {
        "frames": {**task.frames, name: FramePlacement()},
        "program": program,
    }
    if task.path and task.path_frame is None:
        changes["path_frame"] = name
    return task.model_copy(update=changes)


def _find_subject(problem: Problem, move: str) -> str:
    """Return the name of what is moved, as in `list_movable`.

    Raises
    ------
    InputError
        It does not exist; the paths have several frames; or a given posture holds the path in its place.
    """
    movable = list_movable(problem)
    subject = move
    if move == WORKPIECE and move not in movable:
        frames = problem.task.frames
        outer = [
            PATH if name == PATH else name
            for name in movable
            if name != BASE and (name == PATH or frames[name].frame is None)
        ]
        if len(outer) != 1:
            raise InputError(
                "the paths have several frames"
                if outer
                else "there is no path of a tool",
                where="move",
                found=", ".join(outer),
                allowed="the name of a frame, or base",
            )
        subject = outer[0]
    check_names("frame", [subject], movable, "move")
    obstacle = find_obstacle(problem, subject)
    if obstacle:
        raise InputError(
            f"{move} cannot be moved: {obstacle}",
            where="move",
            found="a start or end posture of a path",
            allowed="start: free and path_start, or moves between the posture and the path",
        )
    return subject


@dataclass(frozen=True, eq=False)
class _Search:
    """A search for a faster place.

    Attributes
    ----------
    task : Task
        The task, in which the paths are given in a frame if this frame is moved.
    subject : str
        What the gradients call the thing that is moved.
    moved : str
        What the task calls it.
    pivot : (3,) ndarray
        Point about which it is turned, m.
    names : tuple of str
        Coordinates, as in `RANGES`.
    low, high : (c,) ndarray
        Ends of their ranges.
    """

    task: Task
    subject: str
    moved: str
    pivot: np.ndarray
    names: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    report: Listener
    trials: list[Trial]

    @classmethod
    def of(
        cls,
        problem: Problem,
        task: Task,
        move: str,
        ranges: Mapping[str, tuple[float, float]],
        report: Listener,
    ) -> _Search:
        """Open the search."""
        subject = _find_subject(problem, move)
        moved = subject
        if subject == PATH:
            moved = WORKPIECE
            task = add_workpiece(task, moved)
        low, high = np.array(list(ranges.values()), dtype=float).T
        pivot = pivot_of(problem, subject)
        return cls(task, subject, moved, pivot, tuple(ranges), low, high, report, [])

    @property
    def present(self) -> np.ndarray:
        """The present place, or the nearest one within the ranges, as fractions of the ranges, (c,)."""
        return ((0.0 - self.low) / (self.high - self.low)).clip(0.0, 1.0)

    def change_at(self, u: np.ndarray) -> dict[str, float]:
        """Return the change of the placement at fractions of the ranges, (c,), m and degrees."""
        values = (self.low + u * (self.high - self.low)).round(6)
        return dict(zip(self.names, values.tolist(), strict=True))

    def task_at(self, u: np.ndarray) -> Task:
        """Return the task at a place."""
        change = {
            RANGES[name][0]: RANGES[name][1] * value
            for name, value in self.change_at(u).items()
        }
        transform = transform_about(change, self.pivot)
        return move_in_task(self.task, self.moved, transform)

    def plan_starts(
        self,
        robot: Robot,
        places: list[np.ndarray],
        before: Result,
        jobs: int,
    ) -> list[tuple[np.ndarray, Result]]:
        """Plan at the first places, and return those with a verified motion."""
        found = []
        if not any(self.change_at(places[0]).values()):
            found.append((places[0], before))
            self.trials.append(Trial(self.change_at(places[0]), before.t_end))
            places = places[1:]
        self.report(f"planning at {len(places)} other places")
        tasks = [self.task_at(u) for u in places]
        robots = [_robot_at(robot, task) for task in tasks]
        pairs = list(zip(robots, tasks, strict=True))
        outcomes = plan_many(pairs, jobs=jobs, progress=False, **_QUICK)
        for u, outcome in zip(places, outcomes, strict=True):
            result = self._keep(u, outcome)
            if result is not None:
                found.append((u, result))
        return found

    def plan_at(
        self,
        robot: Robot,
        u: np.ndarray,
        known: Result | None = None,
        *,
        is_final: bool = False,
    ) -> Result | None:
        """Plan at a place, from a known motion; None without a verified motion. The final plan is not a quick one."""
        task = self.task_at(u)
        moved = _robot_at(robot, task)
        try:
            outcome: Result | BrachisError = plan(
                moved,
                task,
                start_from=known,
                progress=False,
                check_advice=False,
                **({} if is_final else _QUICK),
            )
        except BrachisError as error:
            outcome = error
        return self._keep(u, outcome)

    def _keep(self, u: np.ndarray, outcome: Result | BrachisError) -> Result | None:
        """Note what came of a plan, and return its result if it is verified."""
        result = outcome if isinstance(outcome, Result) and outcome.verified else None
        t_end = np.inf if result is None else result.t_end
        change = self.change_at(u)
        self.trials.append(Trial(change, t_end))
        where = write_change(change) or "the present place"
        self.report(
            f"{where}: {'no motion' if result is None else f't_E = {t_end:.4f} s'}"
        )
        return result

    def gradient(self, result: Result) -> np.ndarray:
        """Return the derivatives of the end time by the fractions of the ranges, (c,), s; zero if they are unknown."""
        known = {
            entry.figure: entry.derivative
            for entry in result.sensitivities.gradients
            if entry.subject in (self.subject, self.moved)
        }
        derivatives = [
            RANGES[name][1] * (known.get(RANGES[name][0]) or 0.0) for name in self.names
        ]
        return np.array(derivatives) * (self.high - self.low)

    def descend(
        self, robot: Robot, u: np.ndarray, result: Result, steps: int
    ) -> tuple[np.ndarray, Result]:
        """Take steps against the gradient while they give a faster motion."""
        radius = _FIRST_RADIUS
        gradient = self.gradient(result)
        for _ in range(steps):
            # A coordinate at an end of its range does not move beyond it.
            is_held = ((u <= 0.0) & (gradient > 0.0)) | ((u >= 1.0) & (gradient < 0.0))
            direction = np.where(is_held, 0.0, -gradient)
            size = float(np.linalg.norm(direction))
            if radius < _SHORTEST_RADIUS or radius * size < _LEAST_GAIN * result.t_end:
                break
            trial_place = (u + radius * direction / size).clip(0.0, 1.0)
            predicted = -float(gradient @ (trial_place - u))
            trial = self.plan_at(robot, trial_place, result)
            gain = -np.inf if trial is None else result.t_end - trial.t_end
            if trial is None or gain < _LEAST_GAIN * result.t_end:
                radius *= _SHORTER
                continue
            if gain > _GOOD * predicted:
                radius = min(radius * _LONGER, _LONGEST_RADIUS)
            u = trial_place
            result = trial
            gradient = self.gradient(result)
        return u, result


def _robot_at(robot: Robot, task: Task) -> Robot:
    """Return the robot with the mounting of a task."""
    if robot.settings.mounting == task.robot.mounting:
        return robot
    settings = robot.settings.model_copy(update={"mounting": task.robot.mounting})
    moved = Robot.from_settings(settings, robot.source, robot.urdf)
    return replace(moved, limits=robot.limits, friction=robot.friction)
