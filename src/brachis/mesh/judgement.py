"""What the rounds of mesh refinement and of knot optimisation are judged by."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from brachis.nlp import Program
from brachis.refine import Refined, RefinementOptions
from brachis.solvers import SolverReport, SolveStatus

SHORTEST = 5e-5
"""No interval gets shorter than this part of t_E: collocation points would fall together."""


class Answer(NamedTuple):
    """What came of the knots.

    Attributes
    ----------
    program : Program
    reports : tuple of SolverReport
        Of all solves; the last one belongs to `program`.
    undone : str
        What the time, or a solve that failed, left undone, in words; empty where nothing.
    """

    program: Program
    reports: tuple[SolverReport, ...]
    undone: str = ""


_EARLY = (SolveStatus.ITERATION_LIMIT, SolveStatus.TIME_LIMIT, SolveStatus.STALLED, SolveStatus.FAILED)
"""How a solve ends that is not done; a solver that breaks down at last may have come far."""


def accepted(report: SolverReport, before: SolverReport) -> SolverReport:
    """Accept a solve that ended early with a feasible motion faster than the one that it began with."""
    better = report.feasible and report.objective < before.objective
    early = report.status in _EARLY
    return replace(report, status=SolveStatus.ACCEPTABLE) if better and early else report


def end_time(refined: Refined, refinement: RefinementOptions) -> float:
    """End time of a motion that holds the limits, infinite for others."""
    holds = refined.converged and (refined.violation <= refinement.tolerance or not refinement.max_rounds)
    return refined.t_end if holds else np.inf


def gain(before: Refined, after: Refined, refinement: RefinementOptions) -> float:
    """Part of the end time that is gained; NaN where neither motion holds the limits."""
    if not np.isfinite(end_time(before, refinement)):
        return 1.0 if np.isfinite(end_time(after, refinement)) else np.nan
    return 1.0 - end_time(after, refinement) / end_time(before, refinement)


def ending_with(last: SolverReport, reports: list[SolverReport]) -> tuple[SolverReport, ...]:
    """Move one of the reports to the end."""
    return (*(report for report in reports if report is not last), last)
