"""What figures of the task cost that no row of a program has for a bound: process speeds, blends, speeds at the ends.

At an optimum the Lagrangian L = t_E - sum w_i p_i does not change to first order with the free variables. So dt_E is
the change of L if such a figure changes and the free variables stay; durations that follow from a speed change with it.
If only the timing is optimal, of a joint path that follows from the path of the tool, dt_E is the change of its time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from brachis.common.labels import Label
from brachis.errors import InputError, UnreachableError
from brachis.explain.multipliers import Multipliers
from brachis.explain.sensitivities import label_of_speed
from brachis.limits.tool import PROCESS_SPEED
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.optimise.retiming import least_time
from brachis.optimise.phase_timing import PhaseTiming
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
from brachis.trajectory.sensitivities import Sensitivity

Value = Callable[[Program, np.ndarray], float]
"""A function of a program and a point, (v,), whose change is that of t_E, s, if a figure of the task changes."""
_STEP = 1e-4
"""Part by which a figure is changed in the Lagrangian."""
_STEP_OF_TIMING = 1e-2
"""The same in timings, whose stations make an error of about 1e-6 of the time."""


@dataclass(frozen=True, eq=False)
class OptimalMotion:
    """An answer, and how t_E changes with what its program is made of.

    Attributes
    ----------
    problem : Problem
    program : Program
        Of the problem.
    x : (v,) ndarray
        The answer.
    value : callable
    step : float
        Part by which figures are changed.
    """

    problem: Problem
    program: Program
    x: np.ndarray
    value: Value
    step: float

    @classmethod
    def with_multipliers(
        cls, problem: Problem, program: Program, x: np.ndarray, multipliers: Multipliers
    ) -> OptimalMotion:
        """Take the Lagrangian; programs with the same rows have the same active ones."""
        active = multipliers.active_set
        count = len(active.rows)

        def value(program: Program, x: np.ndarray) -> float:
            slack = active.signs * program.rows(x)[active.rows]
            return program.end_time(x) - float(multipliers.weights[:count] @ slack)

        return cls(problem, program, x, value, _STEP)

    @classmethod
    def with_timings(
        cls, problem: Problem, program: Program, x: np.ndarray
    ) -> OptimalMotion:
        """Take the least time of the joint path."""

        def value(program: Program, x: np.ndarray) -> float:
            timings = (
                PhaseTiming.of(*pair, is_rough=True) for pair in program.split(x)
            )
            return least_time(timings)

        return cls(problem, program, x, value, _STEP_OF_TIMING)

    def change(self, changed: Problem) -> float:
        """Change of t_E, s, to first order, for another problem with as many legs.

        Raises
        ------
        UnreachableError
            A collocation point is out of the branch's reach.
        """
        phases = []
        parts = []
        for number, (phase, x_of_phase) in enumerate(self.program.split(self.x)):
            path = changed.leg_paths[number]
            joint_map = phase.joint_map.along(path, phase.joint_map.start)
            boundary = boundary_of(changed, joint_map, number)
            arguments = (joint_map, phase.limits, phase.grid, boundary)
            other = Phase(*arguments, margin=None, pause=phase.pause)
            phases.append(other)
            parts.append(_carry_over(phase, x_of_phase, other))
        program = self.program.with_phases(phases)
        before = self.value(self.program, self.x)
        return self.value(program, np.concatenate(parts)) - before


def _carry_over(phase: Phase, x: np.ndarray, other: Phase) -> np.ndarray:
    """Take a motion, (v,), over to a phase that passes the same leg at other path coordinates, or at another speed."""
    carried = x.copy()
    if other.time_law is not None:
        carried[0] = other.time_law.duration
        return carried
    of_s = phase.slices[0]
    begin = phase.boundary.start[0].value
    ratio = other.boundary.ahead[0] / phase.boundary.ahead[0]
    carried[of_s] = other.boundary.start[0].value + ratio * (x[of_s] - begin)
    return carried


def figure_sensitivities(motion: OptimalMotion) -> tuple[Sensitivity, ...]:
    """Derive what the task's figures cost.

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    costs = []
    figures = [*_speeds(motion.problem), *_blends(motion.problem), *_ends(motion.problem)]
    for label, figure, change_task in figures:
        step = motion.step * figure
        try:
            changed = change_task(figure + step)
        except InputError:  # there is no larger one
            continue
        derivative = motion.change(changed) / step
        costs.append(Sensitivity(label, None, figure, figure, derivative))
    return tuple(costs)


_Figure = tuple[Label, float, Callable[[float], Problem]]
"""What a figure is called, its value, and the problem with another value."""


def _speeds(problem: Problem) -> Iterator[_Figure]:
    """List process speeds; parts of the path with the same speed are one figure."""
    limits = problem.task.tool_limits
    for speed in sorted({part.speed for part in limits.process_speed}):

        def change(other: float, speed: float = speed) -> Problem:
            parts = tuple(
                part.model_copy(update={"speed": other}) if part.speed == speed else part
                for part in limits.process_speed
            )
            changed = limits.model_copy(update={"process_speed": parts})
            task = problem.task.model_copy(update={"tool_limits": changed})
            return _with_legs(replace(problem, task=task))

        label = label_of_speed(PROCESS_SPEED, speed, "tool_limits.process_speed")
        yield label, speed, change


def _blends(problem: Problem) -> Iterator[_Figure]:
    """List blends; those of the same size are one figure."""
    segments = problem.task.path
    for size in sorted({segment.blend for segment in segments} - {None, 0.0}):

        def change(other: float, size: float = size) -> Problem:
            path = tuple(
                segment.model_copy(update={"blend": other})
                if segment.blend == size
                else segment
                for segment in segments
            )
            return _with_task(problem, problem.task.model_copy(update={"path": path}))

        yield Label("path", "blend", "m", "path.blend", cause="blend"), size, change


def _ends(problem: Problem) -> Iterator[_Figure]:
    """List given speeds at both ends of the path."""
    boundary = problem.task.boundary
    for end in ("start", "end"):
        key = f"{end}_speed"
        speed = getattr(boundary, key)
        if not speed:
            continue

        def change(other: float, key: str = key) -> Problem:
            changed = boundary.model_copy(update={key: other})
            task = problem.task.model_copy(update={"boundary": changed})
            return replace(problem, task=task)

        kind = f"speed at the path's {end}"
        yield Label("path", kind, "m/s", f"boundary.{key}", cause=kind), speed, change


def _with_task(problem: Problem, task: Task) -> Problem:
    """Return the problem with another path, and the process speeds and feed rates on it."""
    task_map = problem.task_map
    path = path_of(task_map, task)
    task = with_held_speeds(with_feed_rates(task, path), task_map, path)
    return _with_legs(replace(problem, task=task, path=path))


def _with_legs(problem: Problem) -> Problem:
    """Return the problem with the legs and time laws of its task and path."""
    legs = legs_of(problem.task, problem.task_map, problem.path)
    laws = tuple(time_law_of(leg, problem.task_map, problem.path) for leg in legs)
    return replace(problem, legs=legs, time_laws=laws)
