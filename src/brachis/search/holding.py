"""Limits of means, such as root-mean-square torques, that the arm exceeds when it does no more than hold itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.errors import PlanningError
from brachis.limits import Limit, Moments
from brachis.optimise.candidate import InitialGuess
from brachis.problem.feasibility import load_remedies
from brachis.search.phase_plane import along

_STATIONS = 101
_HOPELESS = 1.05
"""Ratio of what holding takes to its limit from which on no plan is tried, where nothing helps to hold the arm."""
_SUSPECT = 0.95
"""Ratio from which on the limit is the reason where no plan was found."""


def check_holding(starts: Sequence[InitialGuess]) -> None:
    """Refuse a limit that all postures of all joint paths exceed at rest, before plans are tried.

    Friction may help to hold the arm, and a motion between different speeds may be a fall: these are tried.

    Raises
    ------
    PlanningError
    """
    if not starts:
        return
    problem = starts[0].problem
    rubs = bool(
        (problem.robot.friction.viscous + problem.robot.friction.coulomb > 0.0).any()
    )
    error = (
        None
        if rubs or any(problem.end_rates)
        else explain_holding(starts, everywhere=True)
    )
    if error is not None:
        raise error


def explain_holding(
    starts: Sequence[InitialGuess], *, everywhere: bool = False
) -> PlanningError | None:
    """Tell which limit of a mean leaves too little for holding the arm along all joint paths; None: none does.

    Parameters
    ----------
    starts : sequence of InitialGuess
    everywhere : bool, optional
        Whether each posture has to exceed the limit by itself, not their mean alone.
    """
    found: tuple[float, Limit, int, np.ndarray, float] | None = None
    for start in starts:
        q = start.joint_map.postures(
            along(start.joint_path, np.linspace(0.0, 1.0, _STATIONS))
        )
        if not np.isfinite(q).all():
            continue
        worst: tuple[float, Limit, int, np.ndarray, float] | None = None
        for limit in start.problem.limits:
            if not limit.guarantee.is_mean:
                continue
            values = limit.values(Moments.at_rest(q))
            ratios = np.abs(limit.ratio(values))
            means = np.abs(limit.ratio(values.mean(axis=0, keepdims=True)))[0]
            measure = ratios.min(axis=0) if everywhere else means
            column = int(np.argmax(measure))
            if worst is None or measure[column] > worst[0]:
                worst = (
                    float(measure[column]),
                    limit,
                    column,
                    ratios[:, column],
                    float(means[column]),
                )
        if worst is None:
            return None
        if found is None or worst[0] < found[0]:
            found = worst
    if found is None or found[0] < (_HOPELESS if everywhere else _SUSPECT):
        return None
    _, limit, column, ratios, mean = found
    return _error(starts[0], limit, column, ratios, mean)


def _error(
    start: InitialGuess, limit: Limit, column: int, ratios: np.ndarray, mean: float
) -> PlanningError:
    """Make the error that names the limit."""
    label = limit.labels[column]
    figure = next(bound.figure for bound in limit.bounds if bound.column == column)
    low = figure * ratios.min()
    high = figure * ratios.max()
    taken = (
        f"{low:.4g} to {high:.4g} {label.unit}"
        if f"{low:.4g}" != f"{high:.4g}"
        else f"{low:.4g} {label.unit}"
    )
    return PlanningError(
        f"the {label.kind} limit of {label.subject!r} is too low to hold the arm against gravity along the path",
        where=label.key or limit.name,
        found=f"{taken} to hold the arm, {mean * figure:.4g} {label.unit} on average (root mean square)",
        allowed=f"{figure:.4g} {label.unit}",
        hint="Lead the path through postures that take less, or mount the robot otherwise",
    ).with_remedies(*load_remedies(start.problem.robot, limit, column, mean))
