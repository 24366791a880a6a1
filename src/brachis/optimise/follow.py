"""Splines along the fastest timing of a phase's joint path, within its limits.

Splines follow a timing nearly (`timed_splines`). Where they exceed a limit, this is narrowed there by so much, and the
joint path is timed anew, until the limits hold. That leaves the motion as fast as possible.

Knots stand where accelerations jump, and where limits were exceeded over fewer knots. They stay there on the path,
whatever its timing.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from brachis.common.arrays import interpolate_columns, spread
from brachis.common.deadline import NEVER, Deadline
from brachis.errors import UnreachableError
from brachis.limits import Limit, Moments
from brachis.optimise.bspline import clamped_knots, locate
from brachis.optimise.grid import FixedGrid
from brachis.optimise.motion import Motion
from brachis.optimise.phase import Phase
from brachis.optimise.phase_timing import PhaseTiming
from brachis.optimise.timed_splines import breaks_for, even_out, splines_along
from brachis.timing import Timing
from brachis.timing.joint_path import halfway

_FIRST_LOSS = 5.0
"""What the intervals may lose together at first, as a multiple of what splines may lose: where accelerations are smooth
their loss is overrated by this factor."""
_SHARE = 0.5
"""Part of the tolerance that splines may lose; joint paths lose more."""
_AIM = 0.7
"""Part of this that the next mesh should lose."""
_FINER = (0.02, 0.5)
"""Smallest and largest factor of what intervals may lose, where a mesh was too slow."""
_WAITS = 0.1
"""Part of what splines may lose that the timing waits at an end, for every derivative that vanishes there."""
_FIRST_WAIT = 0.01
"""Part of the time of such a wait over first knots."""
_FOR_AIM = 3
"""The first choice of knots that may lose all of the tolerance: along paths that wind quickly (example 16) others would
take several times as many."""
_MESHES = 6
"""Choices of knots that are tried, no more."""
_MOST_INTERVALS = 200_000
"""Intervals of a phase: the verification looks at 8 instants in each, and at no more than 2,000,000."""
_LOOKS = (4, 10)
"""Times in each interval at which limits are looked at: at first, and once they hold there."""
_ROUNDS = 40
"""Splines that are laid over some knots, no more."""
_PATIENCE = 8
"""Rounds that may gain nothing, no more: with 3 the seven joints of example 16 ended 6.8 % slower than with 8."""
_ENOUGH = 5e-5
"""Violation of a limit, as a part of it, that is small enough."""
_SMALL = 0.01
"""Violation from which on limits are narrowed by no more than it."""
_MORE = 1.5
"""Factor on smaller ones: splines give way by less than limits are narrowed."""


@dataclass(frozen=True)
class SplineFit:
    """Splines over some knots.

    Attributes
    ----------
    motion : Motion
    violation : float
        Largest violation of a limit; infinite if it is not known.
    slower : float
        Part of the time by which these knots make the motion slower, at least; infinite where limits cannot hold.
    outside : float
        Largest violation of a limit on postures, which a longer time does not relieve; infinite if it is not known.
    beyond : (N,) ndarray
        Largest violation in every interval before limits were narrowed; empty if it is not known.
    """

    motion: Motion
    violation: float = np.inf
    slower: float = np.inf
    outside: float = np.inf
    beyond: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def rank(self) -> tuple[float, float]:
        """Less for those that exceed limits on postures less, or where both keep them, are faster."""
        return max(self.outside, _ENOUGH), self.needed_time

    @property
    def needed_time(self) -> float:
        """Time in which the limits would hold, about, s."""
        return self.motion.t_end * (1.0 + self.violation)


def follow(
    phase: Phase,
    phase_timing: PhaseTiming,
    tolerance: float,
    points: int,
    deadline: Deadline = NEVER,
) -> tuple[Phase, np.ndarray, float] | None:
    """Lay splines along the fastest timing of a phase's joint path, within the limits.

    Parameters
    ----------
    phase : Phase
        With another grid.
    phase_timing : PhaseTiming
    tolerance : float
        Part of the time by which they should not be slower.
    points : int
        Collocation points an interval.
    deadline : Deadline, optional
        After it no other mesh is tried, and no limit is narrowed further.

    Returns
    -------
    phase : Phase
        Over the knots that the timing needs.
    x : (v,) ndarray
        The splines; None in place of all where the limits allow no timing.
    violation : float
        Largest one of a limit, as a part of it; infinite if it is not known.
    """
    timing = phase_timing.timing
    if timing is None:
        return None
    best = None
    aim = _SHARE * tolerance
    lost = _FIRST_LOSS * aim
    breaks = np.empty(0)
    for number in range(1, _MESHES + 1):
        needed = _knots(phase, phase_timing, timing, lost, _WAITS * aim)
        breaks = even_out(np.union1d(breaks, needed))
        if len(breaks) > _MOST_INTERVALS:
            break
        # Over the last knots limits are narrowed until they hold, however slow that is. The timing says nothing between
        # its stations.
        is_fine = 2 * len(breaks) > len(timing.times)
        is_last = number == _MESHES or is_fine or deadline.passed
        allowed = np.inf if is_last else tolerance
        fit = _hold_limits(phase, phase_timing, timing, breaks, allowed, deadline)
        fit = _look_at_postures(phase, fit)
        if best is None or fit.rank < best.rank:
            best = fit
        is_fast = fit.slower < (aim if number < _FOR_AIM else tolerance)
        if is_last or (is_fast and fit.outside <= _ENOUGH):
            break
        lost *= np.clip(_AIM * aim / max(fit.slower, aim), *_FINER)
        if len(fit.beyond):
            share = _AIM * aim / len(fit.beyond)
            steps = np.diff(breaks)
            is_over = (steps * fit.beyond > share) & (steps > 0.25 / len(timing.times))
            breaks = np.union1d(breaks, halfway(breaks)[is_over])
    if best is None:
        return None
    finer, x = _as_phase(phase, best.motion, points)
    return finer, x, best.violation


def begin(
    phase: Phase,
    phase_timing: PhaseTiming,
    timing: Timing,
    lost: float,
    intervals: int,
    points: int,
) -> tuple[Phase, np.ndarray]:
    """Lay splines along a timing over few intervals; limits may be exceeded.

    Parameters
    ----------
    phase, phase_timing, points
        As of `follow`.
    timing : Timing
        Of the joint path.
    lost : float
        Part of the time that the intervals may lose together.
    intervals : int
        Intervals, about.

    Returns
    -------
    phase : Phase
    x : (v,) ndarray
    """
    breaks = _knots(phase, phase_timing, timing, lost, _FIRST_WAIT, intervals)
    motion, _ = _lay_splines(phase, phase_timing, timing, breaks)
    return _as_phase(phase, motion, points)


def _knots(
    phase: Phase,
    phase_timing: PhaseTiming,
    timing: Timing,
    lost: float,
    shortest: float,
    max_intervals: int = _MOST_INTERVALS + 1,
) -> np.ndarray:
    """Choose knots, (N + 1,), over which splines follow a timing, the first and last intervals short; see `breaks_for`.

    The timing waits as long where accelerations vanish.
    """
    breaks = breaks_for(phase_timing.course, timing, lost, max_intervals)
    if max(_vanishing(phase)) > 0:
        breaks = even_out(np.union1d(breaks, [shortest, 1.0 - shortest]))
    return breaks


def _vanishing(phase: Phase) -> tuple[int, int]:
    """Numbers of derivatives, from the acceleration on, that vanish at both ends of a phase."""
    ends = phase.boundary.start, phase.boundary.end
    first, last = (max(len(end[-1].derivatives) - 1, 0) for end in ends)
    return first, last


def _lay_splines(
    phase: Phase, phase_timing: PhaseTiming, timing: Timing, breaks: np.ndarray
) -> tuple[Motion, float]:
    """Lay splines along a timing over knots, within the boundary conditions; see `splines_along`.

    Accelerations that vanish at an end, and their rates, do so over an interval each, as long as the one beside it:
    the timing begins so much later.

    Returns
    -------
    motion : Motion
    delay : float
        When the timing begins, s.
    """
    first, last = _vanishing(phase)
    ahead = breaks[1] * np.arange(first)
    behind = (1.0 - breaks[-2]) * np.arange(1, last + 1)
    before = breaks[1] * first
    moved = before + np.concatenate([ahead - before, breaks, 1.0 + behind])
    delays = (before * timing.t_end, (moved[-1] - before - 1.0) * timing.t_end)
    knots = clamped_knots(phase.degree, moved / moved[-1])
    motion = splines_along(phase_timing.course, timing, knots, phase.degree, delays)
    splines = phase.boundary.splines(knots, phase.degree)
    t_end = motion.t_end
    points = [
        spline.control_points(spline.free_from(nearly, t_end), t_end)
        for spline, nearly in zip(splines, motion.control_points, strict=True)
    ]
    if phase.joint_map.path is not None:
        # Where the tool stands, means of its rate are not exact.
        points[0] = np.maximum.accumulate(points[0].clip(max=points[0][-1]))
    return replace(motion, control_points=np.array(points)), delays[0]


def _as_phase(phase: Phase, motion: Motion, points: int) -> tuple[Phase, np.ndarray]:
    """Return the phase over the knots of a motion, and its point x."""
    t_norm = spread(np.unique(motion.knots), points)
    finer = phase.with_grid(FixedGrid(motion.knots, phase.degree, t_norm))
    return finer, finer.variables_from(motion)


def _look_at_postures(phase: Phase, fit: SplineFit) -> SplineFit:
    """Find out how far splines are outside of limits on postures, where their other limits are known."""
    if not np.isfinite(fit.violation):
        return fit
    motion = fit.motion
    t = spread(np.unique(motion.knots), _LOOKS[-1]) * motion.t_end
    try:
        state = phase.joint_map.state(*motion.at(t), t=t)
    except UnreachableError:
        return replace(fit, outside=np.inf)
    outside = phase.posture_violation(Moments.at_rest(state.q))
    return replace(fit, outside=outside)


def _hold_limits(
    phase: Phase,
    phase_timing: PhaseTiming,
    fastest: Timing,
    breaks: np.ndarray,
    allowed: float,
    deadline: Deadline,
) -> SplineFit:
    """Lay splines until the limits hold, or until they are slower by more than a part `allowed` of the time."""
    limits = [
        limit
        for limit in phase.limits
        if limit.is_checked_at_points and limit.longer_time == "relieves"
    ]
    timing = fastest
    motion, delay = _lay_splines(phase, phase_timing, timing, breaks)
    best = SplineFit(motion)
    idle = 0
    looks, closer = _LOOKS
    narrower: dict[Limit, np.ndarray] = {}
    known = None
    for _ in range(_ROUNDS):
        at_stations = (delay + timing.times) / motion.t_end
        t_norm = np.union1d(spread(motion.breaks / motion.t_end, looks), at_stations)
        t = t_norm * motion.t_end
        near = None if known is None else interpolate_columns(t_norm, *known)
        try:
            state = phase.joint_map.state(*motion.at(t), t=t, near=near)
        except UnreachableError:
            return best
        known = (t_norm, state.q)
        beyond = {
            limit: limit.violation(limit.values(state)).clip(0.0) for limit in limits
        }
        largest = [violations.max(axis=1) for violations in beyond.values()]
        worst = np.max([np.zeros(len(t)), *largest], axis=0)
        violation = float(worst.max())
        t_timing = ((t - delay) / timing.t_end).clip(0.0, 1.0)
        if not narrower and looks < closer:
            by_interval = np.zeros(len(breaks) - 1)
            _raise_to(by_interval, locate(breaks, t_timing)[0], worst)
        fit = SplineFit(motion, violation, beyond=by_interval)
        idle = 0 if fit.needed_time < best.needed_time * (1.0 - _ENOUGH) else idle + 1
        if fit.needed_time < best.needed_time:
            best = fit
        slower = motion.t_end / fastest.t_end - 1.0
        if slower > allowed:
            return replace(best, slower=slower)
        if violation <= _ENOUGH and looks < closer:
            looks = closer
            best = replace(best, violation=np.inf)
            continue
        if violation <= _ENOUGH or idle > _PATIENCE or deadline.passed:
            break
        factor = _MORE if narrower else 1.0
        for limit in limits:
            factors = np.where(beyond[limit] < _SMALL, factor, 1.0)
            excess = factors * beyond[limit] / limit.violation_scale
            added = _between_stations(excess, t_timing, breaks, timing)
            narrower[limit] = narrower.get(limit, 0.0) + added
        next_timing = phase_timing.course.solve(phase_timing.rates, narrower)
        if next_timing is None:
            return best
        breaks = _move(breaks, timing, next_timing)
        timing = next_timing
        motion, delay = _lay_splines(phase, phase_timing, timing, breaks)
    return replace(best, slower=best.needed_time / fastest.t_end - 1.0)


def _move(breaks: np.ndarray, before: Timing, timing: Timing) -> np.ndarray:
    """Move knots, (N + 1,), to the times at which another timing passes the same places."""
    places = np.interp(breaks, before.times / before.t_end, before.path.p)
    moved = np.interp(places, timing.path.p, timing.times / timing.t_end)
    return np.concatenate([[0.0], moved[1:-1], [1.0]])


def _between_stations(
    values: np.ndarray, t_norm: np.ndarray, breaks: np.ndarray, timing: Timing
) -> np.ndarray:
    """Lay lines above values, (K, c), over the knot intervals, and take them between stations, (P - 1, c)."""
    by_interval = np.zeros((len(breaks) + 1, values.shape[1]))
    _raise_to(by_interval, np.searchsorted(breaks, t_norm, side="left"), values)
    _raise_to(by_interval, np.searchsorted(breaks, t_norm, side="right"), values)
    at_breaks = np.maximum(by_interval[1:], by_interval[:-1])
    t = timing.times / timing.t_end
    first, fraction = locate(breaks, t)
    share = fraction[:, None]
    lines = (1.0 - share) * at_breaks[first] + share * at_breaks[first + 1]
    between = np.maximum(lines[1:], lines[:-1])
    station = (np.searchsorted(t, breaks, side="right") - 1).clip(0, len(between) - 1)
    _raise_to(between, station, at_breaks)
    return between


def _raise_to(table: np.ndarray, rows: np.ndarray, values: np.ndarray) -> None:
    """Raise rows of a table, (R, c), to the largest of the values, (K, c), that belong to them; rows, (K,), ascend."""
    first = np.flatnonzero(np.diff(rows, prepend=-1))
    largest = np.maximum.reduceat(values, first)
    table[rows[first]] = np.maximum(table[rows[first]], largest)
