"""What a limit costs: the derivative of t_E with respect to every limit, from the multipliers.

Every limit lists the figures that a user could change, and the rates d at which the bounds of its rows move outwards if
one of these figures is relaxed (`brachis.limits.Bound`). With the multipliers w of these rows (see `multipliers`)

    dt_E / d(figure) = -sum w d.

For a motion along the timing of its joint path, the multipliers are those of the program over time that improved this
joint path. If there was no such program, the joint path is timed again with each limit in turn slightly raised.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np

from brachis.explain.multipliers import Multipliers
from brachis.explain.timings import FINE_PLACES, lay_course, least_time
from brachis.limits import Bound, Label, Limit
from brachis.optimise.improve import SolvedProgram
from brachis.optimise.program import Program, is_safeguard
from brachis.trajectory.sensitivities import (
    TIMINGS,
    BranchBoundary,
    Sensitivities,
    Sensitivity,
)

LimitFigure = tuple[Label, str | None]
"""A figure that a user could change: the label of the limited quantity, and the end of its range."""
LimitBound = tuple[Limit, Bound]
_RAISED = 1e-3
"""Fraction by which limits are raised."""
_NEAR = 0.02
"""Distance from a limit, as a fraction of the limit, within which the limit may hold a joint path back."""
_LEAST_COST = 1e-9
"""Cost, s, below which a branch boundary is not listed."""


def figures_of(program: Program) -> dict[LimitFigure, list[LimitBound]]:
    """List the figures of a program's limits, each with all its bounds; every phase may have its own limit objects."""
    names = _name_figures(program)
    figures: defaultdict[LimitFigure, list[LimitBound]] = defaultdict(list)
    for limit in program.limits:
        for bound in limit.bounds:
            figures[names[id(limit), bound]].append((limit, bound))
    return figures


def _name_figures(program: Program) -> dict[tuple[int, Bound], LimitFigure]:
    """Identify the figures of all bounds; the label has the figure if parts of a program have different ones."""
    bounds = [(limit, bound) for limit in program.limits for bound in limit.bounds]
    values: defaultdict[LimitFigure, set[float]] = defaultdict(set)
    for limit, bound in bounds:
        values[_figure(limit, bound)].add(bound.figure)
    names = {}
    for limit, bound in bounds:
        label, side = _figure(limit, bound)
        if len(values[label, side]) > 1:
            kind = f"{label.kind} of {bound.figure:.4g}{label.after}"
            label = replace(label, kind=kind)
        names[id(limit), bound] = (label, side)
    return names


def _figure(limit: Limit, bound: Bound) -> LimitFigure:
    """Identify the figure that a user would change to move a bound."""
    label = limit.labels[bound.column]
    if label.cause:
        label = label_of_speed(label.cause, bound.figure, label.key)
    return label, bound.side


def label_of_speed(cause: str, speed: float, key: str) -> Label:
    """Return the label of a speed, m/s, that is given on several parts of the path."""
    return Label("tool", f"{cause} of {speed:.10g} m/s", "m/s", key, cause=cause)


def sensitivities_at(program: Program, multipliers: Multipliers) -> Sensitivities:
    """Derive the cost of every limit from a program and the multipliers at its solution."""
    costs = []
    boundaries = []
    for (label, side), bounds in figures_of(program).items():
        rates = np.zeros(len(program.lower))
        for limit, bound in bounds:
            rates[program.rows_of(limit)[:, bound.column]] = bound.per_unit
        if is_safeguard(limit):
            cost = -multipliers.change(rates)
            if cost > _LEAST_COST:
                boundaries.append(BranchBoundary(label.subject, bound.figure, cost))
            continue
        rows_side = {None: None, "lower": 1.0, "upper": -1.0}[side]
        saved = multipliers.change(rates, rows_side)
        costs.append(_sensitivity(label, bound, saved))
    return Sensitivities(
        tuple(costs),
        tuple(boundaries),
        multipliers.source,
        multipliers.residual,
        not multipliers.active_set.dependent,
    )


def _sensitivity(label: Label, bound: Bound, saved_per_unit: float) -> Sensitivity:
    """Return the sensitivity to a figure whose relaxation by one unit changes t_E by `saved_per_unit`, s."""
    outwards = -1.0 if bound.side == "lower" else 1.0
    derivative = outwards * saved_per_unit
    return Sensitivity(label, bound.side, bound.figure, bound.full_scale, derivative)


def sensitivities_of_timing(solved: SolvedProgram) -> Sensitivities:
    """Time the joint path of a motion again with each limit raised by 0.1 %.

    The result is exact if the joint path is given. If the joint path is free, two limits may be active at once along
    all of it. Raising one of these limits then saves nothing unless the joint path changes too.

    Parameters
    ----------
    solved : SolvedProgram
        A motion timed by the phase plane.

    Returns
    -------
    Sensitivities
        The sensitivities to limits that a slower motion does not relieve are zero.
    """
    names = _name_figures(solved.program)
    changes: defaultdict[LimitFigure, float] = defaultdict(float)
    bounds: dict[LimitFigure, Bound] = {}
    for phase, x in solved.program.split(solved.x):
        course = lay_course(phase, x, FINE_PLACES)
        before = least_time(course)
        if course is None or np.isnan(before):
            continue
        motion = phase.state(x)
        for limit in phase.limits:
            if is_safeguard(limit):
                continue
            is_near = np.zeros(len(limit.labels), dtype=bool)
            if limit.longer_time == "relieves":
                violation = limit.violation(limit.values(motion))
                is_near = violation.max(axis=0) > -_NEAR
            for bound in limit.bounds:
                figure = names[id(limit), bound]
                bounds[figure] = bound
                if is_near[bound.column]:
                    sides = {None: [0, 1], "lower": [0], "upper": [1]}[bound.side]
                    nearer = np.zeros((2, len(course.path.p) - 1, len(limit.labels)))
                    amount = _RAISED * bound.full_scale * bound.per_unit
                    nearer[sides, :, bound.column] = -amount
                    raised = least_time(course, narrower={limit: nearer})
                    changes[figure] += float(np.nan_to_num(raised - before))
    costs = [
        _sensitivity(label, bound, changes[label, side] / (_RAISED * bound.full_scale))
        for (label, side), bound in bounds.items()
    ]
    return Sensitivities(tuple(costs), (), TIMINGS, 0.0, unique=True)
