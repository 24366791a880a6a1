"""The knots that a task asks for."""

from __future__ import annotations

from brachis.mesh.h_refinement import MeshOptions, refine_mesh
from brachis.mesh.judgement import Answer
from brachis.mesh.knot_optimisation import optimise_knots
from brachis.mesh.nested_iteration import solve_nested
from brachis.nlp import Program
from brachis.refine import RefinementOptions, Solve
from brachis.solvers import SolverReport
from brachis.task import SplineSettings


def adapt_mesh(
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
        The program over all its knots, where the solved one is its coarsest (see `solve_nested`).

    Returns
    -------
    Answer
        With fixed knots; the reports are those given, and those of further solves.
    """
    if not reports[-1].status.usable:
        return Answer(program, reports)
    nested = Answer(program, reports[-1:])
    if target is not None:
        nested = solve_nested(target, program, reports[-1], solve, refinement.deadline)
    last = nested.reports[-1]
    if spline.knots == "free":
        adapted = optimise_knots(nested.program, last, solve, spline.shortest_interval, refinement)
    elif spline.intervals == "auto":
        options = MeshOptions(spline.tolerance, spline.points_per_interval)
        adapted = refine_mesh(nested.program, last, solve, options, refinement.deadline)
    else:
        adapted = Answer(nested.program, (last,))
    undone = "; ".join(filter(None, (nested.undone, adapted.undone)))
    return Answer(adapted.program, (*reports[:-1], *nested.reports[:-1], *adapted.reports), undone)
