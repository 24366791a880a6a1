"""The choice of single joints whose positions take the place of a chart's rows.

At the optimum any rows that are transversal along the motion describe the same motions. But splines of their
coordinates are different curves: over the same knots, one measure of self-motion may give a motion that is a few tenths
of a percent faster than with another measure. So several choices of single joints are tried, and the best one is kept.
"""

from __future__ import annotations

import itertools
from functools import partial

import numpy as np

from brachis.errors import UnreachableError
from brachis.kinematics import ChartMap, ChartRows, Newton, chart_around, transversality
from brachis.optimise.guess import fit_curves, shortest_time
from brachis.optimise.improve import Change, Solve, SolvedProgram, attempt_once, improve
from brachis.optimise.program import Program
from brachis.optimise.transcription import maps_by_leg, program_over
from brachis.problem.problem import Problem

SELECTABLE = 0.05
"""Minimum transversality, along the motion, of joints that may take the place of the chart's rows."""


def best_of_joints(
    problem: Problem, solved: SolvedProgram, solve: Solve
) -> SolvedProgram:
    """Solve again in a chart around the solution, and with joints in place of its rows; keep the fastest motion.

    Parameters
    ----------
    problem : Problem
    solved : SolvedProgram
        A program in a chart.
    solve : callable

    Returns
    -------
    SolvedProgram
    """
    choices = [None, *_select_joints(solved)]
    points = [move_to_chart(problem, solved, rows) for rows in choices]
    return improve(
        solved,
        [_go_to(point) for point in points if point is not None],
        partial(attempt_once, solve),
        least_gain=0.0,
        go_on_above=None,
    )


def _go_to(point: tuple[Program, np.ndarray]) -> Change:
    """Return the change to a program and a point, regardless of the motion that was kept so far."""
    return lambda _fastest: point


def move_to_chart(
    problem: Problem, solved: SolvedProgram, rows: ChartRows | None = None
) -> tuple[Program, np.ndarray] | None:
    """Write a motion in the coordinates of a chart around it; None if there is no such chart.

    Parameters
    ----------
    problem : Problem
    solved : SolvedProgram
    rows : ChartRows, optional
        Rows of the chart; if not given, they are chosen anew, as by `chart_around`.

    Returns
    -------
    program : Program
    x : (v,) ndarray
        The same motion, except for what splines of the new coordinates cannot represent.
    """
    try:
        motions = solved.program.motions(solved.report.x)
        dense = []
        for phase, motion in zip(solved.program.phases, motions, strict=True):
            t_norm = np.linspace(0.0, 1.0, 4 * len(phase.t_norm) + 1)
            times = t_norm * motion.t_end
            state = phase.joint_map.state(*motion.at(times), t=times)
            dense.append((motion.t_end, t_norm, state))
        s = np.concatenate([state.s for _, _, state in dense])
        q = np.concatenate([state.q for _, _, state in dense])
        chart = chart_around(problem.task_map, problem.path, s, q, rows)
        starts = np.array([state.q[0] for _, _, state in dense])
        maps = maps_by_leg(problem, chart, starts)
        grids = [phase.grid for phase in solved.program.phases]
        program = program_over(problem, maps, grids)
        x_by_phase = []
        for phase, (t_end, t_norm, state) in zip(program.phases, dense, strict=True):
            curves = chart.curves(state.s, state.q)
            x_by_phase.append(fit_curves(phase, t_end, t_norm, curves))
        return program, shortest_time(program, np.concatenate(x_by_phase))
    except UnreachableError:
        return None


def _select_joints(solved: SolvedProgram) -> list[ChartRows]:
    """Return rows that select joints and are transversal along the motion, the most transversal ones first."""
    chart = solved.program.phases[0].joint_map
    assert isinstance(chart, ChartMap)
    states = solved.program.states(solved.report.x)
    q = np.concatenate([state.q for state in states])
    null = Newton(chart.task_map).self_motions(q)
    n, r = null.shape[1:]
    # With one redundant joint three choices are tried; with several only one, because these solves take longest.
    count = (0, 3, 1)[min(r, 2)]
    selections = []
    for joints in itertools.islice(itertools.combinations(range(n), r), 500):
        rows = np.eye(n)[list(joints)]
        least = float(transversality(rows[None], null).min())
        if least >= SELECTABLE:
            selections.append((least, rows))
    selections.sort(key=lambda item: -item[0])
    return [ChartRows.constant(rows) for _, rows in selections[:count]]
