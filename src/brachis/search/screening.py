"""Which of many starts are worth a plan: each is solved quickly over few knots, and the fastest that differ are kept.

The length of a joint path, and the least time along it, tell little about the motion that an optimiser makes of it
where several redundant joints are free to move. A solve over few knots, stopped early, tells more and costs little; and
the plan then begins at the joint path where it ended.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from contextlib import closing

import numpy as np

from brachis.common.deadline import Deadline
from brachis.common.progress import Listener
from brachis.errors import UnreachableError
from brachis.kinematics import ChartMap
from brachis.optimise.backends import SolverOptions, solver_named
from brachis.optimise.candidate import InitialGuess
from brachis.optimise.program import Program
from brachis.optimise.session import SolverSession
from brachis.optimise.transcription import program_of
from brachis.problem.problem import Problem
from brachis.search.phase_plane import initial_guess
from brachis.search.processes import each, processes
from brachis.search.solving import solve_in_chart

_INTERVALS = 12
_DEGREE = 2
"""Parabolas jump from one acceleration to the next, as fastest motions do: so few say most."""
_TOLERANCE = 1e-3
_ITERATIONS = 25
_NEARLY = 1e-2
_PLACES = 97
_PROGRESS = 5e-3
_PATIENCE = 3
"""A quick solve ends where so many feasible iterates differ by no more than this fraction."""
_SAME_TIME = 0.02
_SAME_PATH = 0.15
"""Starts are the same where their end times differ by less than this fraction, and no joint by more, rad or m."""
_SAME_LEAST = 1.003
_OFTEN = 4
"""No further start is looked at where so many quick solves, or as many as are kept, end within this factor of the
least end time."""
_ALIKE = 2
"""So many of these equally fast starts are kept at most, or half of what a level plans if that is more."""
_SLOWER = 1.03
"""Starts that are slower than the fastest one by this factor are left out."""


def screened(
    starts: Sequence[InitialGuess], most: int, deadline: Deadline, listener: Listener
) -> list[InitialGuess]:
    """Choose the most promising of starts in charts.

    Parameters
    ----------
    starts : sequence of InitialGuess
        At least one.
    most : int
        How many to keep at most; not more than so many are not looked at.
    deadline : Deadline
    listener : callable

    Returns
    -------
    list of InitialGuess
        With the joint paths that the quick solves led to, and their end times as estimates; the fastest first.
    """
    if len(starts) <= most:
        return list(starts)
    jobs = processes(starts[0].problem.task.search.jobs, deadline)
    listener(f"solving quickly from {len(starts)} joint paths")
    looked_at: list[InitialGuess] = []
    with closing(
        each(_quickly, starts, deadline, jobs=jobs, listener=listener)
    ) as solved:
        for start in solved:
            looked_at.append(start)
            if _met_again(looked_at, max(_OFTEN, most)):
                break
    kept: list[InitialGuess] = []
    for start in sorted(looked_at, key=lambda start: start.estimate):
        ratio = start.estimate / kept[0].estimate if kept else 1.0
        alike = ratio <= _SAME_LEAST and len(kept) >= max(_ALIKE, most // 2)
        if (
            len(kept) < most
            and not alike
            and not ratio > _SLOWER
            and not any(_same(start, other) for other in kept)
        ):
            kept.append(start)
    return kept


def _met_again(looked_at: Sequence[InitialGuess], often: int) -> bool:
    """Tell whether so many quick solves ended at the least end time that others are unlikely to end below it."""
    times = np.array(
        [start.estimate for start in looked_at if np.isfinite(start.estimate)]
    )
    return bool(np.sum(times <= _SAME_LEAST * times.min(initial=np.inf)) >= often)


def _quickly(
    start: InitialGuess, deadline: Deadline, _listener: Listener
) -> InitialGuess:
    """Solve from a start over few knots; where that fails the start stays as it is, with an infinite estimate."""
    hopeless = dataclasses.replace(start, estimate=np.inf)
    if deadline.passed:
        return hopeless
    problem = _roughly(start.problem)
    program = program_of(
        problem, start.joint_map, np.linspace(0.0, 1.0, _INTERVALS + 1)
    )
    x = initial_guess(program, start)
    if x is None:
        return hopeless
    try:
        program, reports = solve_in_chart(problem, program, x, _solver(start, deadline))
    except ImportError:  # the backend is not installed: the plan says so
        return hopeless
    last = reports[-1]
    if not last.status.usable:
        return hopeless
    chart = program.phases[0].joint_map
    assert isinstance(chart, ChartMap)
    try:
        return dataclasses.replace(
            start,
            joint_map=chart,
            joint_path=_curves(program, last.x),
            estimate=float(last.objective),
            timed=True,
        )
    except UnreachableError:
        return hopeless


def _roughly(problem: Problem) -> Problem:
    """Return the problem with parabolas at rest in their velocity alone, without limits that they cannot hold."""
    spline = problem.task.spline.model_copy(
        update={"degree": _DEGREE, "rest": "velocity"}
    )
    limits = tuple(limit for limit in problem.limits if limit.order <= _DEGREE)
    return dataclasses.replace(
        problem, task=problem.task.model_copy(update={"spline": spline}), limits=limits
    )


def _solver(start: InitialGuess, deadline: Deadline) -> SolverSession:
    """Make a session that solves roughly: an answer that nearly holds the limits will do."""
    curved = any(limit.guarantee.is_mean for limit in start.problem.limits)
    backend = solver_named(start.problem.task.solver.name, curved=curved)[0]

    options = SolverOptions(
        _TOLERANCE, _ITERATIONS, np.inf, progress=_PROGRESS, patience=_PATIENCE
    )
    return SolverSession(backend, options, deadline, acceptable=_NEARLY)


def _curves(program: Program, x: np.ndarray) -> np.ndarray:
    """Values of a motion's curves, (S, 1 + r), at even times."""
    (motion,) = program.motions(x)
    return motion.at(np.linspace(0.0, motion.t_end, _PLACES))[0]


def _same(first: InitialGuess, second: InitialGuess) -> bool:
    """Tell whether two starts that were solved are the same joint path, nearly."""
    if not np.isfinite([first.estimate, second.estimate]).all():
        return False
    if abs(first.estimate - second.estimate) > _SAME_TIME * second.estimate:
        return False
    postures = [start.joint_map.postures(start.joint_path) for start in (first, second)]
    return bool(np.abs(postures[0] - postures[1]).max() < _SAME_PATH)
