"""Initial guesses: a smooth s(t), redundant joints from numeric inverse kinematics along the path, a long enough t_E.

As in the paper, a numeric inverse kinematics carries the start posture along the path. Its null-space motion climbs the
branch margin and stays within the joint ranges, so that the closed form can follow. The end time is then stretched
until all limits hold, which gives the solver a feasible start wherever gravity leaves one.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brachis.bspline import basis_matrix
from brachis.errors import UnreachableError
from brachis.ik import margin_gradient
from brachis.kinematics import Decomposition
from brachis.nlp.motion import Motion
from brachis.nlp.transcription import Transcription

_FEWEST_STEPS, _MOST_STEPS, _STEP_LENGTH = 24, 1000, 0.05  # metres a step
_DAMPING = 1e-6
_STRETCH = 1.1
_CORRECTIONS = 5
_UNFOLDING_STEPS = 20
_UNFOLDING_STEP = 0.06
_LARGEST_STEP = 0.2
_ROOMY = 0.05
_SHRINKAGE = 0.8
_SHORTEST_TIME, _LONGEST_TIME = 0.01, 200.0
_RANGE_PUSH = 20.0
_FIT_DENSITY = 4


@dataclass(frozen=True)
class Strategy:
    """How numeric inverse kinematics uses the null space.

    Attributes
    ----------
    push : float
        Strength with which a branch margin below `threshold` is raised.
    threshold : float
        Dimensionless.
    drift : float
        Constant motion along the first null-space direction, rad or m per unit s; other valleys lie beyond it.
    centre : float
        Strength with which joints are pulled to the middle of their ranges.
    """

    push: float
    threshold: float
    drift: float = 0.0
    centre: float = 0.0


STRATEGIES = (
    Strategy(push=2.0, threshold=0.4),
    Strategy(push=6.0, threshold=0.8),
    Strategy(push=4.0, threshold=0.6, drift=1.0),
    Strategy(push=4.0, threshold=0.6, drift=-1.0),
    Strategy(push=15.0, threshold=1.0),
    Strategy(push=2.0, threshold=0.1, centre=12.0),
    Strategy(push=4.0, threshold=0.6, drift=3.0),
    Strategy(push=4.0, threshold=0.6, drift=-3.0),
)


def guesses(problem: Transcription) -> Iterator[np.ndarray]:
    """Yield starting points x whose every collocation point is reachable, the most natural first.

    Parameters
    ----------
    problem : Transcription

    Yields
    ------
    (v,) ndarray
    """
    for course in numeric_courses(problem.decomposition):
        x = starting_point(problem, course)
        if x is not None:
            yield x


def numeric_courses(decomposition: Decomposition) -> Iterator[np.ndarray]:
    """Yield courses one after the other; where the first one comes near a branch boundary, the roomiest ones first.

    Parameters
    ----------
    decomposition : Decomposition

    Yields
    ------
    (steps, 1 + r) ndarray
        See `numeric_course`.
    """
    strategies = STRATEGIES if decomposition.r else STRATEGIES[:1]
    courses = (numeric_course(decomposition, strategy) for strategy in strategies)
    found = (course for course in courses if course is not None)
    first = next(found, None)
    if first is None:
        return
    if _room(decomposition, first) > _ROOMY:
        yield first
        yield from found
    else:
        yield from sorted((first, *found), key=lambda course: -_room(decomposition, course))


def _room(decomposition: Decomposition, course: np.ndarray) -> float:
    """Return the least branch margin along a course; -inf where the branch cannot follow it."""
    q = decomposition.postures(course)
    if not np.isfinite(q).all():
        return -np.inf
    return float(decomposition.solver.branch_margins(q, decomposition.branch).min(initial=np.inf))


def numeric_course(decomposition: Decomposition, strategy: Strategy) -> np.ndarray | None:
    """Redundant joints along the path by numeric inverse kinematics from the start posture.

    Near a branch boundary the posture is unfolded first, while the tool stays where it is: there any motion of the tool
    would need fast joints.

    Parameters
    ----------
    decomposition : Decomposition
    strategy : Strategy

    Returns
    -------
    (steps, 1 + r) ndarray or None
        Successive values of s and the redundant joints; None where the target cannot be followed.
    """
    if decomposition.r == 0:
        return np.array([[0.0], [1.0]])
    steps = int(np.clip(np.ceil(decomposition.path.length / _STEP_LENGTH), _FEWEST_STEPS, _MOST_STEPS))
    s = np.linspace(0.0, 1.0, steps + 1)
    targets = decomposition.path.sample(s).target
    q = decomposition.start.astype(float)
    previous = np.zeros_like(q)
    course = [np.append(0.0, q[decomposition.redundant])]
    for _ in range(_UNFOLDING_STEPS):
        if (
            decomposition.solver.branch_margins(q[None], decomposition.branch).min(initial=1.0)
            > 0.5 * strategy.threshold
        ):
            break
        moved = _follow(decomposition, strategy, q, previous, targets[0], step_s=None)
        if moved is None:
            break
        q, previous = moved
        course.append(np.append(0.0, q[decomposition.redundant]))
    for station, target in zip(s[1:], targets[1:], strict=True):
        moved = _follow(decomposition, strategy, q, previous, target, step_s=1.0 / steps)
        if moved is None:
            return None
        q, previous = moved
        course.append(np.append(station, q[decomposition.redundant]))
    return np.array(course)


def _follow(
    decomposition: Decomposition,
    strategy: Strategy,
    q: np.ndarray,
    previous: np.ndarray,
    target: np.ndarray,
    *,
    step_s: float | None,
) -> tuple[np.ndarray, np.ndarray] | None:
    """One step to the next target: the new posture and the null-space motion made; None if it is not met.

    `step_s` is the step in s, None for unfolding on the spot.
    """
    kinematics = decomposition.kinematics
    for correction in range(_CORRECTIONS):
        miss = decomposition.task_space.difference(target, kinematics.position(q[None])[0])
        if correction and np.abs(miss).max() < 1e-3:  # noqa: PLR2004  (the closed form takes it from here)
            return q, previous
        jacobian = kinematics.jacobian(q[None])[0]
        square = jacobian @ jacobian.T + _DAMPING * np.eye(len(miss))
        step = jacobian.T @ np.linalg.solve(square, miss)
        if correction == 0:
            wish = _wish(decomposition, strategy, q, previous)
            free = wish - jacobian.T @ np.linalg.solve(square, jacobian @ wish)
            size = float(np.abs(free).max())
            largest = _UNFOLDING_STEP if step_s is None else _LARGEST_STEP
            factor = largest / max(size, 1e-9)
            previous = free * (factor if step_s is None else min(step_s, factor))
            step = step + previous
        q = q + step
    return None


def _wish(decomposition: Decomposition, strategy: Strategy, q: np.ndarray, previous: np.ndarray) -> np.ndarray:
    """Joint motion per unit s that the null space may realise, (n,)."""
    limits = decomposition.robot.limits
    wish = np.zeros_like(q)
    margins = decomposition.solver.branch_margins(q[None], decomposition.branch)[0]
    if np.any(margins < strategy.threshold):
        gradients = margin_gradient(decomposition.solver, q[None], decomposition.branch)[0]
        shortfall = np.clip(strategy.threshold - margins, 0.0, 2.0 * strategy.threshold)
        wish += strategy.push * shortfall @ gradients
    # A tenth of the range, or of a radian or metre where it is open, is kept clear at each end.
    stroke = limits.position_upper - limits.position_lower
    clear = 0.1 * np.where(np.isfinite(stroke), stroke, 1.0)
    wish += _RANGE_PUSH * np.maximum(limits.position_lower + clear - q, 0.0)
    wish -= _RANGE_PUSH * np.maximum(q - limits.position_upper + clear, 0.0)
    if strategy.centre:
        ranged = np.isfinite(stroke)
        middle = limits.position_lower[ranged] + 0.5 * stroke[ranged]
        wish[ranged] += strategy.centre * (middle - q[ranged])
    if strategy.drift:
        direction = previous if previous.any() else np.eye(len(q))[decomposition.redundant[0]]
        wish += strategy.drift * direction / np.linalg.norm(direction)
    return wish


def starting_point(problem: Transcription, course: np.ndarray) -> np.ndarray | None:
    """Fit splines to a course, and stretch the time until the limits hold.

    Control points taken from the course itself smooth it; where that leaves the branch, least squares follow it closer.

    Parameters
    ----------
    problem : Transcription
    course : (S, 1 + r) ndarray
        Successive values of s and the redundant joints.

    Returns
    -------
    (v,) ndarray or None
        None where the fit is out of reach at a collocation point.
    """
    tau = problem.splines[0].greville
    smooth = Motion(1.0, problem.knots, problem.degree, _timed(course, tau).T)
    dense = np.linspace(0.0, 1.0, _FIT_DENSITY * len(problem.knots))
    for x in (problem.variables_from(smooth), fitted(problem, 1.0, dense, _timed(course, dense))):
        with contextlib.suppress(UnreachableError):
            return stretched(problem, x)
    return None


def _timed(course: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Follow a course, (S, 1 + r), with a smooth motion from rest to rest: the places at `tau`, (K, 1 + r)."""
    u = tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
    grid = np.linspace(0.0, 1.0, len(course))
    return np.column_stack([np.interp(u, grid, column) for column in course.T])


def fitted(problem: Transcription, t_end: float, tau: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Point x whose curves come nearest to given values, by least squares; exact where the splines contain them.

    Parameters
    ----------
    problem : Transcription
    t_end : float
        s.
    tau : (K,) ndarray
        Normalised times.
    wanted : (K, 1 + r) ndarray
        Path coordinate and redundant joints there.

    Returns
    -------
    (v,) ndarray
    """
    basis = basis_matrix(problem.knots, problem.degree, tau).toarray()
    parts = [np.array([t_end])]
    for spline, values in zip(problem.splines, wanted.T, strict=True):
        tied = np.zeros((len(spline.variable), spline.free))
        kept = np.flatnonzero(spline.variable >= 0)
        tied[kept, spline.variable[kept]] = 1.0
        parts.append(np.linalg.lstsq(basis @ tied, values - basis @ spline.fixed, rcond=None)[0])
    parts.append(problem.grid.lengths_of(problem.knots))
    return np.clip(np.concatenate(parts), problem.x_lower, problem.x_upper)


def stretched(problem: Transcription, x: np.ndarray) -> np.ndarray:
    """Return x with t_E just so long that velocity, acceleration and torque limits hold, where any time does.

    Far above the least time no limit is active, and a solver that has seen no curvature creeps towards it.

    Raises
    ------
    UnreachableError
        A collocation point is out of the branch's reach.
    """
    x = x.copy()
    while x[0] < _LONGEST_TIME:
        excess = worst_timed_ratio(problem, x)
        if excess <= 1.0:
            break
        # Without gravity and friction, torque falls with the square of the time.
        x[0] *= _STRETCH * min(np.sqrt(excess), 8.0)
    shorter = x.copy()
    while shorter[0] > _SHORTEST_TIME:
        shorter[0] *= _SHRINKAGE
        if worst_timed_ratio(problem, shorter) > 1.0:
            break
        x[0] = shorter[0]
    return x


def worst_timed_ratio(problem: Transcription, x: np.ndarray) -> float:
    """Largest ratio to a limit that a longer time relieves: velocity, acceleration, torque."""
    state = problem.state(x)
    timed = [c.values(state) for c in problem.constraints if c.timed]
    return float(max(np.abs(values).max() for values in timed))
