"""The knots that a task asks for."""

from __future__ import annotations

import numpy as np

from brachis.mesh.freeing import free_knots
from brachis.mesh.growing import grow
from brachis.mesh.halving import MeshOptions, refine_mesh
from brachis.mesh.judgement import Answer
from brachis.nlp import Transcription
from brachis.refine import RefinementOptions, Solve
from brachis.solvers import SolverReport
from brachis.task import SplineSettings


def settle_knots(
    problem: Transcription,
    reports: tuple[SolverReport, ...],
    solve: Solve,
    spline: SplineSettings,
    refinement: RefinementOptions,
    *,
    target: Transcription | None = None,
    time_limit: float = np.inf,
) -> Answer:
    """Do with the knots of a solved problem what a task's ``spline`` part asks for: nothing, free them, or refine.

    Parameters
    ----------
    problem : Transcription
    reports : tuple of SolverReport
        The last one is of the problem's solve.
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.
    spline : SplineSettings
    refinement : RefinementOptions
    target : Transcription, optional
        The problem over all its knots, where the solved one is its coarsest (see `grow`).
    time_limit : float, optional
        Time after which no further round is begun, s.

    Returns
    -------
    problem : Transcription
        With fixed knots.
    reports : tuple of SolverReport
        Those given, and those of further solves.
    """
    if target is not None and reports[-1].status.usable:
        problem, further = grow(target, problem, reports[-1], solve)
        reports = (*reports[:-1], *further)
    if not reports[-1].status.usable:
        return problem, reports
    if spline.knots == "free":
        problem, further = free_knots(problem, reports[-1], solve, spline.shortest_interval, refinement, time_limit)
    elif spline.intervals == "auto":
        options = MeshOptions(spline.tolerance, spline.points_per_interval, time_limit)
        problem, further = refine_mesh(problem, reports[-1], solve, options, refinement)
    else:
        return problem, reports
    return problem, (*reports[:-1], *further)
