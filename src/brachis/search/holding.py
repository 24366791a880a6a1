"""Loads of the arm at rest along the joint paths that are known, beside limits on postures and on means."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from brachis.errors import Remedy
from brachis.limits import Label, Limit, Moments
from brachis.optimise.candidate import InitialGuess
from brachis.problem.feasibility import beyond_at_rest, in_figures, load_remedies
from brachis.problem.problem import Problem
from brachis.robot import Robot
from brachis.search.failure import Failure
from brachis.search.phase_plane import postures_along

_HEAVY = 0.95
"""Ratio of a load at rest to a limit on its mean above which that is the most likely reason of a failure."""
_TOO_HEAVY = 1.05
"""Such a ratio, in every posture of the path, that is out of the question."""
_FAR_TOO_HEAVY = 1.5
"""The same for the joint paths that were found, where a redundant robot has others."""
_S = np.linspace(0.0, 1.0, 101)
"""Path coordinates at which the arm is held at rest."""


class Beyond(NamedTuple):
    """A limit that the arm exceeds at rest along a joint path: the largest violation, and what to say of it."""

    violation: float
    failure: Failure


def explain_beyond(
    problem: Problem, limit: Limit, s: np.ndarray, q: np.ndarray
) -> Beyond | None:
    """Tell where, and by how much, the arm at rest is beyond a limit along a joint path; None: nowhere.

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
    station, column = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    worst = float(beyond[station, column])
    if worst <= 0.0:
        return None
    where = s[beyond[:, column] > 0.0]
    label = limit.labels[column]
    found, allowed = in_figures(limit, int(column), float(values[station, column]))
    failure = Failure(
        f"the {label.kind} limit of {label.subject!r} {limit.refusal}",
        phase="path",
        s_interval=(float(where[0]), float(where[-1])),
        where="path",
        found=f"{found}{label.after} at s = {s[station]:.3g}",
        needed=f"{allowed}{label.after}",
        hint="Move the path",
        remedies=load_remedies(problem.robot, limit, int(column), 1.0 + worst),
    )
    return Beyond(worst, failure)


def explain_postures(starts: Sequence[InitialGuess]) -> Failure | None:
    """Tell which limit on postures stands in the way, if all joint paths exceed one: along the nearest of them."""
    nearest: list[Beyond] = []
    for start in starts:
        q = postures_along(start, _S)
        if q is None:
            continue
        of_postures = [own for own in start.problem.limits if own.is_of_postures]
        found = [explain_beyond(start.problem, limit, _S, q) for limit in of_postures]
        exceeded = [each for each in found if each is not None]
        if not exceeded:
            return None
        nearest.append(max(exceeded, key=lambda each: each.violation))
    if not nearest:
        return None
    return min(nearest, key=lambda each: each.violation).failure


class _Load(NamedTuple):
    """What holding the arm takes of a limit of a mean: least, largest and mean ratio to the limit."""

    limit: Limit
    column: int
    least: float
    largest: float
    mean: float

    @property
    def label(self) -> Label:
        """What the column is."""
        return self.limit.labels[self.column]

    @property
    def figure(self) -> float:
        """The figure that the user gave."""
        bounds = self.limit.bounds
        return next(bound.figure for bound in bounds if bound.column == self.column)


def explain_holding(
    starts: Sequence[InitialGuess], *, everywhere: bool = False
) -> Failure | None:
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
) -> Failure:
    """Say what holding the arm takes of the limit that leaves least, and which others leave too little."""
    label = worst.label
    figure = worst.figure
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
            remedies[remedy.key] = max(known, remedy, key=_change)
    return Failure(
        cause,
        where=label.key or worst.limit.name,
        found=f"{taken} {label.unit} to hold the arm, {mean} {label.unit} on average (root mean square)",
        needed=f"{figure:.4g} {label.unit}",
        hint="Move the path so that its postures need less, or change the mounting of the robot",
        remedies=tuple(remedies.values()),
    )


def _change(remedy: Remedy) -> float:
    """By how much a number changes."""
    return abs(remedy.guess - remedy.asked)


def _loads_along(start: InitialGuess) -> list[_Load] | None:
    """List what holding the arm along a guess takes of all limits of means; None where it has no postures."""
    q = postures_along(start, _S)
    if q is None:
        return None
    return [
        load
        for limit in start.problem.limits
        if limit.guarantee.is_mean
        for load in _loads_at_rest(limit, q)
    ]


def _loads_at_rest(limit: Limit, q: np.ndarray) -> list[_Load]:
    """List what postures (S, n) at rest take of each column of a limit of a mean."""
    values = limit.values(Moments.at_rest(q))
    ratios = np.abs(limit.ratio(values))
    means = np.abs(limit.ratio(values.mean(axis=0, keepdims=True)))[0]
    return [
        _Load(limit, column, float(own.min()), float(own.max()), float(mean))
        for column, (own, mean) in enumerate(zip(ratios.T, means, strict=True))
    ]
