"""The knots that a task asks for."""

from __future__ import annotations

from brachis.mesh.freeing import free_knots
from brachis.mesh.growing import grow
from brachis.mesh.halving import MeshOptions, refine_mesh
from brachis.mesh.judgement import Answer
from brachis.nlp import Program
from brachis.refine import RefinementOptions, Solve
from brachis.solvers import SolverReport
from brachis.task import SplineSettings


def settle_knots(
    program: Program,
    reports: tuple[SolverReport, ...],
    solve: Solve,
    spline: SplineSettings,
    refinement: RefinementOptions,
    *,
    target: Program | None = None,
) -> Answer:
    """Do with the knots of a solved program what a task's ``spline`` part asks for: nothing, free them, or refine.

    Parameters
    ----------
    program : Program
    reports : tuple of SolverReport
        The last one is of the problem's solve.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    spline : SplineSettings
    refinement : RefinementOptions
        After its deadline no further round is begun.
    target : Program, optional
        The program over all its knots, where the solved one is its coarsest (see `grow`).

    Returns
    -------
    Answer
        With fixed knots; the reports are those given, and those of further solves.
    """
    if not reports[-1].status.usable:
        return Answer(program, reports)
    grown = Answer(program, reports[-1:])
    if target is not None:
        grown = grow(target, program, reports[-1], solve, refinement.deadline)
    last = grown.reports[-1]
    if spline.knots == "free":
        settled = free_knots(grown.program, last, solve, spline.shortest_interval, refinement)
    elif spline.intervals == "auto":
        options = MeshOptions(spline.tolerance, spline.points_per_interval)
        settled = refine_mesh(grown.program, last, solve, options, refinement)
    else:
        settled = Answer(grown.program, (last,))
    undone = "; ".join(filter(None, (grown.undone, settled.undone)))
    return Answer(settled.program, (*reports[:-1], *grown.reports[:-1], *settled.reports), undone)
