"""What process speeds cost. They give s(t) and bound nothing: no row of a program has their multiplier.

At an optimum the Lagrangian L = t_E - sum w_i p_i does not change to first order with the free variables. So dt_E is
the change of L when the speed changes and the free variables stay; durations that follow from the speed change with it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from brachis.explain.multipliers import Multipliers
from brachis.explain.sensitivities import label_of_speed
from brachis.limits.tool import PROCESS_SPEED
from brachis.optimise.program import Program
from brachis.optimise.transcription import boundary_of
from brachis.path import legs_of, time_law_of
from brachis.problem.problem import Problem
from brachis.trajectory.sensitivities import Sensitivity

_STEP = 1e-4
"""Part by which a speed is changed."""


@dataclass(frozen=True, eq=False)
class Lagrangian:
    """The Lagrangian of a program at its answer.

    Attributes
    ----------
    program : Program
    x : (v,) ndarray
    multipliers : Multipliers
    """

    program: Program
    x: np.ndarray
    multipliers: Multipliers

    def value(self, program: Program, x: np.ndarray) -> float:
        """Evaluate it, s, at a point of a program with the same rows."""
        active = self.multipliers.active_set
        count = len(active.rows)
        slack = active.signs * program.rows(x)[active.rows]
        return program.end_time(x) - float(self.multipliers.weights[:count] @ slack)

    def change_with_speeds(self, changed: Problem) -> float:
        """Change of t_E, s, to first order, if the process speeds are those of another problem."""
        phases = []
        parts = []
        for number, (phase, x_of_phase) in enumerate(self.program.split(self.x)):
            boundary = boundary_of(changed, phase.joint_map, number)
            phases.append(phase.with_grid(phase.grid, boundary))
            law = boundary.time_law
            duration = x_of_phase[0] if law is None else law.duration
            parts.append(np.append(duration, x_of_phase[1:]))
        program = self.program.with_phases(phases)
        before = self.value(self.program, self.x)
        return self.value(program, np.concatenate(parts)) - before


def speed_sensitivities(
    problem: Problem, lagrangian: Lagrangian
) -> tuple[Sensitivity, ...]:
    """Derive what process speeds cost; parts of the path with the same speed are one figure.

    Parameters
    ----------
    problem : Problem
    lagrangian : Lagrangian
        Of its program over time.

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    speeds = sorted({part.speed for part in problem.task.tool_limits.process_speed})
    costs = []
    for speed in speeds:
        changed = _with_speed(problem, speed, (1.0 + _STEP) * speed)
        derivative = lagrangian.change_with_speeds(changed) / (_STEP * speed)
        label = label_of_speed(PROCESS_SPEED, speed, "tool_limits.process_speed")
        costs.append(Sensitivity(label, None, speed, speed, derivative))
    return tuple(costs)


def _with_speed(problem: Problem, speed: float, changed: float) -> Problem:
    """Return the problem with another process speed, m/s, in place of one, on the same parts of the path."""
    limits = problem.task.tool_limits
    parts = tuple(
        part.model_copy(update={"speed": changed}) if part.speed == speed else part
        for part in limits.process_speed
    )
    limits = limits.model_copy(update={"process_speed": parts})
    task = problem.task.model_copy(update={"tool_limits": limits})
    legs = legs_of(task, problem.task_map, problem.path)
    laws = tuple(time_law_of(leg, problem.task_map, problem.path) for leg in legs)
    return replace(problem, task=task, legs=legs, time_laws=laws)
