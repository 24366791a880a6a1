"""The nonlinear program of a task on a robot: one phase, along the path, in the coordinates of a joint map."""

from __future__ import annotations

import numpy as np

from brachis.errors import UnreachableError
from brachis.kinematics import ChartMap, JointMap
from brachis.optimise.boundary import Boundary
from brachis.optimise.bspline import clamped_knots, spread
from brachis.optimise.grid import FixedGrid
from brachis.optimise.mesh import COARSE_INTERVALS
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.problem.problem import Problem
from brachis.task import Task


def program_of(problem: Problem, joint_map: JointMap, breaks: np.ndarray) -> Program:
    """Write the NLP of a decomposition down: one phase, along the path.

    Parameters
    ----------
    problem : Problem
    joint_map : JointMap
        Beginning at the task's start posture, or at a first guess of it where that is free.
    breaks : (N + 1,) ndarray
        Ends of the knot intervals in normalised time.

    Returns
    -------
    Program
    """
    spline = problem.task.spline
    knots = clamped_knots(spline.degree, breaks)
    t_norm = spread(breaks, spline.points_per_interval)
    grid = FixedGrid(knots, spline.degree, t_norm)
    return Program([phase_in(problem, joint_map, grid)])


def phase_in(problem: Problem, joint_map: JointMap, grid: FixedGrid) -> Phase:
    """Write the motion along the path down as a phase, in the coordinates of a joint map, over a grid.

    Raises
    ------
    UnreachableError
        A periodic motion is asked for in coordinates that do not close with the path.
    """
    return Phase(joint_map, problem.limits, grid, _boundary(problem, joint_map))


def _boundary(problem: Problem, joint_map: JointMap) -> Boundary:
    """Write the task's boundary conditions in the coordinates of a joint map."""
    is_periodic = problem.task.boundary.periodic
    if is_periodic and isinstance(joint_map, ChartMap) and not joint_map.rows.closes:
        raise UnreachableError(
            "chart coordinates at start and end differ, so the motion cannot be periodic in them"
        )
    free = np.full(problem.robot.n, np.nan)
    start = joint_map.coordinates(0.0, free if problem.start is None else problem.start)
    end = joint_map.coordinates(1.0, free if problem.end is None else problem.end)
    derivatives = problem.task.spline.vanishing
    unknown = np.full(len(start) - 1, np.nan)
    first, last = (np.append(ds, unknown) if ds else None for ds in problem.end_rates)
    return Boundary(start, end, derivatives, first, last, is_periodic)


def breaks_of(task: Task) -> np.ndarray:
    """Return the ends of the task's uniform intervals, (N + 1,); of the first mesh where their number is left open."""
    intervals = task.spline.intervals
    count = COARSE_INTERVALS if intervals == "auto" else intervals
    return np.linspace(0.0, 1.0, count + 1)
