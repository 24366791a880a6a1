"""Solving in a chart that follows the motion, and in other coordinates than the chart's.

A chart holds around its joint path. Where the motion that a solve ends at goes so far from it that the rows are no
longer transversal there, or that the least singular value holds the motion back, a new chart is laid around that
motion, and the solve goes on in it. At the optimum any rows that are transversal along the motion describe the same
motions, but splines of them are not the same curves: over the same knots one measure of self-motion may be a few parts
in a thousand faster than another. So the best of some of them, those of single joints, is taken.
"""

from __future__ import annotations

import itertools

import numpy as np

from brachis.errors import UnreachableError
from brachis.kinematics import ChartMap, ChartRows, Newton, chart_around, null_spaces, transversality
from brachis.nlp import Program
from brachis.nlp.guess import fitted, shortest_time
from brachis.problem import Problem
from brachis.transcription import phase_in
from brachis.refine import Solve
from brachis.search.solving import HELD_BACK, MARGINS, WORTH_IT, continued
from brachis.solvers import SolverReport, SolveStatus

_TRANSVERSAL = 0.5
"""Least transversality along the motion with which a chart is kept."""
_RECENTRINGS = 3
SELECTABLE = 0.05
"""Least transversality along the motion of joints that may take the place of the chart's rows."""
_SELECTED = (0, 3, 1)
"""Choices of joints that are tried at most with no, one and several redundant joints: these solves take longest."""
_CHOICES = 500
"""Choices of joints that are looked at, at most."""
_DENSE = 4
_OUT_OF_TIME = (SolveStatus.TIME_LIMIT, SolveStatus.ITERATION_LIMIT)

Solved = tuple[Program, tuple[SolverReport, ...]]


def solved_in_chart(problem: Problem, program: Program, x: np.ndarray, solve: Solve) -> Solved:
    """Solve in a chart, and go on in one around the motion where that is needed.

    Parameters
    ----------
    problem : Problem
    program : Program
        Of one phase in a chart.
    x : (v,) ndarray
        Starting point.
    solve : callable

    Returns
    -------
    program : Program
        In the last chart.
    reports : tuple of SolverReport
        Of all solves; the last one belongs to `program`.
    """
    first, further = MARGINS[:1], MARGINS[1:]
    program, reports = continued(program, x, solve, first)
    if not reports[-1].status.usable and reports[-1].status not in _OUT_OF_TIME:
        program, more = continued(program, x, solve, further)
        reports += more
    for _ in range(_RECENTRINGS):
        if not reports[-1].status.usable or _follows(program, reports[-1].x):
            break
        moved = moved_to(problem, program, reports[-1].x)
        if moved is None:
            break
        other, more = continued(*moved, solve, first)
        if not more[-1].status.usable:
            reports = (*more, *reports)
            break
        gained = more[-1].objective < (1.0 - WORTH_IT) * reports[-1].objective
        program, reports = other, reports + more
        if not gained:
            break
    if reports[-1].status.usable and program.safeguard_slack(reports[-1].x) <= HELD_BACK:
        other, more = continued(program, reports[-1].x, solve, further)
        if more[-1].status.usable:
            return other, reports + more
        reports = (*more, *reports)
    return program, reports


def best_of_joints(problem: Problem, program: Program, report: SolverReport, solve: Solve) -> Solved:
    """Solve again with joints in place of the chart's rows, and keep the fastest; see the module.

    Parameters
    ----------
    problem : Problem
    program : Program
        Of one phase in a chart.
    report : SolverReport
        Its answer.
    solve : callable

    Returns
    -------
    program : Program
    reports : tuple of SolverReport
        Of the further solves, then `report` if it belongs to `program`, else the one that does.
    """
    best, last = program, report
    others: list[SolverReport] = []
    for rows in _selections(program, report.x):
        moved = moved_to(problem, program, report.x, rows)
        if moved is None:
            continue
        other, reports = continued(*moved, solve, MARGINS)
        others += reports
        if reports[-1].status.usable and reports[-1].objective < last.objective:
            best, last = other, reports[-1]
    return best, (*(each for each in others if each is not last), last)


def moved_to(
    problem: Problem, program: Program, x: np.ndarray, rows: ChartRows | None = None
) -> tuple[Program, np.ndarray] | None:
    """Write a motion in a chart around itself; None where there is none.

    Parameters
    ----------
    problem : Problem
    program : Program
        Of one phase.
    x : (v,) ndarray
    rows : ChartRows, optional
        Of the chart; see `chart_around`.

    Returns
    -------
    program : Program
    x : (v,) ndarray
        The same motion but for what splines of the new coordinates cannot say.
    """
    (phase,), (motion,) = program.phases, program.motions(x)
    t_norm = np.linspace(0.0, 1.0, _DENSE * len(phase.t_norm) + 1)
    try:
        state = phase.joint_map.state(*motion.at(t_norm * motion.t_end), t=t_norm * motion.t_end)
        s = state.y[:, 0]
        chart = chart_around(problem.task_map, problem.path, s, state.q, rows)
        other = Program([phase_in(problem, chart, phase.grid)])
        fit = fitted(other.phases[0], motion.t_end, t_norm, chart.curves(s, state.q))
        return other, shortest_time(other, fit)
    except UnreachableError:
        return None


def _self_motion(program: Program, x: np.ndarray) -> np.ndarray:
    """Bases of the null spaces of the task Jacobian, (K, n, r), along a motion."""
    (state,), (phase,) = program.states(x), program.phases
    chart = phase.joint_map
    assert isinstance(chart, ChartMap)  # noqa: S101
    return null_spaces(Newton(chart.task_map).placed(state.q)[1])


def _follows(program: Program, x: np.ndarray) -> bool:
    """Tell whether the chart still does for the motion."""
    try:
        (phase,), null = program.phases, _self_motion(program, x)
        chart, s = phase.joint_map, program.states(x)[0].y[:, 0]
        assert isinstance(chart, ChartMap)  # noqa: S101
        own = transversality(chart.rows.at(s)[0], null).min()
        return program.safeguard_slack(x) > HELD_BACK and bool(own >= _TRANSVERSAL)
    except UnreachableError:
        return False


def _selections(program: Program, x: np.ndarray) -> list[ChartRows]:
    """Rows that select joints and are transversal along the motion, the most transversal ones first."""
    null = _self_motion(program, x)
    n, r = null.shape[1:]
    choices = [list(joints) for joints in itertools.islice(itertools.combinations(range(n), r), _CHOICES)]
    least = [float(transversality(np.eye(n)[joints][None], null).min()) for joints in choices]
    ranked = sorted(range(len(choices)), key=lambda number: -least[number])[: _SELECTED[min(r, 2)]]
    return [ChartRows.constant(np.eye(n)[choices[number]]) for number in ranked if least[number] >= SELECTABLE]
