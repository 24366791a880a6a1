"""The search for a faster place: plans at seeded places, then steps against the gradient."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.apps.place.placing import RANGES, Trial, write_change
from brachis.common.progress import Listener
from brachis.errors import BrachisError, InputError, check_names
from brachis.explain.placement import (
    BASE,
    PATH,
    find_obstacle,
    list_movable,
    move_in_task,
    pivot_of,
    transform_about,
)
from brachis.planner import plan, plan_many
from brachis.problem.problem import Problem
from brachis.problem.program import bind_task
from brachis.result import Result
from brachis.robot import Robot
from brachis.robot.from_task import with_settings
from brachis.task import Task, TaskKeywords
from brachis.task.program import PathPart
from brachis.task.settings import FramePlacement

WORKPIECE = "workpiece"
"""Word for the frame of all paths, and name of the frame that is added for paths in the world."""
_QUICK: TaskKeywords = {"effort": "single", "least_motion": False}
"""Settings of all plans but the first and the last one."""
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
            name
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
class PlaceSearch:
    """A search for a faster place.

    Attributes
    ----------
    task : Task
        The task, in which the paths are given in a frame if this frame is moved.
    moved : str
        Name of the frame, or ``base``.
    pivot : (3,) ndarray
        Point about which it is turned, m.
    names : tuple of str
        Coordinates, as in `RANGES`.
    low, high : (c,) ndarray
        Ends of their ranges.
    """

    task: Task
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
        robot: Robot,
        task: Task,
        move: str,
        ranges: Mapping[str, tuple[float, float]],
        report: Listener,
    ) -> PlaceSearch:
        """Open the search."""
        problem = bind_task(robot, task)
        moved = _find_subject(problem, move)
        pivot = pivot_of(problem, moved)
        if moved == PATH:
            moved = WORKPIECE
            while moved in task.frames:
                moved += "_2"
            task = add_workpiece(task, moved)
        low, high = np.array(list(ranges.values()), dtype=float).T
        return cls(task, moved, pivot, tuple(ranges), low, high, report, [])

    @property
    def present(self) -> np.ndarray:
        """The present place as fractions of the ranges, (c,)."""
        return -self.low / (self.high - self.low)

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
        """Plan at the first places, and return those with a verified motion; the plan of the present place is known."""
        self.report(f"planning at {len(places)} other places")
        tasks = [self.task_at(u) for u in places]
        pairs = [
            (with_settings(robot, mounting=task.robot.mounting), task) for task in tasks
        ]
        outcomes = plan_many(pairs, jobs=jobs, progress=False, **_QUICK)
        results = []
        for u, outcome in zip(
            [self.present, *places], [before, *outcomes], strict=True
        ):
            result = self._keep(u, outcome)
            if result is not None:
                results.append((u, result))
        return results

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
        moved = with_settings(robot, mounting=task.robot.mounting)
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
            f"{where}: {'no verified motion' if result is None else f't_E = {t_end:.4f} s'}"
        )
        return result

    def gradient(self, result: Result) -> np.ndarray:
        """Return the derivatives of the end time by the fractions of the ranges, (c,), s; zero if they are unknown."""
        known = {
            entry.figure: entry.derivative
            for entry in result.gradients
            if entry.subject == self.moved
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
