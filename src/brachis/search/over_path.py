"""Guesses improved over the path: each one's joint path is optimised with its timing, in a chart around itself.

That takes tenths of a second. It ranks guesses, and where the phase plane knows all limits it is the plan but for the
splines. The lattice's joint path may be far from the best one next to it. A chart holds around its own joint path: if
the rows are no longer transversal along the better one, or the margin holds the motion back, a new chart is laid around
this one, and the search goes on in it.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from brachis.common import tolerances
from brachis.errors import UnreachableError
from brachis.kinematics import (
    ChartMap,
    Newton,
    chart_around,
    transversality,
)
from brachis.optimise.candidate import InitialGuess
from brachis.optimise.improve import SolverSession
from brachis.optimise.program import Program
from brachis.optimise.retiming import BetterPaths, PathEffort, improve_joint_paths
from brachis.optimise.transcription import program_over

CHARTS = 4
"""Charts in which a guess is improved, no more, unless stated."""
_TRANSVERSAL = 0.5
"""Least transversality of rows along a motion, below which its chart is left for another."""


@dataclass(frozen=True)
class BetterGuess:
    """What came of a guess.

    Attributes
    ----------
    start : InitialGuess
        With the better joint path, its chart, and its least time as the estimate.
    program : Program
        In that chart, over the knots of the given one.
    found : BetterPaths
        With the reports of all solves.
    """

    start: InitialGuess
    program: Program
    found: BetterPaths


def improve_guess(
    start: InitialGuess,
    program: Program,
    solve: SolverSession,
    effort: PathEffort,
    charts: int = CHARTS,
) -> BetterGuess:
    """Find a better joint path next to that of a guess.

    Parameters
    ----------
    start : InitialGuess
    program : Program
        Of its joint maps, over any knots; see `improve_joint_paths`.
    solve : SolverSession
    effort : PathEffort
    charts : int, optional
        In which it is looked for, no more.

    Returns
    -------
    BetterGuess
        The given joint path where the limits allow no timing of it.

    Raises
    ------
    UnreachableError
        It leaves its joint map.
    """
    tolerance = start.problem.task.spline.tolerance
    found = improve_joint_paths(program, start.legs, solve, tolerance, effort)
    better = BetterGuess(_along(start, found), program, found)
    # A chart around a motion that is given is kept.
    is_free = start.in_chart and start.durations is None
    more = charts - 1 if is_free and better.start.is_improved else 0
    for _ in range(more):
        moved = _lay_chart(better)
        if moved is None or solve.deadline.passed:
            break
        try:
            grids = [phase.grid for phase in program.phases]
            own = program_over(start.problem, moved.maps_by_leg(), grids)
            found = improve_joint_paths(own, moved.legs, solve, tolerance, effort)
        except UnreachableError:
            break
        reports = (*better.found.reports, *found.reports)
        found = dataclasses.replace(found, reports=reports)
        gain = 1.0 - found.t_end / better.found.t_end
        if gain < -tolerances.GAIN:
            break
        better = BetterGuess(_along(moved, found), own, found)
        if gain < tolerances.GAIN:
            break
    return _centre(better) if is_free and better.start.is_improved else better


def _centre(better: BetterGuess) -> BetterGuess:
    """Lay the same chart around the better joint path: the search for a posture then begins beside it.

    Its coordinates stay, and so do the timings that were found.
    """
    start = better.start
    chart = start.joint_map
    assert isinstance(chart, ChartMap)
    s = start.joint_path[:, 0]
    q = chart.postures(start.joint_path)
    if not np.isfinite(q).all():
        return better
    grids = [phase.grid for phase in better.program.phases]
    try:
        centred = chart_around(chart.task_map, chart.path, s, q, chart.rows)
        start = dataclasses.replace(start, joint_map=centred)
        program = program_over(start.problem, start.maps_by_leg(), grids)
    except UnreachableError:
        return better
    return dataclasses.replace(better, start=start, program=program)


def _along(start: InitialGuess, found: BetterPaths) -> InitialGuess:
    """Return a guess with better joint paths, leg by leg, and their time."""
    if not np.isfinite(found.t_end):
        return start
    curves = np.concatenate(found.curves)
    grows = np.append(True, np.diff(curves[:, 0]) > 0.0)
    waiting = sum(leg.dwell for leg in start.problem.legs)
    return dataclasses.replace(
        start,
        joint_path=curves[grows],
        estimate=found.t_end + waiting,
        durations=None,
        is_improved=True,
    )


def _lay_chart(better: BetterGuess) -> InitialGuess | None:
    """Lay a chart around a better joint path; None where its own one is good, and where it has none."""
    chart = better.start.joint_map
    assert isinstance(chart, ChartMap)
    problem = better.start.problem
    curves = better.start.joint_path
    s = curves[:, 0]
    q = chart.postures(curves)
    if not np.isfinite(q).all():
        return None
    newton = Newton(chart.task_map)
    rows = chart.rows.at(s)[0] * newton.scales
    least = transversality(rows, newton.self_motions(q)).min()
    if least >= _TRANSVERSAL and not better.found.is_held_back:
        return None
    try:
        moved = chart_around(problem.task_map, problem.path, s, q)
    except UnreachableError:
        return None
    return dataclasses.replace(
        better.start, joint_map=moved, joint_path=moved.curves(s, q)
    )
