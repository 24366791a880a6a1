"""The cost of figures of the task that are not bounds of rows in a program: process speeds and blends.

At an optimum the Lagrangian L = t_E - sum w_i p_i does not change to first order with the free variables. So dt_E is
the change of L if such a figure changes and the free variables stay the same. Durations that follow from a given speed
change with that speed. If the joint path follows from the path of the tool and only its timing is optimal, dt_E is the
change of the least time along it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np

from brachis.common.labels import Label
from brachis.errors import InputError, UnreachableError
from brachis.explain.multipliers import Multipliers
from brachis.explain.sensitivities import label_of_speed
from brachis.explain.timings import FINE_PLACES, lay_course, least_time
from brachis.limits import LIMIT_BUILDERS, Limit, build_limits, limits_of
from brachis.limits.tool import PROCESS_SPEED
from brachis.optimise.boundary import Boundary
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program, is_safeguard
from brachis.optimise.transcription import boundary_of
from brachis.path import (
    legs_of,
    path_of,
    time_law_of,
    with_feed_rates,
    with_held_speeds,
)
from brachis.problem.problem import Problem
from brachis.task import Task
from brachis.task.segments import BSplineSegment
from brachis.trajectory.sensitivities import Sensitivity

STEP_OF_TIMING = 1e-2
"""Fraction by which figures are changed in timings; the stations of a timing cause an error of about 1e-6 of its
time."""
PROCESS_SPEED_KEY = "tool_limits.process_speed"
"""Key of the task that lists the process speeds that are not given by segments."""


class Lagrangian:
    """The Lagrangian of a program at its solution, as a function of a program with as many phases and limits.

    It has only the rows of limits and links, because the other rows change if the tool moves at an end of the path.

    Parameters
    ----------
    program : Program
    multipliers : Multipliers

    Attributes
    ----------
    limits : dict of Limit to None
        The limits with active rows. The others are left out, because distances between bodies take long to compute.
    """

    def __init__(self, program: Program, multipliers: Multipliers) -> None:
        active = multipliers.active_set
        of_rows = multipliers.weights[: len(active.rows)]
        weights = np.zeros(len(program.lower))
        np.add.at(weights, active.rows, active.signs * of_rows)
        self.limits = dict.fromkeys(
            limit for limit in program.limits if weights[program.rows_of(limit)].any()
        )
        self._phases = program.phases
        self._weights = weights[self._find_rows(program, self.limits)]

    def _find_rows(self, program: Program, limits: Iterable[Limit]) -> np.ndarray:
        """Return the numbers of the rows of limits and of all links."""
        of_limits = [program.rows_of(limit).ravel() for limit in limits]
        end = len(program.lower) - len(program.means)
        of_links = np.arange(end - sum(link.size for link in program.links), end)
        return np.concatenate([*of_limits, of_links])

    def __call__(self, program: Program, x: np.ndarray) -> float:
        """Return the Lagrangian of a program at x, (v,), s."""
        phases = []
        for phase, before in zip(program.phases, self._phases, strict=True):
            pairs = zip(phase.limits, before.limits, strict=True)
            limits = [limit for limit, known in pairs if known in self.limits]
            phases.append(phase.with_limits(limits))
        program = program.with_phases(phases)
        rows = program.rows(x)[self._find_rows(program, program.limits)]
        return program.end_time(x) - float(self._weights @ rows)


class LeastTime:
    """The least time along the joint paths of a point.

    Attributes
    ----------
    limits : dict of Limit to None
        The limits that a longer time relieves.
    """

    def __init__(self, program: Program) -> None:
        self.limits = dict.fromkeys(
            limit for limit in program.limits if limit.longer_time == "relieves"
        )

    def __call__(self, program: Program, x: np.ndarray) -> float:
        """Return the least time, s, at x, (v,); NaN if the speed of a phase is given."""
        return sum(
            least_time(lay_course(*pair, FINE_PLACES)) for pair in program.split(x)
        )


@dataclass(frozen=True, eq=False)
class OptimalMotion:
    """A solution, and how t_E changes with the problem.

    Attributes
    ----------
    problem : Problem
    program : Program
        Program of the problem.
    x : (v,) ndarray
        The solution.
    value : Lagrangian or LeastTime
        Function of a program and a point that changes by as much as t_E, s, if the problem changes.
    step : float
        Fraction by which figures are changed.
    """

    problem: Problem
    program: Program
    x: np.ndarray
    value: Lagrangian | LeastTime
    step: float = 1e-4

    def change(self, changed: Problem) -> float:
        """Return the change of t_E, s, to first order, for a changed problem with as many legs; 0 if out of reach."""
        try:
            after = self.value_of(changed)
        except UnreachableError:
            return 0.0
        change = after - self._unchanged
        return change if np.isfinite(change) else 0.0

    def value_of(self, changed: Problem, *, has_new_limits: bool = False) -> float:
        """Return `value`, s, for a changed problem with as many legs; NaN if it is not known.

        Parameters
        ----------
        changed : Problem
        has_new_limits : bool, optional
            Whether the limits are those of the changed robots and tasks of its parts.

        Raises
        ------
        UnreachableError
            The motion is out of reach.
        """
        phases = []
        x_by_phase = []
        points = iter(self.program.split(self.x))
        for part in changed.parts:
            renewed = self._renew_limits(part) if has_new_limits else {}
            replaced: dict[Limit, Limit] = {}
            for number, path in enumerate(part.leg_paths):
                phase, x = next(points)
                joint_map = phase.joint_map
                if not joint_map.is_move:
                    joint_map = joint_map.along(path, joint_map.start)
                boundary = _with_conditions_of(
                    phase.boundary, boundary_of(part, joint_map, number)
                )
                for limit in phase.limits:
                    if limit not in replaced and limit.kind in renewed:
                        replaced[limit] = limit.select_from(renewed[limit.kind])
                limits = [replaced.get(limit, limit) for limit in phase.limits]
                arguments = (joint_map, limits, phase.grid, boundary)
                shifted = Phase(*arguments, margin=None, pause=phase.pause)
                phases.append(shifted)
                x_by_phase.append(_carry_over(phase, x, shifted))
        program = self.program.with_phases(phases)
        return self.value(program, np.concatenate(x_by_phase))

    def _renew_limits(self, part: Problem) -> dict[str, Limit]:
        """Build those limits, by kind, that have an effect on `value`, for the robot and the task of a part."""
        kinds = {limit.kind for limit in self.value.limits if not is_safeguard(limit)}
        if kinds <= set(LIMIT_BUILDERS):
            limits = build_limits(part.robot, part.task, kinds)
        else:
            limits = limits_of(part.robot, part.task, part.own_limits)
        return {limit.kind: limit for limit in limits}

    @cached_property
    def _unchanged(self) -> float:
        """`value` at the solution of the unchanged problem, s."""
        return self.value(self.program, self.x)


def _with_conditions_of(before: Boundary, after: Boundary) -> Boundary:
    """Prescribe as many derivatives as before; for redundant joints they stay zero if the tool now moves at an end."""
    sides: dict[str, Any] = {}
    for side in ("start", "end"):
        pairs = zip(getattr(before, side), getattr(after, side), strict=True)
        sides[side] = tuple(
            replace(new, derivatives=max(new.derivatives, old.derivatives, key=_order))
            for old, new in pairs
        )
    return replace(after, **sides)


def _order(derivatives: np.ndarray) -> tuple[int, bool]:
    """Return a key by which more derivatives, and given ones, come later."""
    return len(derivatives), bool(np.isfinite(derivatives).all())


def _carry_over(phase: Phase, x: np.ndarray, target: Phase) -> np.ndarray:
    """Carry a motion, (v,), over to a phase that travels the same leg at other path coordinates or another speed."""
    carried = x.copy()
    if target.time_law is not None:
        carried[0] = target.time_law.duration
        return carried
    of_s = phase.slices[0]
    begin = phase.boundary.start[0].value
    ratio = target.boundary.ahead[0] / phase.boundary.ahead[0]
    carried[of_s] = target.boundary.start[0].value + ratio * (x[of_s] - begin)
    return carried


TaskFigure = tuple[Sensitivity, Callable[[float], Problem]]
"""A figure of a task whose cost is not known yet, and a function that returns the problem with a new value of it."""


def figure_sensitivities(motion: OptimalMotion) -> tuple[Sensitivity, ...]:
    """Derive the costs of the task's figures; figures that cannot be made larger are left out."""
    costs = []
    problem = motion.problem
    for number, part in enumerate(problem.parts):
        for cost, change in (*_speeds(part), *_blends(part)):
            step = motion.step * cost.figure
            try:
                changed = problem.with_part(number, change(cost.figure + step))
            except InputError:
                continue
            costs.append(replace(cost, derivative=motion.change(changed) / step))
    return tuple(costs)


def _speeds(problem: Problem) -> Iterator[TaskFigure]:
    """List process speeds; parts of the path with equal speeds share one figure."""
    limits = problem.task.tool_limits

    def change(before: float, after: float) -> Problem:
        """Return the problem with one process speed, m/s, replaced by another."""
        sections = tuple(
            section.model_copy(update={"speed": after})
            if section.speed == before
            else section
            for section in limits.process_speed
        )
        changed = limits.model_copy(update={"process_speed": sections})
        task = problem.task.model_copy(update={"tool_limits": changed})
        segments = tuple(
            segment.model_copy(update={"speed": after})
            if getattr(segment, "speed", None) == before
            else segment
            for segment in task.path
        )
        if segments == task.path:
            return _with_legs(replace(problem, task=task))
        # The leads of segments are longer at a higher speed.
        return _with_task(problem, task.model_copy(update={"path": segments}))

    for speed in sorted({section.speed for section in limits.process_speed}):
        sections = [
            section for section in limits.process_speed if section.speed == speed
        ]
        keys = dict.fromkeys(
            PROCESS_SPEED_KEY
            if section.segment is None
            else f"path[{section.segment}].speed"
            for section in sections
        )
        label = label_of_speed(PROCESS_SPEED, speed, ", ".join(keys))
        s = tuple(section.s for section in sections)
        yield Sensitivity(label, None, speed, speed, 0.0, s), partial(change, speed)


def _blends(problem: Problem) -> Iterator[TaskFigure]:
    """List blends; blends of the same size share one figure, and so do all blends along the points of one file."""
    segments = problem.task.path
    breaks = problem.path.breaks.tolist()
    places: dict[int, tuple[float, float]] = {}
    for ends, span in zip(pairwise(breaks), problem.path.spans, strict=True):
        if len(span.segments) > 1:
            places[span.segments[0]] = ends
    groups: defaultdict[str | float | None, list[int]] = defaultdict(list)
    source = ""
    for number, (segment, after) in enumerate(pairwise(segments)):
        if isinstance(segment, BSplineSegment) and segment.bspline.fit:
            source = segment.bspline.fit.source
        if number in places:
            is_of_file = isinstance(after, BSplineSegment) and not after.bspline.fit
            groups[source if is_of_file else segment.blend].append(number)

    def change(numbers: list[int], before: float, after: float) -> Problem:
        """Return the problem with the blends after some segments scaled by the ratio of two sizes, m."""
        path = list(segments)
        for number in numbers:
            size = (path[number].blend or 0.0) * after / before
            path[number] = path[number].model_copy(update={"blend": size})
        task = problem.task.model_copy(update={"path": tuple(path)})
        return _with_task(problem, task)

    for group, numbers in groups.items():
        size = max(segments[number].blend or 0.0 for number in numbers)
        cause = "blend"
        key = "path.blend"
        if isinstance(group, str):
            cause = f"blend at the corners of {group}"
            key = "csv.tolerance.corner"
        label = Label("path", f"{cause}, {size:.10g} m", "m", key, cause=cause)
        s = tuple(places[number] for number in numbers)
        cost = Sensitivity(label, None, size, size, 0.0, s)
        yield cost, partial(change, numbers, size)


def _with_task(problem: Problem, task: Task) -> Problem:
    """Return the problem with another task, and with the path, process speeds and feed rates of this task.

    Raises
    ------
    PathError
        The task describes no valid path.
    """
    task_map = problem.task_map
    path = path_of(task_map, task)
    task = with_held_speeds(with_feed_rates(task, path), task_map, path)
    return _with_legs(replace(problem, task=task, path=path))


def _with_legs(problem: Problem) -> Problem:
    """Return the problem with the legs and time laws of its task and path."""
    legs = legs_of(problem.task, problem.task_map, problem.path)
    laws = tuple(time_law_of(leg, problem.task_map, problem.path) for leg in legs)
    return replace(problem, legs=legs, time_laws=laws)
