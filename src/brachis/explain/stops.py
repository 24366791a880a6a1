"""What stops of the tool cost at most: the phases beside one, timed with any speed that they can have there."""

from __future__ import annotations

import numpy as np

from brachis.common import tolerances
from brachis.common.arrays import spread
from brachis.errors import UnreachableError
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.phase import Phase
from brachis.problem.problem import Problem
from brachis.timing import Course, TimedCourse
from brachis.trajectory.sensitivities import TaskSaving

_POINTS = 400
"""Points at which the joint path of a phase is timed: right within 1 % of what a stop costs."""
_HALVINGS = 12
"""Halvings of the range in which the largest speed is looked for."""
_RATE_RANGE = 64.0
"""Factor on the largest rate of the motion, and its inverse, between which it is looked for."""


def stop_savings(problem: Problem, motion: SolvedProgram) -> list[TaskSaving]:
    """Bound what the motion would gain along the same joint path without each of its stops.

    Parameters
    ----------
    problem : Problem
    motion : SolvedProgram
        Of its program.
    """
    phases = motion.program.split(motion.x)
    savings = []
    for number, leg in enumerate(problem.legs[:-1]):
        if not leg.stops:
            continue
        saved = _gain(*phases[number], -1) + _gain(*phases[number + 1], 0)
        way = "with a blend in place of" if _is_corner(problem, number) else "without"
        change = f"{way} the stop at s = {leg.end:.4g}"
        savings.append(TaskSaving(change, saved, is_bound=True))
    return savings


def _is_corner(problem: Problem, number: int) -> bool:
    """Tell whether the path changes its direction where a leg ends."""
    s = np.array([problem.legs[number].end])
    before, after = (
        path.sample(s).xi[0] for path in problem.leg_paths[number : number + 2]
    )
    change = np.linalg.norm(
        before / np.linalg.norm(before) - after / np.linalg.norm(after)
    )
    return bool(change > tolerances.ANGLE)


def _gain(phase: Phase, x: np.ndarray, end: int) -> float:
    """Time, s, that a phase gains if it need not rest at its start (0) or end (-1); 0 where its speed is given."""
    if phase.time_law is not None:
        return 0.0
    curves = phase.motion(x)
    breaks = curves.breaks
    t = spread(breaks, max(2, _POINTS // len(breaks)))
    try:
        course = TimedCourse(
            Course(t, *curves.at(t)[:3]), phase.joint_map, phase.limits
        )
    except UnreachableError:
        return 0.0
    rates = [float(course.speeds[0]), float(course.speeds[-1])]
    at_rest = course.solve((rates[0], rates[1]))
    if at_rest is None:
        return 0.0
    least = at_rest.t_end
    low = float(at_rest.rate.max()) / _RATE_RANGE
    high = float(at_rest.rate.max()) * _RATE_RANGE
    for _ in range(_HALVINGS):
        rates[end] = (low * high) ** 0.5
        timing = course.solve((rates[0], rates[1]))
        if timing is None:
            high = rates[end]
            continue
        low = rates[end]
        least = min(least, timing.t_end)
    return at_rest.t_end - least
