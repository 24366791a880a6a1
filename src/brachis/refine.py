"""Refinement to truth: from limits at collocation points to limits everywhere.

After a solve the limits are evaluated on a grid many times denser. Where one is exceeded between collocation points,
points are added around the worst place of each stretch and the problem is solved again from where it stands, until the
worst ratio is within the tolerance. A last excess of the tolerance's own size is met by lengthening t_E by as little,
and by up to one per cent once the rounds are used up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from brachis.bspline import spread
from brachis.errors import UnreachableError
from brachis.nlp import Transcription
from brachis.solvers import SolverReport

Solve = Callable[[Transcription, np.ndarray], SolverReport]
_LARGEST_STRETCH = 0.01
_FEASIBLE = 1e-5
_GOAL = 0.5
"""Refinement aims at this part of the tolerance: the verification's grid is another one."""
_NEAR = 0.005
_COARSE = 20.0
_FINE = 9
_ZOOMS = 2
_PIECE_POINTS = 9
_CLOSEST = 1e-5
_SAME_TIME = 1e-9
_JUST_BEFORE = 1e-7
_CONTINUOUS_ACCELERATION = 3


@dataclass(frozen=True)
class RefinementOptions:
    """When refinement is content.

    Attributes
    ----------
    tolerance : float
        Largest excess over a limit, as a fraction of it.
    density : int
        Grid points per collocation point of the first solve.
    max_rounds : int
        Solves after the first one; with 0 the first answer is left as it is.
    """

    tolerance: float = 1e-4
    density: int = 10
    max_rounds: int = 10


@dataclass(frozen=True)
class Refined:
    """A solve and what refinement made of it.

    Attributes
    ----------
    problem : Transcription
        With all collocation points.
    reports : tuple of SolverReport
        Of every round, the first one included.
    x : (v,) ndarray
        The answer.
    excess : float
        Largest excess over a limit on the dense grid, as a fraction of it; infinite where out of reach.
    stretched : float
        Factor by which t_E was lengthened at the very end, 1 if not at all.
    """

    problem: Transcription
    reports: tuple[SolverReport, ...]
    x: np.ndarray
    excess: float
    stretched: float

    @property
    def converged(self) -> bool:
        """True where the first solve ended well, so that `x` is a motion and not a mere iterate."""
        return self.reports[0].status.usable


def refine(problem: Transcription, first: SolverReport, solve: Solve, options: RefinementOptions) -> Refined:
    """Add collocation points to a solved problem until the limits hold on the dense grid.

    Parameters
    ----------
    problem : Transcription
    first : SolverReport
        Of the problem's solve.
    solve : callable
        ``solve(problem, x)`` returns a `SolverReport`.
    options : RefinementOptions

    Returns
    -------
    Refined
    """
    dense = problem.resampled(_dense_grid(problem, options.density))
    goal = options.tolerance * _GOAL
    reports = [first]
    if not first.status.usable:
        return Refined(problem, (first,), first.x, np.inf, 1.0)
    for _ in range(options.max_rounds):
        answer = reports[-1].x
        excess, places = _violations(dense, answer, goal)
        x, remaining = _stretched(dense, answer, excess, goal, options.tolerance)
        if remaining <= goal:
            return Refined(problem, tuple(reports), x, remaining, float(x[0] / answer[0]))
        tau = merged(problem, places)
        if len(tau) == len(problem.tau):
            break
        finer = problem.resampled(tau)
        report = solve(finer, answer)
        if not report.status.usable and not _still_good(report, reports[-1]):
            break
        problem = finer
        reports.append(report)
    answer = reports[-1].x
    excess, _ = _violations(dense, answer, goal)
    x, remaining = _stretched(dense, answer, excess, goal, _LARGEST_STRETCH if options.max_rounds else 0.0)
    return Refined(problem, tuple(reports), x, remaining, float(x[0] / answer[0]))


def _dense_grid(problem: Transcription, density: int) -> np.ndarray:
    """Spread times evenly over every knot interval, `density` for each of its collocation points."""
    breaks = problem.breaks
    behind = np.searchsorted(problem.tau, breaks + _SAME_TIME)
    grid = spread(breaks, density * np.maximum(np.diff(behind), 1))
    return np.union1d(grid, _jumps(problem) - _JUST_BEFORE)


def _jumps(problem: Transcription) -> np.ndarray:
    """Knots at which the acceleration jumps, so that a limit must hold on both sides."""
    return problem.breaks[1:-1] if problem.degree < _CONTINUOUS_ACCELERATION else np.empty(0)


def _still_good(report: SolverReport, before: SolverReport) -> bool:
    """Tell whether a solve that ended early left a feasible motion about as fast as the one before it."""
    return report.violation <= _FEASIBLE and report.objective <= before.objective * (1.0 + _LARGEST_STRETCH)


def _violations(dense: Transcription, x: np.ndarray, goal: float) -> tuple[float, np.ndarray]:
    """Largest excess, and the times tau at which collocation points are missing.

    Around every peak of the grid that comes near a limit ever finer grids look for the true peak.
    """
    tau = dense.tau
    try:
        table = dense.excess(x)
        centres = _suspects(tau, table, dense.knots, goal - _NEAR)
        heights = table.max(axis=1)[np.searchsorted(tau, centres - _SAME_TIME).clip(max=len(tau) - 1)]
        if table.max() > _COARSE * goal:  # the grid's own peaks will do until they are nearly held down
            return float(table.max()), _around(centres[heights > goal], tau)
        reach = _spacing(tau, centres)
        for _ in range(_ZOOMS):
            if not len(centres):
                break
            centres, heights = _zoomed(dense, x, centres, reach)
            kept = heights > goal - 0.1 * _NEAR
            centres, heights, reach = centres[kept], heights[kept], reach[kept] * 2.0 / (_FINE - 1)
        places = _within_pieces(dense, x)
        worst = dense.excess_at(x, places).max(axis=1) if len(places) else places
    except UnreachableError:
        return np.inf, _unreachable(dense, x)
    largest = max(table.max(), heights.max(initial=-np.inf), worst.max(initial=-np.inf))
    return float(largest), np.union1d(_around(centres[heights > goal], tau), places[worst > goal])


def _within_pieces(dense: Transcription, x: np.ndarray) -> np.ndarray:
    """Spread times tau over every piece of a path of several: a blend of millimetres lies between grid points."""
    breaks, motion = dense.decomposition.path.breaks, dense.motion(x)
    if len(breaks) == 2:  # noqa: PLR2004  (a single piece, which the grid sees)
        return np.empty(0)
    spread = breaks[:-1, None] + np.diff(breaks)[:, None] * np.linspace(0.0, 1.0, _PIECE_POINTS)
    return np.unique(motion.times_of(spread.ravel()) / motion.t_end)


def _spacing(tau: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Find the distance between grid times around each of `times`; at a knot the larger one of its two sides."""
    gaps = np.diff(tau)
    before = np.clip(np.searchsorted(tau, times - _SAME_TIME) - 1, 0, len(gaps) - 1)
    behind = np.clip(np.searchsorted(tau, times + _SAME_TIME) - 1, 0, len(gaps) - 1)
    return np.maximum(gaps[before], gaps[behind])


def _around(centres: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """List times at and a grid step beside the centres: a peak moves when it is held down."""
    steps = _spacing(tau, centres)[:, None] * np.array([-1.0, 0.0, 1.0])
    return np.unique(np.clip(centres[:, None] + steps, 0.0, 1.0))


def _unreachable(dense: Transcription, x: np.ndarray) -> np.ndarray:
    """List the middle of every stretch of the dense grid on which the branch has no answer."""
    motion = dense.motion(x)
    lost = ~np.all(np.isfinite(dense.decomposition.postures(motion.at(dense.tau * motion.t_end)[0])), axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(int)))
    if not len(edges):  # reachable, but singular or too far apart to count turns: more points everywhere
        return dense.tau[5::10]
    return dense.tau[(edges[::2] + edges[1::2] - 1) // 2]


def _suspects(tau: np.ndarray, table: np.ndarray, knots: np.ndarray, near: float) -> np.ndarray:
    """List times around which an excess may hide: the grid's peaks near a limit, and both sides of knots near one.

    A peak between grid points is higher than its neighbours by an eighth of their second difference; four times that
    is allowed for. The motion's higher derivatives jump at knots: a peak beside a knot need not show on the grid.
    """
    padded = np.pad(table, ((1, 1), (0, 0)), mode="edge")
    bend = np.abs(padded[:-2] - 2.0 * table + padded[2:])
    peaks = (table + 0.5 * bend > near + _NEAR) & (table > near) & (table >= padded[:-2]) & (table >= padded[2:])
    at_knots = np.searchsorted(tau, np.unique(knots) - _SAME_TIME)
    close = tau[at_knots[(table[at_knots] > near).any(axis=1)]]
    half = 0.5 * _spacing(tau, close)
    return np.unique(np.clip(np.concatenate([tau[peaks.any(axis=1)], close - half, close + half]), 0.0, 1.0))


def _zoomed(
    dense: Transcription, x: np.ndarray, centres: np.ndarray, reach: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Look on a fine grid within `reach` of every centre: the places of the largest excess, and its size there."""
    fine = np.clip(centres[:, None] + reach[:, None] * np.linspace(-1.0, 1.0, _FINE), 0.0, 1.0)
    order = np.argsort(fine.ravel(), kind="stable")
    worst = np.empty(fine.size)
    worst[order] = dense.excess_at(x, fine.ravel()[order]).max(axis=1)
    best = np.argmax(worst.reshape(fine.shape), axis=1)
    chosen = np.arange(len(centres)), best
    return fine[chosen], worst.reshape(fine.shape)[chosen]


def merged(problem: Transcription, extra: np.ndarray) -> np.ndarray:
    """Collocation points of a problem with extra ones, without pairs so close that their rows would be the same."""
    tau, jumps = problem.tau, _jumps(problem)
    sides = [np.searchsorted(jumps, times, side="right") for times in (extra, tau)]
    apart = np.where(sides[0][:, None] == sides[1], np.abs(extra[:, None] - tau), np.inf)
    return np.union1d(tau, extra[apart.min(axis=1) > _CLOSEST])


def _stretched(
    dense: Transcription, x: np.ndarray, excess: float, goal: float, largest: float
) -> tuple[np.ndarray, float]:
    """Lengthen the time by a fraction of up to `largest` where that brings the excess to the goal.

    A longer time relieves torques that only accelerate by twice its own fraction, velocities by as much; those that
    gravity or friction add to by less. So this is tried, not trusted.
    """
    x, first = x.copy(), x[0]
    while goal < excess:
        t_end = x[0] * (1.0 + excess - 0.5 * goal)
        if not t_end <= first * (1.0 + largest):
            break
        x[0] = t_end
        before, (excess, _) = excess, _violations(dense, x, goal)
        if excess > 0.99 * before:
            break
    return x, excess
