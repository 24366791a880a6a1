"""Loads of the arm at rest along the joint paths that are known, beside limits on postures and on means."""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from brachis.errors import PathError, PlanningError, Remedy
from brachis.limits import Label, Limit, Moments
from brachis.problem.feasibility import beyond_at_rest, in_figures, load_remedies
from brachis.problem.problem import Problem
from brachis.robot import Robot
from brachis.search.phase_plane import postures_along
from brachis.search.stages import InitialGuess

_HEAVY = 0.95
"""Ratio of a load at rest to a limit on its mean above which that is the most likely reason of a failure."""
_TOO_HEAVY = 1.05
"""Such a ratio, in every posture of the path, that is out of the question."""
_FAR_TOO_HEAVY = 1.5
"""The same for the joint paths that were found, where a redundant robot has others."""
_S = np.linspace(0.0, 1.0, 101)
"""Path coordinates at which the arm is held at rest."""


def explain_beyond(
    problem: Problem, limit: Limit, s: np.ndarray, q: np.ndarray
) -> tuple[float, PathError] | None:
    """Tell by how much, and where, the arm at rest is beyond a limit along a joint path; None: nowhere.

    Parameters
    ----------
    problem : Problem
    limit : Limit
    s : (S,) ndarray
        Path coordinates, ascending.
    q : (S, n) ndarray
        Postures there, rad or m.
    """
    values, beyond = beyond_at_rest(limit, q, problem.task.refinement.tolerance)
    station, column = np.unravel_index(np.argmax(beyond), beyond.shape)
    worst = float(beyond[station, column])
    if worst <= 0.0:
        return None
    where = s[beyond[:, column] > 0.0]
    label = limit.labels[column]
    found, allowed = in_figures(limit, int(column), float(values[station, column]))
    error = PathError(
        f"the {label.kind} limit of {label.subject!r} {limit.refusal}",
        s_interval=(float(where[0]), float(where[-1])),
        where="path",
        found=f"{found}{label.after} at s = {s[station]:.3g}",
        allowed=f"{allowed}{label.after}",
        hint="Move the path",
    )
    remedies = load_remedies(problem.robot, limit, int(column), 1.0 + worst)
    return worst, error.with_remedies(*remedies)


def explain_postures(starts: Sequence[InitialGuess]) -> PathError | None:
    """Tell which limit on postures stands in the way, if all joint paths exceed one: along the nearest of them."""
    nearest = []
    for start in starts:
        q = postures_along(start, _S)
        if q is None:
            continue
        of_postures = [own for own in start.problem.limits if own.is_of_postures]
        found = [explain_beyond(start.problem, limit, _S, q) for limit in of_postures]
        exceeded = [each for each in found if each is not None]
        if not exceeded:
            return None
        nearest.append(max(exceeded, key=itemgetter(0)))
    return min(nearest, key=itemgetter(0))[1] if nearest else None


class _Load(NamedTuple):
    """What holding the arm takes of a limit of a mean: least, largest and mean ratio to the limit."""

    limit: Limit
    column: int
    label: Label
    least: float
    largest: float
    mean: float


def explain_holding(
    starts: Sequence[InitialGuess], *, everywhere: bool = False
) -> PlanningError | None:
    """Tell which limits of a mean leave too little for holding the arm along all joint paths; None: none does.

    Parameters
    ----------
    starts : sequence of InitialGuess
    everywhere : bool, optional
        Whether each posture has to exceed a limit by itself, not their mean alone.
    """

    def measure(load: _Load) -> float:
        return load.least if everywhere else load.mean

    by_start = [_loads_along(start) for start in starts]
    known = [loads for loads in by_start if loads is not None]
    if not known or not all(known):
        return None
    loads = min(known, key=lambda loads: max(map(measure, loads)))
    worst = max(loads, key=measure)
    is_redundant = starts[0].joint_map.r > 0
    # Before a plan is tried it has to be out of the question; afterwards it is the most likely reason.
    hopeless = _FAR_TOO_HEAVY if is_redundant else _TOO_HEAVY
    needed = hopeless if everywhere else _HEAVY
    if measure(worst) < needed:
        return None
    others = [
        own
        for own in loads
        if own is not worst and own.limit is worst.limit and measure(own) >= needed
    ]
    where = "the best joint path that was found" if is_redundant else "the path"
    return _explain_loads(starts[0].problem.robot, worst, others, where)


def _explain_loads(
    robot: Robot, worst: _Load, others: Sequence[_Load], where: str
) -> PlanningError:
    """Say what holding the arm takes of the limit that leaves least, and which others leave too little."""
    label = worst.label
    bounds = worst.limit.bounds
    figure = next(bound.figure for bound in bounds if bound.column == worst.column)
    low, high = (f"{figure * ratio:.4g}" for ratio in (worst.least, worst.largest))
    taken = f"{low} to {high}" if low != high else low
    mean = f"{worst.mean * figure:.4g}"
    cause = f"the {label.kind} limit of {label.subject!r} is too low to hold the arm against gravity along {where}"
    if others:
        names = ", ".join(repr(own.label.subject) for own in others)
        cause += f", and so is that of {names}"
    remedies: dict[str, Remedy] = {}
    for own in (worst, *others):
        for remedy in load_remedies(robot, own.limit, own.column, own.mean):
            known = remedies.get(remedy.key, remedy)
            remedies[remedy.key] = max(
                known, remedy, key=lambda own: abs(own.guess - own.asked)
            )
    error = PlanningError(
        cause,
        where=label.key or worst.limit.name,
        found=f"{taken} {label.unit} to hold the arm, {mean} {label.unit} on average (root mean square)",
        allowed=f"{figure:.4g} {label.unit}",
        hint="Move the path so that its postures need less, or change the mounting of the robot",
    )
    return error.with_remedies(*remedies.values())


def _loads_along(start: InitialGuess) -> list[_Load] | None:
    """List what holding the arm along a guess takes of all limits of means; None where it has no postures."""
    q = postures_along(start, _S)
    if q is None:
        return None
    loads = []
    for limit in start.problem.limits:
        if limit.guarantee.is_mean:
            values = limit.values(Moments.at_rest(q))
            ratios = np.abs(limit.ratio(values))
            means = np.abs(limit.ratio(values.mean(axis=0, keepdims=True)))
            figures = (ratios.min(axis=0), ratios.max(axis=0), means[0])
            for column, label in enumerate(limit.labels):
                own = (float(figure[column]) for figure in figures)
                loads.append(_Load(limit, column, label, *own))
    return loads
