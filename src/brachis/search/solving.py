"""Solve one NLP from one starting point, with ever smaller branch margins.

A chart holds around its joint path. Where a solve ends far from that path, the chart's
rows may no longer be transversal, or the least singular value may hold the motion back.
Then a new chart is laid around the motion, and the solve goes on in it. At the optimum
any rows that are transversal along the motion describe the same motions, but splines of
their coordinates are not the same curves: over the same knots one measure of
self-motion may be a few parts in a thousand faster than another. So several choices of
single joints are tried, and the best one is kept.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Sequence

import numpy as np

from brachis.errors import UnreachableError
from brachis.kinematics import (
    ChartMap,
    ChartRows,
    Newton,
    chart_around,
    null_spaces,
    transversality,
)
from brachis.limits.safeguards import MARGIN
from brachis.optimise.backends import SolverReport, SolveStatus
from brachis.optimise.guess import fit_curves, shortest_time
from brachis.optimise.improve import Solve
from brachis.optimise.program import Program
from brachis.optimise.transcription import phase_in
from brachis.problem.problem import Problem

MARGINS = (0.1, 0.02, MARGIN)
"""Branch margins that are tried in turn; see `solve_by_margin_continuation`."""
HELD_BACK = 1e-4
"""A margin that is nearer to its bound than this holds the motion back."""
_EASY = 2
"""Order of the limits with which solves from afar are easy; see `solve_without_third_order_limits`."""
_ON_ITS_WAY = 1e-3
WORTH_IT = 2e-4
"""A smaller branch margin that shortens the motion by less than this fraction is not worth its sharper turns."""


def solve_by_margin_continuation(
    program: Program, x: np.ndarray, solve: Solve, margins: Sequence[float]
) -> tuple[Program, tuple[SolverReport, ...]]:
    """Solve with ever smaller branch margins, each from the last answer.

    Near a branch boundary the problem is badly conditioned, and a solver that meets the boundary early creeps along it.
    Far from it the solve is easy, and its answer is a good start for a smaller margin. A margin that does not hold the
    motion back, or that hardly shortens it, ends the continuation.

    Parameters
    ----------
    program : Program
    x : (v,) ndarray
        Starting point.
    solve : callable
    margins : sequence of float
        Least branch margins, descending.

    Returns
    -------
    program : Program
        With the last margin for which the solve ended well; with the last one tried if none did.
    reports : tuple of SolverReport
        Of all solves; the last one belongs to `program`.
    """
    solved: list[tuple[Program, SolverReport]] = []
    failed: list[tuple[Program, SolverReport]] = []
    bounds: set[tuple[float, ...]] = set()
    for margin in margins:
        tried = program.with_margin(margin)
        if (
            tried.safeguard_bounds in bounds
        ):  # the closed form has no margins, or the start posture caps them
            continue
        bounds.add(tried.safeguard_bounds)
        outcome = tried, solve(tried, x)
        if outcome[1].status.usable:
            if (
                solved
                and outcome[1].objective > (1.0 - WORTH_IT) * solved[-1][1].objective
            ):
                failed.append(outcome)
                break
            solved.append(outcome)
            x = outcome[1].x
            if tried.safeguard_slack(x) > HELD_BACK:
                break
        else:
            failed.append(outcome)
            if solved or outcome[1].status is SolveStatus.TIME_LIMIT:
                break
            if (
                outcome[1].violation <= _ON_ITS_WAY
            ):  # it ran out of iterations on its way
                x = outcome[1].x
    order = [*failed, *solved]
    return order[-1][0], tuple(report for _, report in order)


def solve_without_third_order_limits(
    program: Program, x: np.ndarray, solve: Solve, margin: float
) -> tuple[np.ndarray, tuple[SolverReport, ...]]:
    """Find a better starting point where limits ask for the third derivative: the answer without them, time-scaled.

    Where the motion must slow down, such limits have local optima in which it all but stops. The fastest motion without
    them has slowed down where it must; its shape over time, slowed down as a whole, leads past them.

    Parameters
    ----------
    program : Program
    x : (v,) ndarray
        Starting point.
    solve : callable
    margin : float
        Least branch margin.

    Returns
    -------
    x : (v,) ndarray
        The given point where there are no such limits, or where that solve failed.
    reports : tuple of SolverReport
        Of the solve without them.
    """
    easier = program.without_orders_above(_EASY)
    if len(easier.limits) == len(program.limits):
        return x, ()
    report = solve(easier.with_margin(margin), x)
    if report.status.usable:
        with contextlib.suppress(UnreachableError):
            x = shortest_time(program, report.x)
    return x, (report,)


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


def solve_in_chart(
    problem: Problem, program: Program, x: np.ndarray, solve: Solve
) -> Solved:
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
    first = MARGINS[:1]
    further = MARGINS[1:]
    program, reports = solve_by_margin_continuation(program, x, solve, first)
    if not reports[-1].status.usable and reports[-1].status not in _OUT_OF_TIME:
        program, more = solve_by_margin_continuation(program, x, solve, further)
        reports += more
    for _ in range(_RECENTRINGS):
        if not reports[-1].status.usable or _follows(program, reports[-1].x):
            break
        moved = move_to_chart(problem, program, reports[-1].x)
        if moved is None:
            break
        other, more = solve_by_margin_continuation(*moved, solve, first)
        if not more[-1].status.usable:
            reports = (*more, *reports)
            break
        gained = more[-1].objective < (1.0 - WORTH_IT) * reports[-1].objective
        program = other
        reports = reports + more
        if not gained:
            break
    if (
        reports[-1].status.usable
        and program.safeguard_slack(reports[-1].x) <= HELD_BACK
    ):
        other, more = solve_by_margin_continuation(
            program, reports[-1].x, solve, further
        )
        if more[-1].status.usable:
            return other, reports + more
        reports = (*more, *reports)
    return program, reports


def best_of_joints(
    problem: Problem, program: Program, report: SolverReport, solve: Solve
) -> Solved:
    """Solve again with joints in place of the chart's rows, and keep the fastest.

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
    best = program
    last = report
    others: list[SolverReport] = []
    for rows in _selections(program, report.x):
        moved = move_to_chart(problem, program, report.x, rows)
        if moved is None:
            continue
        other, reports = solve_by_margin_continuation(*moved, solve, MARGINS)
        others += reports
        if reports[-1].status.usable and reports[-1].objective < last.objective:
            best = other
            last = reports[-1]
    return best, (*(each for each in others if each is not last), last)


def move_to_chart(
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
    (phase,) = program.phases
    (motion,) = program.motions(x)
    t_norm = np.linspace(0.0, 1.0, _DENSE * len(phase.t_norm) + 1)
    try:
        state = phase.joint_map.state(
            *motion.at(t_norm * motion.t_end), t=t_norm * motion.t_end
        )
        s = state.y[:, 0]
        chart = chart_around(problem.task_map, problem.path, s, state.q, rows)
        other = Program([phase_in(problem, chart, phase.grid)])
        fit = fit_curves(
            other.phases[0], motion.t_end, t_norm, chart.curves(s, state.q)
        )
        return other, shortest_time(other, fit)
    except UnreachableError:
        return None


def _self_motion(program: Program, x: np.ndarray) -> np.ndarray:
    """Bases of the null spaces of the task Jacobian, (K, n, r), along a motion."""
    (state,) = program.states(x)
    (phase,) = program.phases
    chart = phase.joint_map
    assert isinstance(chart, ChartMap)
    return null_spaces(Newton(chart.task_map).task_coordinates(state.q)[1])


def _follows(program: Program, x: np.ndarray) -> bool:
    """Tell whether the chart still does for the motion."""
    try:
        (phase,) = program.phases
        null = _self_motion(program, x)
        chart = phase.joint_map
        s = program.states(x)[0].y[:, 0]
        assert isinstance(chart, ChartMap)
        own = transversality(chart.rows.at(s)[0], null).min()
        return program.safeguard_slack(x) > HELD_BACK and bool(own >= _TRANSVERSAL)
    except UnreachableError:
        return False


def _selections(program: Program, x: np.ndarray) -> list[ChartRows]:
    """Rows that select joints and are transversal along the motion, the most transversal ones first."""
    null = _self_motion(program, x)
    n, r = null.shape[1:]
    choices = [
        list(joints)
        for joints in itertools.islice(itertools.combinations(range(n), r), _CHOICES)
    ]
    least = [
        float(transversality(np.eye(n)[joints][None], null).min()) for joints in choices
    ]
    ranked = sorted(range(len(choices)), key=lambda number: -least[number])[
        : _SELECTED[min(r, 2)]
    ]
    return [
        ChartRows.constant(np.eye(n)[choices[number]])
        for number in ranked
        if least[number] >= SELECTABLE
    ]
