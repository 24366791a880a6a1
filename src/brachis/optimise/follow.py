"""Splines along the fastest timing of a phase's joint path, within its limits.

Splines follow a timing approximately (`timed_splines`). Where they exceed a limit, the limit is narrowed by the excess.
The joint path is then timed again, until the limits are met. This keeps the motion as fast as possible.

Knots are placed where accelerations jump, and where splines over fewer knots exceeded limits. Each knot keeps its place
on the path in every timing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from brachis.common.arrays import spread
from brachis.common.deadline import NEVER, Deadline
from brachis.errors import UnreachableError
from brachis.kinematics import JointMap, JointState
from brachis.limits import Limit, Moments
from brachis.optimise.bspline import clamped_knots, locate
from brachis.optimise.grid import FixedGrid
from brachis.optimise.motion import Motion
from brachis.optimise.phase import Phase
from brachis.optimise.phase_timing import PhaseTiming
from brachis.optimise.timed_splines import (
    between_stations,
    breaks_for,
    even_out,
    move_breaks,
    raise_to,
    splines_along,
    third_points,
)
from brachis.timing import Timing
from brachis.timing.joint_path import halfway

_FIRST_LOSS = 5.0
"""Time that the first intervals together may cost, divided by the time that splines may cost. Where accelerations are
smooth, the estimated cost of intervals is too high by about this factor."""
_SHARE = 0.5
"""Fraction of the tolerance that splines may use up. Imperfect joint paths use up more."""
_AIM = 0.7
"""Target for the next mesh, as a fraction of the time that splines may cost."""
_FINER = (0.02, 0.5)
"""Smallest and largest factor on the time that intervals may cost, applied when a mesh is too slow."""
_WAITS = 0.1
"""Wait at an end for each derivative that vanishes there, as a fraction of the time that splines may cost."""
_FIRST_WAIT = 0.01
"""Wait at an end in splines over the initial knots, as a fraction of the motion time."""
_FOR_AIM = 3
"""Number of the first mesh that may use up all of the tolerance. On paths with many quick bends (example 16), splines
that use up only `_SHARE` would need several times as many knots."""
_MESHES = 6
"""Maximum number of meshes that are tried."""
_MOST_INTERVALS = 200_000
"""Maximum number of intervals of a phase. The verification checks 8 instants in each, 2,000,000 at most."""
_LOOKS = (4, 10)
"""Number of instants per interval at which limits are checked in the first rounds, and after they are met there."""
_ROUNDS = 40
"""Maximum number of times that splines are laid over the same mesh."""
_PATIENCE = 8
"""Maximum number of rounds without gain. With 3, the motion of example 16 was 6.8 % slower than with 8."""
_ENOUGH = 5e-5
"""Largest permitted violation of a limit, as a fraction of the limit."""
_UNCHANGED = 1e-5
"""If a rate or an acceleration changes by no more than this fraction of its limit, it is not checked again. Limits are
not narrowed for smaller violations either. The value is a fifth of `_ENOUGH`. A motion through 500 waypoints took 4e-5
longer when everything was checked again and narrowed in every round."""
_AT_ONCE = 8192
"""Number of instants that are checked together, so that their states stay in the processor's cache."""
_SMALL = 0.01
"""Violation above which limits are narrowed by the violation itself."""
_MORE = 1.5
"""Factor on violations below `_SMALL`, because splines respond by less than limits are narrowed."""
_MOST_MORE = 8.0
"""Largest factor on small violations if few intervals exceed a limit. It makes up for insufficient narrowing in the
last round. With 1.5, a path through 500 waypoints took 18 rounds; with 8, it takes 11."""
_RARE = 0.01
"""Fraction of intervals that counts as few. With a larger fraction, a path of 500 waypoints was 3e-5 slower."""


@dataclass(frozen=True)
class LaidSplines:
    """Splines along a timing.

    Attributes
    ----------
    motion : Motion
    timing : Timing
    delay : float
        Time at which the timing begins in the motion, s.
    """

    motion: Motion
    timing: Timing
    delay: float

    @property
    def times(self) -> np.ndarray:
        """Approximate times, (P,), s, at which the motion passes the stations of the timing."""
        return self.delay + self.timing.times

    def states(
        self, joint_map: JointMap, t: np.ndarray
    ) -> Iterator[tuple[slice, JointState]]:
        """Yield the joint motion at times, (K,), s, in parts; raise UnreachableError as `JointMap.state` does."""
        for begin in range(0, len(t), _AT_ONCE):
            rows = slice(begin, begin + _AT_ONCE)
            station = np.searchsorted(self.times[1:-1], t[rows])
            near = self.timing.path.q[station]
            yield rows, joint_map.state(*self.motion.at(t[rows]), near=near)


@dataclass(frozen=True)
class SplineFit:
    """Splines over one mesh, and how far they violate the limits.

    Attributes
    ----------
    laid : LaidSplines
    violation : float
        Largest violation of a limit; infinite if the violation is not known.
    slower : float
        Minimum fraction by which the motion is slower over this mesh; infinite if the limits cannot be met.
    outside : float
        Largest violation of limits on postures, which a longer time does not relieve; infinite if not known.
    beyond : (N,) ndarray
        Largest violation in each interval before limits were narrowed; empty if not known.
    """

    laid: LaidSplines
    violation: float = np.inf
    slower: float = np.inf
    outside: float = np.inf
    beyond: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def rank(self) -> tuple[float, float]:
        """Sort key, smaller for better splines. Violations of limits on postures come first, then the time."""
        return max(self.outside, _ENOUGH), self.needed_time

    @property
    def needed_time(self) -> float:
        """Approximate motion time with which the limits would be met, s."""
        return self.laid.motion.t_end * (1.0 + self.violation)


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
        Phase over any grid.
    phase_timing : PhaseTiming
    tolerance : float
        Fraction of the time by which the splines may be slower.
    points : int
        Number of collocation points per interval.
    deadline : Deadline, optional
        After this deadline no further mesh is tried, and no limit is narrowed further.

    Returns
    -------
    phase : Phase
        The phase over the knots that the timing needs.
    x : (v,) ndarray
        The splines. None is returned in place of all three if the limits allow no timing.
    violation : float
        Largest violation of a limit, as a fraction of the limit; infinite if not known.
    """
    timing = phase_timing.timing
    if timing is None:
        return None
    free = phase
    phase = phase.with_grid(phase.grid, phase_timing.boundary)
    best = None
    aim = _SHARE * tolerance
    lost = _FIRST_LOSS * aim
    breaks = np.empty(0)
    for number in range(1, _MESHES + 1):
        needed = _knots(phase, phase_timing, timing, lost, _WAITS * aim)
        breaks = even_out(np.union1d(breaks, needed))
        if len(breaks) > _MOST_INTERVALS:
            break
        # Over the last mesh, limits are narrowed until they are met, however slow the motion becomes. A mesh is also
        # the last one if the timing, known only at its stations, cannot guide a finer mesh.
        is_fine = 2 * len(breaks) > len(timing.times)
        is_last = number == _MESHES or is_fine or deadline.passed
        enough = aim if number < _FOR_AIM else tolerance
        allowed = np.inf if is_last else enough
        fit = _hold_limits(phase, phase_timing, breaks, allowed, deadline)
        fit = _look_at_postures(phase, fit)
        if best is None or fit.rank < best.rank:
            best = fit
        if is_last or (fit.slower < enough and fit.outside <= _ENOUGH):
            break
        lost *= np.clip(_AIM * aim / max(fit.slower, aim), *_FINER)
        if len(fit.beyond):
            share = _AIM * aim / len(fit.beyond)
            steps = np.diff(breaks)
            is_over = (steps * fit.beyond > share) & (steps > 0.25 / len(timing.times))
            breaks = np.union1d(breaks, halfway(breaks)[is_over])
    if best is None:
        return None
    finer, x = _as_phase(free, best.laid.motion, points)
    return finer, x, best.violation


def begin(
    phase: Phase,
    phase_timing: PhaseTiming,
    lost: float,
    intervals: int,
    points: int,
) -> tuple[Phase, np.ndarray]:
    """Lay splines along a timing over few intervals. The splines may exceed limits.

    Parameters
    ----------
    phase, phase_timing, points
        See `follow`.
    lost : float
        Fraction of the time that the intervals together may cost.
    intervals : int
        Approximate number of intervals.

    Returns
    -------
    phase : Phase
    x : (v,) ndarray
    """
    timing = phase_timing.timing
    assert timing is not None
    given = phase.with_grid(phase.grid, phase_timing.boundary)
    breaks = _knots(given, phase_timing, timing, lost, _FIRST_WAIT, intervals)
    motion = _lay_splines(given, phase_timing, timing, breaks).motion
    return _as_phase(phase, motion, points)


def _knots(
    phase: Phase,
    phase_timing: PhaseTiming,
    timing: Timing,
    lost: float,
    shortest: float,
    max_intervals: int = _MOST_INTERVALS + 1,
) -> np.ndarray:
    """Choose knots, (N + 1,), with `breaks_for`. If accelerations are given at an end, shorten the end intervals."""
    breaks = breaks_for(phase_timing.course, timing, lost, max_intervals)
    ends = phase.boundary.start, phase.boundary.end
    if any(len(end[-1].given) > 1 for end in ends):
        breaks = even_out(np.union1d(breaks, [shortest, 1.0 - shortest]))
    return breaks


def _vanishing(phase: Phase) -> tuple[int, int]:
    """Return the number of vanishing derivatives at each end of a phase, from the acceleration upwards."""
    ends = phase.boundary.start, phase.boundary.end
    first, last = (0 if end[0].rate else max(len(end[-1].given) - 1, 0) for end in ends)
    return first, last


def _lay_splines(
    phase: Phase, phase_timing: PhaseTiming, timing: Timing, breaks: np.ndarray
) -> LaidSplines:
    """Lay splines along a timing over knots, within the boundary conditions; see `splines_along`.

    For the acceleration, and for each of its derivatives, that vanishes at an end, an interval as long as its neighbour
    is added there. The start of the timing is delayed by the duration of the added intervals.
    """
    first, last = _vanishing(phase)
    ahead = breaks[1] * np.arange(first)
    behind = (1.0 - breaks[-2]) * np.arange(1, last + 1)
    before = breaks[1] * first
    moved = before + np.concatenate([ahead - before, breaks, 1.0 + behind])
    delays = (before * timing.t_end, (moved[-1] - before - 1.0) * timing.t_end)
    knots = clamped_knots(phase.degree, moved / moved[-1])
    splines = phase.boundary.splines(knots, phase.degree)
    third = third_points(phase.boundary, splines, timing.t_end + sum(delays))
    motion = splines_along(
        phase_timing.course, timing, knots, phase.degree, delays, third
    )
    t_end = motion.t_end
    points = [
        spline.control_points(spline.free_from(nearly, t_end), t_end)
        for spline, nearly in zip(splines, motion.control_points, strict=True)
    ]
    if phase.joint_map.path is not None:
        # Where the tool stands still, means of its rate are inexact, and s might decrease.
        points[0] = np.maximum.accumulate(points[0].clip(max=points[0][-1]))
    motion = replace(motion, control_points=np.array(points))
    return LaidSplines(motion, timing, delays[0])


def _as_phase(phase: Phase, motion: Motion, points: int) -> tuple[Phase, np.ndarray]:
    """Return the phase over the knots of a motion, and its point x."""
    t_norm = spread(np.unique(motion.knots), points)
    finer = phase.with_grid(FixedGrid(motion.knots, phase.degree, t_norm))
    return finer, finer.variables_from(motion)


def _look_at_postures(phase: Phase, fit: SplineFit) -> SplineFit:
    """Find the violation of limits on postures, if the splines' violation of other limits is known."""
    if not np.isfinite(fit.violation):
        return fit
    t = spread(fit.laid.motion.breaks, _LOOKS[-1])
    try:
        outside = max(
            phase.posture_violation(Moments.at_rest(state.q))
            for _, state in fit.laid.states(phase.joint_map, t)
        )
    except UnreachableError:
        return replace(fit, outside=np.inf)
    return replace(fit, outside=outside)


class _Violations:
    """Largest violations of limits between knots. They stay valid where the timing of the path does not change.

    Parameters
    ----------
    phase : Phase
    phase_timing : PhaseTiming
        Phase timing whose `timing` is not None.
    breaks : (N + 1,) ndarray
        Knots in the normalised time of this timing.

    Attributes
    ----------
    by_limit : dict of Limit to (N, c) ndarray
        Violations in each interval. Those during the waits at the ends count for the first and the last interval.
    """

    def __init__(
        self, phase: Phase, phase_timing: PhaseTiming, breaks: np.ndarray
    ) -> None:
        fastest = phase_timing.timing
        assert fastest is not None
        self._phase = phase
        self._course = phase_timing.course
        self._fastest = np.maximum(fastest.middle_rate, np.finfo(float).tiny)
        self._interval, _ = locate(breaks, fastest.times / fastest.t_end)
        self.by_limit = {
            limit: np.zeros((len(breaks) - 1, len(limit.labels)))
            for limit in phase.limits
            if limit.is_checked_at_points and limit.longer_time == "relieves"
        }
        self.worst = np.zeros(len(breaks) - 1)
        self.forget()

    def forget(self) -> None:
        """Mark all intervals for checking next time."""
        self._known = np.full((len(self._fastest), 1), np.inf)
        self._earlier: dict[Limit, tuple[np.ndarray, np.ndarray]] = {}

    def look(self, laid: LaidSplines, looks: int) -> None:
        """Check limits close to changes of the timing: at stations, and at the ends of `looks` steps in each interval.

        Raises
        ------
        UnreachableError
            The joint map has no posture at one of these times.
        """
        is_new = self._find_changes(laid.timing)
        for violations in self.by_limit.values():
            violations[is_new] = 0.0
        breaks = laid.motion.breaks
        before, _ = _vanishing(self._phase)
        interval = np.arange(len(breaks) - 1) - before
        interval = interval.clip(0, len(is_new) - 1)
        (number,) = np.nonzero(is_new[interval])
        share = np.linspace(0.0, 1.0, looks + 1)
        t = breaks[number, None] + np.diff(breaks)[number, None] * share
        self._raise(laid, t.ravel(), np.repeat(interval[number], looks + 1))
        at_stations = is_new[self._interval]
        self._raise(laid, laid.times[at_stations], self._interval[at_stations])
        largest = (violations.max(axis=1) for violations in self.by_limit.values())
        self.worst = np.max([np.zeros(len(is_new)), *largest], axis=0)

    def find_excess(self, least: float) -> Iterator[tuple[Limit, np.ndarray]]:
        """Yield amounts by which to narrow limits, (N, c): violations; small ones are multiplied by `least` or more."""
        is_rare = np.mean(self.worst > _ENOUGH) < _RARE
        largest = _MOST_MORE if is_rare else _MORE
        for limit, known in self.by_limit.items():
            factor = np.full_like(known, least)
            if limit in self._earlier:
                before, narrowed = self._earlier[limit]
                gain = (before - known).clip(min=np.finfo(float).eps)
                factor = (narrowed / gain).clip(least, largest)
            factor[known > _SMALL] = 1.0
            excess = np.where(known > _UNCHANGED, factor * known, 0.0)
            self._earlier[limit] = (known.copy(), excess)
            yield limit, excess / limit.violation_scale

    def _raise(self, laid: LaidSplines, t: np.ndarray, interval: np.ndarray) -> None:
        """Raise the known violations of intervals, (K,), ascending, to the violations at times in them, (K,), s."""
        for rows, state in laid.states(self._phase.joint_map, t):
            for limit, violations in self.by_limit.items():
                values = limit.violation(limit.values(state))
                raise_to(violations, interval[rows], values)

    def _find_changes(self, timing: Timing) -> np.ndarray:
        """Tell for each interval, (N,), whether the timing has changed close to it since it was last checked."""
        rate = timing.middle_rate / self._fastest
        now = np.column_stack([rate, self._course.accelerations(timing)])
        is_changed = (np.abs(now - self._known) > _UNCHANGED).any(axis=1)
        self._known = np.where(is_changed[:, None], now, self._known)
        (step,) = np.nonzero(is_changed)
        # The effect of a knot extends as far as splines share control points.
        beside = self._phase.degree + 1
        count = len(self.worst)
        first = (self._interval[step] - beside).clip(min=0)
        behind = (self._interval[step + 1] + beside + 1).clip(max=count)
        begun = np.bincount(first, minlength=count + 1)
        ended = np.bincount(behind, minlength=count + 1)
        return np.asarray(np.cumsum(begun - ended)[:count] > 0)


def _hold_limits(
    phase: Phase,
    phase_timing: PhaseTiming,
    breaks: np.ndarray,
    allowed: float,
    deadline: Deadline,
) -> SplineFit:
    """Lay splines until they meet the limits, or are slower by more than a fraction `allowed` of the time."""
    fastest = phase_timing.timing
    assert fastest is not None
    timing = fastest
    laid = _lay_splines(phase, phase_timing, timing, breaks)
    best = SplineFit(laid)
    violations = _Violations(phase, phase_timing, breaks)
    idle = 0
    least_excess = np.inf
    looks, closer = _LOOKS
    narrower: dict[Limit, np.ndarray] = {}
    for _ in range(_ROUNDS):
        try:
            violations.look(laid, looks)
        except UnreachableError:
            return best
        violation = float(violations.worst.max())
        if not narrower and looks < closer:
            beyond = violations.worst
        fit = SplineFit(laid, violation, beyond=beyond)
        excess = float(violations.worst.sum())
        is_faster = fit.needed_time < best.needed_time * (1.0 - _ENOUGH)
        idle = 0 if is_faster or excess < least_excess else idle + 1
        least_excess = min(excess, least_excess)
        if fit.needed_time < best.needed_time:
            best = fit
        slower = laid.motion.t_end / fastest.t_end - 1.0
        if slower > allowed:
            return replace(best, slower=slower)
        if violation <= _ENOUGH and looks < closer:
            looks = closer
            violations.forget()
            least_excess = np.inf
            best = replace(best, violation=np.inf)
            continue
        if violation <= _ENOUGH or idle > _PATIENCE or deadline.passed:
            break
        least = _MORE if narrower else 1.0
        for limit, amount in violations.find_excess(least):
            added = between_stations(amount, breaks, timing)
            narrower[limit] = narrower.get(limit, 0.0) + added
        next_timing = phase_timing.course.solve(phase_timing.rates, narrower)
        if next_timing is None:
            return best
        breaks = move_breaks(breaks, timing, next_timing)
        timing = next_timing
        laid = _lay_splines(phase, phase_timing, timing, breaks)
    return replace(best, slower=best.needed_time / fastest.t_end - 1.0)
