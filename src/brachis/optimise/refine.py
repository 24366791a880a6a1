"""Refinement: from limits met at collocation points to limits met everywhere.

After a solve the limits are evaluated on a much denser grid. Where a limit is violated between collocation points,
points are added around the worst place of each interval. The problem is then solved again from its current solution,
until the worst violation is within the tolerance. If a violation about as large as the tolerance remains, t_E is made
slightly longer to remove it. When the rounds are used up, t_E may become up to one per cent longer. When the time is
up, it may become up to twice as long.

Where a joint with Coulomb friction reverses, its torque rises by twice the friction within the width of the friction
law. The joint passes a width of 1e-5 rad/s in microseconds, which no grid resolves. Between grid points, the velocity
of a joint is therefore approximated by the cubic that fits its velocities and accelerations at these points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.common.arrays import bisect, spread
from brachis.common.deadline import NEVER, Deadline
from brachis.errors import UnreachableError
from brachis.kinematics import JointState
from brachis.optimise.backends import SolverReport
from brachis.optimise.improve import Solve, SolvedProgram
from brachis.optimise.phase import Phase
from brachis.optimise.program import Program
from brachis.robot import Friction
from brachis.task import RefinementSettings

_LEVELS = np.array([-7.0, -4.5, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.5, 7.0])
"""Velocities that are checked, in widths of the friction law. At 7, all but 2e-6 of the friction acts."""
_NEAR_REVERSALS = 10.0
"""Largest velocity, in widths of the friction law, at which an extremum of the velocity is checked too."""


def reversals(friction: Friction, times: np.ndarray, state: JointState) -> np.ndarray:
    """Find the times at which joints with Coulomb friction pass through the width of the friction law.

    Parameters
    ----------
    friction : Friction
    times : (K,) ndarray
        Times, ascending, s.
    state : JointState
        Joint motion at these times.

    Returns
    -------
    (Z,) ndarray
        Times at which a velocity passes a checked level, or has an extremum close to zero, ascending, s.
    """
    rubbing = np.flatnonzero(friction.coulomb > 0.0)
    if not len(rubbing):
        return np.empty(0)
    h = np.diff(times)[:, None]
    speed = state.qdot[:, rubbing] / friction.v_eps[rubbing]
    gain = state.qddot[:, rubbing] / friction.v_eps[rubbing]
    second = speed[:-1] + h * gain[:-1] / 3.0
    third = speed[1:] - h * gain[1:] / 3.0
    cubic = np.array([speed[:-1], second, third, speed[1:]])
    is_near = (cubic.min(axis=0) < _NEAR_REVERSALS) & (
        cubic.max(axis=0) > -_NEAR_REVERSALS
    )
    step, joint = np.nonzero(is_near)
    cubic = cubic[:, step, joint]
    crosses = (cubic[0, :, None] - _LEVELS) * (cubic[-1, :, None] - _LEVELS) < 0.0
    which, level = np.nonzero(crosses)
    crossing = _root(cubic[:, which] - _LEVELS[level])
    slopes = np.diff(cubic, axis=0)
    is_low = np.abs(cubic).min(axis=0) < _NEAR_REVERSALS
    turns = np.flatnonzero((slopes[0] * slopes[-1] < 0.0) & is_low)
    u = np.append(crossing, _root(slopes[:, turns]))
    steps = step[np.append(which, turns)]
    return np.unique(times[steps] + u * h[steps, 0])


def _root(c: np.ndarray) -> np.ndarray:
    """Find the zeros, (F,), of polynomials in Bernstein form, (m + 1, F), with opposite signs at 0 and 1."""

    def is_before(u: np.ndarray) -> np.ndarray:
        """Tell at which places, (F,), the polynomials have the same sign as at their beginning."""
        value = c
        while len(value) > 1:  # de Casteljau
            value = value[:-1] * (1.0 - u) + value[1:] * u
        return value[0] * c[0] > 0.0

    return bisect(is_before, np.ones(c.shape[1]))


_NEAR = 0.005
"""Distance from a limit, as a fraction of it, within which a violation may hide between grid points."""
_SAME_TIME = 1e-9
"""Difference of two normalised times below which both belong to the same knot or grid point, on either side."""
_EVERYWHERE = slice(5, None, 10)
"""Slice of the dense grid that selects one time between every two neighbouring collocation points."""
_BESIDE = np.array([-12.0, -8.0, -5.0, -3.0, -1.5, -0.5, 0.5, 1.5, 3.0, 5.0, 8.0, 12.0])
"""Offsets of points added around an abrupt change, in steps of the dense grid."""


def dense_grid(phase: Phase, density: int) -> np.ndarray:
    """Return times spread evenly over each knot interval, `density` per collocation point."""
    breaks = phase.breaks
    behind = np.searchsorted(phase.t_norm, breaks + _SAME_TIME)
    grid = spread(breaks, density * np.maximum(np.diff(behind), 1))
    return np.union1d(grid, phase.jumps - 1e-7)  # just before a jump


def violations(
    dense: Program, x: np.ndarray, goal: float
) -> tuple[float, list[np.ndarray]]:
    """Return the largest violation, and the normalised times at which each phase lacks collocation points.

    Around each peak on the grid that comes close to a limit, the true peak is located with finer and finer grids.
    """
    checks = [
        _check_phase(phase, x_of_phase, goal) for phase, x_of_phase in dense.split(x)
    ]
    largest, missing = map(list, zip(*checks, strict=True))
    violation = max(largest)
    if np.isfinite(violation):
        of_means = dense.means.violation(dense.split(x))
        violation = max(violation, of_means)
        if of_means > goal:  # there are too few points everywhere
            extra = [phase.t_norm[_EVERYWHERE] for phase in dense.phases]
            pairs = zip(missing, extra, strict=True)
            missing = [np.union1d(*pair) for pair in pairs]
    return violation, missing


def _check_phase(dense: Phase, x: np.ndarray, goal: float) -> tuple[float, np.ndarray]:
    """Return the largest violation of a phase, and the normalised times at which collocation points are missing."""
    t_norm = dense.t_norm
    try:
        table = dense.violation(x)
        largest = float(table.max())
        peaks = _suspects(t_norm, table, dense.knots, goal - _NEAR)
        if largest > 20.0 * goal:
            # Peaks on the grid are accurate enough until they are nearly within the limits.
            at = np.searchsorted(t_norm, peaks - _SAME_TIME).clip(max=len(t_norm) - 1)
            missing = _around(peaks[table.max(axis=1)[at] > goal], t_norm)
        else:
            peaks, heights = _zoom(dense, x, peaks, goal)
            places = _special_times(dense, x)
            worst = np.empty(0)
            if len(places):
                worst = dense.violation_at(x, places).max(axis=1)
            largest = max(largest, np.append(heights, worst).max(initial=-np.inf))
            high = _around(peaks[heights > goal], t_norm)
            missing = np.union1d(high, places[worst > goal])
        return largest, np.union1d(missing, _beside_breaks(dense, x, missing))
    except UnreachableError:
        return np.inf, _unreachable(dense, x)


def _special_times(dense: Phase, x: np.ndarray) -> np.ndarray:
    """List the normalised times, between grid points, that are always checked.

    If a path has several pieces, these are times spread over every piece, because a blend of a few millimetres may lie
    between grid points. The times at which a joint with Coulomb friction reverses or nearly reverses, and at which a
    limit changes abruptly, are also listed.
    """
    motion = dense.motion(x)
    path = dense.joint_map.path
    pieces = np.empty(0)
    if path is not None and len(path.breaks) > 2:
        begin, end = motion.at(np.array([0.0, motion.t_end]))[0][:, 0]
        pieces = motion.times_of(np.clip(spread(path.breaks, 8), begin, end))
    friction = dense.joint_map.robot.friction
    reversing = reversals(friction, dense.t_norm * motion.t_end, dense.state(x))
    times = np.concatenate([pieces, reversing])
    return np.union1d(times / motion.t_end, _at_breaks(dense, x))


def _at_breaks(dense: Phase, x: np.ndarray) -> np.ndarray:
    """List normalised times at which the path coordinate passes an abrupt change of a limit."""
    motion = dense.motion(x)
    breaks = np.concatenate([limit.breaks for limit in dense.limits])
    return motion.times_of(breaks) / motion.t_end


def _beside_breaks(dense: Phase, x: np.ndarray, missing: np.ndarray) -> np.ndarray:
    """Spread normalised times around the abrupt changes near which points are missing.

    The time of a change moves with every solve, so single points would have to be added in many rounds.
    """
    at = _at_breaks(dense, x)
    if not (len(at) and len(missing)):
        return np.empty(0)
    steps = _spacing(dense.t_norm, at)
    near = np.abs(at[:, None] - missing).min(axis=1) <= _BESIDE[-1] * steps
    return np.clip(at[near, None] + steps[near, None] * _BESIDE, 0.0, 1.0).ravel()


def _spacing(t_norm: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Find the grid step around each of `times`; at a knot, the larger of the steps on both sides."""
    gaps = np.diff(t_norm)
    sides = [
        np.searchsorted(t_norm, times + by) - 1 for by in (-_SAME_TIME, _SAME_TIME)
    ]
    before, behind = gaps[np.clip(sides, 0, len(gaps) - 1)]
    return np.maximum(before, behind)


def _around(centres: np.ndarray, t_norm: np.ndarray) -> np.ndarray:
    """List times at the centres and one grid step before and after, because a peak moves when it is pressed down."""
    steps = _spacing(t_norm, centres)[:, None] * np.array([-1.0, 0.0, 1.0])
    return np.unique(np.clip(centres[:, None] + steps, 0.0, 1.0))


def _find_lost(phase: Phase, x: np.ndarray, t_norm: np.ndarray) -> np.ndarray:
    """Tell for each normalised time, (K,), whether the joint map has no posture."""
    motion = phase.motion(x)
    postures = phase.joint_map.postures(motion.at(t_norm * motion.t_end)[0])
    return ~np.isfinite(postures).all(axis=1)


def _unreachable(dense: Phase, x: np.ndarray) -> np.ndarray:
    """List the middle of each stretch of the dense grid on which the branch has no posture."""
    is_lost = _find_lost(dense, x, dense.t_norm)
    edges = np.flatnonzero(np.diff(np.pad(is_lost, 1).astype(int)))
    if not len(edges):
        # All points are reachable, but singular or too far apart to count turns. Add points everywhere.
        return dense.t_norm[_EVERYWHERE]
    return dense.t_norm[(edges[::2] + edges[1::2] - 1) // 2]


def _suspects(
    t_norm: np.ndarray, table: np.ndarray, knots: np.ndarray, near: float
) -> np.ndarray:
    """List times around which a violation may hide: grid peaks, and both sides of knots, if they are close to a limit.

    A peak between grid points is higher than its neighbours by an eighth of their second difference. Four times this
    amount is added. The motion's higher derivatives jump at knots, so a peak next to a knot may not show on the grid.
    """
    padded = np.pad(table, ((1, 1), (0, 0)), mode="edge")
    bend = np.abs(padded[:-2] - 2.0 * table + padded[2:])
    is_peak = (table >= padded[:-2]) & (table >= padded[2:])
    is_near = (table + 0.5 * bend > near + _NEAR) & (table > near)
    peaks = t_norm[(is_peak & is_near).any(axis=1)]
    at_knots = np.searchsorted(t_norm, np.unique(knots) - _SAME_TIME)
    close = t_norm[at_knots[(table[at_knots] > near).any(axis=1)]]
    half = 0.5 * _spacing(t_norm, close)
    times = np.concatenate([peaks, close - half, close + half])
    return np.unique(np.clip(times, 0.0, 1.0))


def _zoom(
    dense: Phase, x: np.ndarray, centres: np.ndarray, goal: float
) -> tuple[np.ndarray, np.ndarray]:
    """Find the true peaks close to the centres with finer and finer grids; return their times and violations."""
    heights: np.ndarray = np.empty(len(centres))
    reach = _spacing(dense.t_norm, centres)
    steps = np.linspace(-1.0, 1.0, 9)
    for _ in range(2):
        if not len(centres):
            break
        fine = np.clip(centres[:, None] + reach[:, None] * steps, 0.0, 1.0)
        worst = dense.violation_at(x, fine.ravel()).max(axis=1)
        best = np.argmax(worst.reshape(fine.shape), axis=1)
        chosen = np.arange(len(centres)) * len(steps) + best
        is_high = worst[chosen] > goal - 0.1 * _NEAR
        centres = fine.ravel()[chosen][is_high]
        heights = worst[chosen][is_high]
        reach = 0.25 * reach[is_high]
    return centres, heights


def merge_points(phase: Phase, extra: np.ndarray) -> np.ndarray:
    """Add extra collocation points to those of a phase, except points whose rows would equal existing rows."""
    t_norm = phase.t_norm
    before = np.clip(np.searchsorted(t_norm, extra), 1, len(t_norm) - 1) - 1
    side = np.searchsorted(phase.jumps, extra, side="right")
    beside = t_norm[[before, before + 1]]
    is_same_side = np.searchsorted(phase.jumps, beside, side="right") == side
    is_close = is_same_side & (np.abs(extra - beside) <= 1e-5)
    return np.union1d(t_norm, extra[~is_close.any(axis=0)])


_LONGEST = 0.01
"""Maximum fraction by which a motion is slowed down if nothing else brings it within the limits."""
_CLOSE = 1.01
"""Ratio of a sufficient time to an insufficient one below which no shorter time is searched for."""
_LONGEST_IF_LATE = 1.0
"""The same fraction once the time is up, when a slower motion within the limits is better than none."""
_RELIEF = 4.0
"""Approximate maximum of the decrease of a violation, divided by the fraction by which the motion gets slower."""
_GOAL = 0.5
"""Fraction of the tolerance at which refinement aims, because the verification uses a different grid."""


@dataclass(frozen=True)
class RefinementOptions:
    """Options of the refinement: the violations at which it ends, and its maximum effort.

    Attributes
    ----------
    tolerance : float
        Largest permitted violation of a limit, as a fraction of the limit.
    density : int
        Number of grid points per collocation point of the first solve.
    max_rounds : int
        Maximum number of solves after the first one. With 0, the first solution is not changed.
    deadline : Deadline
        Deadline after which no solve is started.
    longest : float
        Maximum end time to which the motion is lengthened, s.
    """

    tolerance: float = 1e-4
    density: int = 10
    max_rounds: int = 10
    deadline: Deadline = NEVER
    longest: float = np.inf

    @classmethod
    def of(
        cls, settings: RefinementSettings, deadline: Deadline, longest: float = np.inf
    ) -> RefinementOptions:
        """Create the options from the ``refinement`` part of a task."""
        known = (settings.tolerance, settings.density, settings.max_rounds)
        return cls(*known, deadline, longest)


def refine(
    program: Program, first: SolverReport, solve: Solve, options: RefinementOptions
) -> SolvedProgram:
    """Add collocation points to a solved program until the limits are met on the dense grid.

    Unlike `improve`, this function does not search for a faster motion. The motion gets slower from round to round,
    until it meets the limits.

    Parameters
    ----------
    program : Program
    first : SolverReport
        Report of the program's solve.
    solve : callable
        ``solve(program, x)`` returns a `SolverReport`.
    options : RefinementOptions

    Returns
    -------
    SolvedProgram
        The program with all collocation points. Its reports are `first` and one report for each round.
    """
    if not first.status.usable:
        return SolvedProgram(program, (first,), violation=np.inf)
    dense = program.with_points(
        [dense_grid(phase, options.density) for phase in program.phases]
    )
    goal = options.tolerance * _GOAL
    reports = [first]
    remaining = np.inf
    for remaining_rounds in range(options.max_rounds, -1, -1):
        answer = reports[-1].x
        violation, missing = violations(dense, answer, goal)
        if not remaining_rounds:
            break
        is_near = violation < goal + _RELIEF * options.tolerance
        by = options.tolerance if is_near else 0.0
        factor, remaining = _lengthen(dense, answer, violation, options, by)
        if remaining <= goal:
            break
        pairs = zip(program.phases, missing, strict=True)
        finer = program.with_points([merge_points(*pair) for pair in pairs])
        is_same = finer.collocation_points == program.collocation_points
        if is_same or options.deadline.passed:
            break
        report = solve(finer, answer)
        # Even a solve that ended early may give a motion about as fast as the one before.
        is_as_fast = report.objective <= reports[-1].objective * (1.0 + _LONGEST)
        if not (report.status.usable or (report.feasible and is_as_fast)):
            break
        program = finer
        reports.append(report)
    if remaining > goal:
        by = _LONGEST_IF_LATE if options.deadline.passed else _LONGEST
        by = by if options.max_rounds else 0.0
        factor, remaining = _lengthen(dense, answer, violation, options, by)
    return SolvedProgram(
        program, tuple(reports), violation=remaining, time_scaled=factor
    )


def _lengthen(
    dense: Program,
    x: np.ndarray,
    violation: float,
    options: RefinementOptions,
    by: float,
) -> tuple[float, float]:
    """Find the factor on the time, up to 1 + `by`, that reduces the violation to the goal; return factor and violation.

    If the time is longer by a small fraction, velocities are lower by this fraction, and purely accelerating torques by
    twice as much. Torques that contain gravity or friction decrease by less. If the time is given, nothing decreases.
    Several factors are therefore tried, and the best one is kept.
    """
    goal = options.tolerance * _GOAL
    max_factor = min(1.0 + by, options.longest / dense.end_time(x))
    factor = 1.0
    too_short = factor
    best = (factor, violation)
    stride = 1.0
    while goal < violation and factor < max_factor:
        before = violation
        too_short = factor
        lack = stride * (violation - 0.5 * goal)
        factor = min(factor * (1.0 + lack), max_factor)
        if options.deadline.passed:
            stride *= 2.0
        violation, _ = violations(dense, dense.scale_time(x, factor), goal)
        if violation <= goal or (violation < best[1] and factor < max_factor):
            best = (factor, violation)
        if violation > 0.99 * before:
            break
    # Jerks decrease with the third power of the time, so a smaller factor may be enough.
    while best[1] <= goal and best[0] > _CLOSE * too_short:
        factor = np.sqrt(best[0] * too_short)
        violation, _ = violations(dense, dense.scale_time(x, factor), goal)
        if violation <= goal:
            best = (factor, violation)
        else:
            too_short = factor
    return best
