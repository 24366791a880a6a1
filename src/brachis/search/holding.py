"""Loads of the arm at rest along known joint paths, compared with limits on postures and on means."""

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
"""Ratio of a load at rest to the limit on its mean above which the load is the most likely reason for a failure."""
_TOO_HEAVY = 1.05
"""The same ratio, in every posture of the path, above which a motion is out of the question."""
_FAR_TOO_HEAVY = 1.5
"""The same ratio for a redundant robot, which has more joint paths than those that were found."""
_S = np.linspace(0.0, 1.0, 101)
"""Path coordinates at which loads at rest are computed."""


def explain_beyond(
    problem: Problem, limit: Limit, s: np.ndarray, q: np.ndarray
) -> tuple[float, PathError] | None:
    """Tell where, and by how much, the arm at rest exceeds a limit along a joint path; None if it does so nowhere.

    Parameters
    ----------
    problem : Problem
    limit : Limit
    s : (S,) ndarray
        Path coordinates, ascending.
    q : (S, n) ndarray
        Postures at these coordinates, rad or m.
    """
    values, beyond = beyond_at_rest(limit, q, problem.task.refinement.tolerance)
    station, column = np.unravel_index(np.argmax(beyond), beyond.shape)
    worst = float(beyond[station, column])
    if worst <= 0.0:
        return None
    where = s[beyond[:, column] > 0.0]
    label = limit.labels[column]
    figure, allowed = in_figures(limit, int(column), float(values[station, column]))
    error = PathError(
        f"the {label.kind} limit of {label.subject!r} {limit.refusal}",
        s_interval=(float(where[0]), float(where[-1])),
        where="path",
        found=f"{figure}{label.after} at s = {s[station]:.3g}",
        allowed=f"{allowed}{label.after}",
        hint="Move the path",
    )
    remedies = load_remedies(problem.robot, limit, int(column), 1.0 + worst)
    return worst, error.with_remedies(*remedies)


def explain_postures(guesses: Sequence[InitialGuess]) -> PathError | None:
    """If all joint paths exceed a limit on postures, explain the excess on the joint path where it is smallest."""
    nearest = []
    for guess in guesses:
        q = postures_along(guess, _S)
        if q is None:
            continue
        of_postures = [limit for limit in guess.problem.limits if limit.is_of_postures]
        excesses = [
            explain_beyond(guess.problem, limit, _S, q) for limit in of_postures
        ]
        exceeded = [excess for excess in excesses if excess is not None]
        if not exceeded:
            return None
        nearest.append(max(exceeded, key=itemgetter(0)))
    return min(nearest, key=itemgetter(0))[1] if nearest else None


class _Load(NamedTuple):
    """A load needed to hold the arm: its smallest, largest and mean ratio to the limit on its mean."""

    limit: Limit
    column: int
    label: Label
    least: float
    largest: float
    mean: float


def explain_holding(
    guesses: Sequence[InitialGuess], *, everywhere: bool = False
) -> PlanningError | None:
    """Tell which limits on mean loads are too low to hold the arm along all joint paths; None if none is.

    Parameters
    ----------
    guesses : sequence of InitialGuess
    everywhere : bool, optional
        Whether every single posture has to exceed a limit, and not only the mean over the path.
    """

    def measure(load: _Load) -> float:
        return load.least if everywhere else load.mean

    loads_by_guess = [_loads_along(guess) for guess in guesses]
    known = [loads for loads in loads_by_guess if loads is not None]
    if not known or not all(known):
        return None
    loads = min(known, key=lambda loads: max(map(measure, loads)))
    worst = max(loads, key=measure)
    is_redundant = guesses[0].joint_map.r > 0
    # Before any plan is tried, a load is refused only if no motion is possible. After a failure, it is the most likely
    # reason.
    hopeless = _FAR_TOO_HEAVY if is_redundant else _TOO_HEAVY
    needed = hopeless if everywhere else _HEAVY
    if measure(worst) < needed:
        return None
    further_loads = [
        load
        for load in loads
        if load is not worst and load.limit is worst.limit and measure(load) >= needed
    ]
    where = "the best joint path that was found" if is_redundant else "the path"
    return _explain_loads(guesses[0].problem.robot, worst, further_loads, where)


def _explain_loads(
    robot: Robot, worst: _Load, further_loads: Sequence[_Load], where: str
) -> PlanningError:
    """Return the error for the limit with the largest load, which also names further limits that are too low."""
    label = worst.label
    bounds = worst.limit.bounds
    figure = next(bound.figure for bound in bounds if bound.column == worst.column)
    low, high = (f"{figure * ratio:.4g}" for ratio in (worst.least, worst.largest))
    taken = f"{low} to {high}" if low != high else low
    mean = f"{worst.mean * figure:.4g}"
    cause = f"the {label.kind} limit of {label.subject!r} is too low to hold the arm against gravity along {where}"
    if further_loads:
        names = ", ".join(repr(load.label.subject) for load in further_loads)
        cause += f", and so is that of {names}"
    remedies: dict[str, Remedy] = {}
    for load in (worst, *further_loads):
        for remedy in load_remedies(robot, load.limit, load.column, load.mean):
            earlier = remedies.get(remedy.key, remedy)
            remedies[remedy.key] = max(
                earlier, remedy, key=lambda change: abs(change.guess - change.current)
            )
    error = PlanningError(
        cause,
        where=label.key or worst.limit.name,
        found=f"{taken} {label.unit} to hold the arm, {mean} {label.unit} on average (root mean square)",
        allowed=f"{figure:.4g} {label.unit}",
        hint="Move the path to postures that are easier to hold, or change the mounting of the robot",
    )
    return error.with_remedies(*remedies.values())


def _loads_along(guess: InitialGuess) -> list[_Load] | None:
    """List the loads needed to hold the arm along a guess, for all limits on means; None if it has no postures."""
    q = postures_along(guess, _S)
    if q is None:
        return None
    loads = []
    for limit in guess.problem.limits:
        if limit.guarantee.is_mean:
            values = limit.values(Moments.at_rest(q))
            ratios = np.abs(limit.ratio(values))
            means = np.abs(limit.ratio(values.mean(axis=0, keepdims=True)))
            figures = (ratios.min(axis=0), ratios.max(axis=0), means[0])
            for column, label in enumerate(limit.labels):
                column_figures = (float(figure[column]) for figure in figures)
                loads.append(_Load(limit, column, label, *column_figures))
    return loads
