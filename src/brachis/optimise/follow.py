"""Splines along the fastest timing of a phase's joint path, within its limits.

Splines follow a timing nearly (`timed_splines`). Where they exceed a limit, this is narrowed there by so much, and the
joint path is timed anew, until the limits hold. That leaves the motion as fast as possible.

Knots stand where accelerations jump. They stay there on the path, whatever its timing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from brachis.common.arrays import spread
from brachis.errors import UnreachableError
from brachis.limits import Limit
from brachis.optimise.bspline import clamped_knots
from brachis.optimise.grid import FixedGrid
from brachis.optimise.motion import Motion
from brachis.optimise.phase import Phase, is_checked_at_points
from brachis.optimise.phase_timing import PhaseTiming, largest_acceleration
from brachis.optimise.timed_splines import breaks_for, splines_along
from brachis.timing import Timing

_FIRST_LOSS = 6.0
"""What the intervals may lose together at first, in tolerances."""
_ENOUGH_SLOWER = 1.0
"""Tolerances by which splines may be slower than the timing."""
_FINER = (0.01, 0.6)
"""Smallest and largest factor of what they may lose, where that was too slow."""
_SLOWER_BY_LOSS = 1.6
"""Power of the slowness wanted that is the factor of the loss, about."""
_STALLED = 0.15
"""Part of the slowness by which it has to change from mesh to mesh if more are to be tried."""
_MESHES = 4
"""Choices of knots that are tried, no more."""
_MOST_INTERVALS = 40_000
"""Intervals of a phase: the verification looks at 8 instants in each, and at no more than 400,000."""
_LOOKS = 8
"""Times in each interval at which limits are looked at."""
_LOOKS_A_PIECE = 32
"""Times in each piece of a path."""
_ROUNDS = 20
"""Splines that are laid over some knots, no more."""
_PATIENCE = 3
"""Rounds that may gain nothing, no more."""
_ENOUGH = 5e-5
"""Violation of a limit, as a part of it, that is small enough."""


@dataclass(frozen=True)
class Followed:
    """A motion along a timing.

    Attributes
    ----------
    phase : Phase
        Over the knots that the timing needs.
    x : (v,) ndarray
    violation : float
        Largest violation of a limit that was seen, as a part of it.
    """

    phase: Phase
    x: np.ndarray
    violation: float

    @property
    def needed(self) -> float:
        """Time in which the limits would hold, about, s."""
        return self.phase.motion(self.x).t_end * (1.0 + self.violation)


def follow(
    phase: Phase, own: PhaseTiming, tolerance: float, points: int
) -> Followed | None:
    """Lay splines along the fastest timing of a phase's joint path, within the limits.

    Parameters
    ----------
    phase : Phase
        With another grid.
    own : PhaseTiming
    tolerance : float
        Part of the time by which they should not be slower.
    points : int
        Collocation points an interval.

    Returns
    -------
    Followed or None
        None where the limits allow no timing.
    """
    timing = own.without_spikes().timing
    if timing is None:
        return None
    best: tuple[Motion, float] | None = None
    least = np.inf
    slower = np.inf
    lost = _FIRST_LOSS * tolerance
    enough = _ENOUGH_SLOWER * tolerance
    for _ in range(_MESHES):
        breaks = _knots(phase, own, timing, lost)
        if len(breaks) > _MOST_INTERVALS:
            break
        motion, violation = _hold_limits(phase, own, timing, breaks)
        needed = motion.t_end * (1.0 + violation)
        if needed < least:
            least = needed
            best = motion, violation
        before = slower
        slower = needed / timing.t_end - 1.0
        if slower < enough or abs(slower - before) < _STALLED * before:
            break
        wanted = 0.5 * enough / slower
        lost *= np.clip(wanted**_SLOWER_BY_LOSS, *_FINER)
    if best is None:
        return None
    return Followed(*_as_phase(phase, best[0], points), best[1])


def begin(
    phase: Phase, own: PhaseTiming, lost: float, most: int, points: int
) -> tuple[Phase, np.ndarray] | None:
    """Lay splines along the fastest timing over few intervals; limits may be exceeded.

    Parameters
    ----------
    phase, own, points
        As of `follow`.
    lost : float
        Part of the time that the intervals may lose together.
    most : int
        Intervals, about.

    Returns
    -------
    phase : Phase
    x : (v,) ndarray
        None where the limits allow no timing.
    """
    if own.timing is None:
        return None
    breaks = _knots(phase, own, own.timing, lost, most)
    motion = _lay_splines(phase, own, own.timing, breaks)
    return _as_phase(phase, motion, points)


def _knots(
    phase: Phase,
    own: PhaseTiming,
    timing: Timing,
    tolerance: float,
    most: float = np.inf,
) -> np.ndarray:
    """Choose knots, (N + 1,), over which splines follow a timing; see `breaks_for`."""
    ends = (phase.boundary.start, phase.boundary.end)
    from_rest = max(len(end[0].derivatives) for end in ends) > 1
    return breaks_for(own.course, timing, tolerance, from_rest=from_rest, most=most)


def _lay_splines(
    phase: Phase, own: PhaseTiming, timing: Timing, breaks: np.ndarray
) -> Motion:
    """Lay splines along a timing over knots, within the boundary conditions; see `splines_along`."""
    ends = phase.boundary.start, phase.boundary.end
    first, last = (max(len(end[-1].derivatives) - 1, 0) for end in ends)
    knots = clamped_knots(phase.degree, breaks)
    motion = splines_along(own.course, timing, knots, phase.degree, (first, last))
    splines = phase.boundary.splines(knots, phase.degree)
    t_end = motion.t_end
    points = [
        spline.control_points(spline.free_from(nearly, t_end), t_end)
        for spline, nearly in zip(splines, motion.control_points, strict=True)
    ]
    if phase.joint_map.path is not None:
        # Where the tool stands, means of its rate are not exact.
        points[0] = np.maximum.accumulate(points[0].clip(max=points[0][-1]))
    return replace(motion, control_points=np.array(points))


def _as_phase(phase: Phase, motion: Motion, points: int) -> tuple[Phase, np.ndarray]:
    """Return the phase over the knots of a motion, and its point x."""
    t_norm = spread(np.unique(motion.knots), points)
    finer = phase.with_grid(FixedGrid(motion.knots, phase.degree, t_norm))
    return finer, finer.variables_from(motion)


def _hold_limits(
    phase: Phase, own: PhaseTiming, timing: Timing, breaks: np.ndarray
) -> tuple[Motion, float]:
    """Lay splines until the limits hold: the best motion, and its largest violation; infinite if it is not known."""
    most_acceleration = largest_acceleration(timing)
    limits = [
        limit
        for limit in phase.limits
        if is_checked_at_points(limit) and limit.longer_time == "relieves"
    ]
    motion = _lay_splines(phase, own, timing, breaks)
    best = motion, np.inf
    least = np.inf
    idle = 0
    narrower: dict[Limit, np.ndarray] = {}
    for _ in range(_ROUNDS):
        t_norm = _look_at(phase, motion, breaks)
        t = t_norm * motion.t_end
        try:
            state = phase.joint_map.state(*motion.at(t), t=t)
        except UnreachableError:
            break
        beyond = {
            limit: limit.violation(limit.values(state)).clip(0.0) for limit in limits
        }
        violation = max((each.max() for each in beyond.values()), default=0.0)
        needed = motion.t_end * (1.0 + violation)
        idle = 0 if needed < least * (1.0 - _ENOUGH) else idle + 1
        if needed < least:
            least = needed
            best = motion, float(violation)
        if violation <= _ENOUGH or idle > _PATIENCE:
            break
        for limit in limits:
            excess = beyond[limit] / limit.violation_scale
            more = _between_stations(excess, t_norm, breaks, timing)
            narrower[limit] = narrower.get(limit, 0.0) + more
        slower = own.course.solve(own.rates, narrower, most_acceleration)
        if slower is None:
            break
        breaks = _move(breaks, timing, slower)
        timing = slower
        motion = _lay_splines(phase, own, timing, breaks)
    return best


def _move(breaks: np.ndarray, before: Timing, timing: Timing) -> np.ndarray:
    """Move knots, (N + 1,), to the times at which another timing passes the same places."""
    places = np.interp(breaks, before.times / before.t_end, before.path.p)
    moved = np.interp(places, timing.path.p, timing.times / timing.t_end)
    return np.concatenate([[0.0], moved[1:-1], [1.0]])


def _look_at(phase: Phase, motion: Motion, breaks: np.ndarray) -> np.ndarray:
    """List normalised times at which limits are looked at: in every knot interval, and in every piece of the path."""
    t_norm = spread(breaks, _LOOKS)
    path = phase.joint_map.path
    if path is None or len(path.breaks) < 3:
        return t_norm
    s = np.maximum.accumulate(motion.at(t_norm * motion.t_end)[0][:, 0])
    inside = path.breaks[(path.breaks > s[0]) & (path.breaks < s[-1])]
    if not len(inside):
        return t_norm
    ends = np.concatenate([s[:1], inside, s[-1:]])
    # Closer together beside the ends, where the curvature changes.
    part = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, _LOOKS_A_PIECE + 1))
    pieces = ends[:-1, None] + np.diff(ends)[:, None] * part
    return np.union1d(t_norm, np.interp(pieces.ravel(), s, t_norm))


def _between_stations(
    values: np.ndarray, t_norm: np.ndarray, breaks: np.ndarray, timing: Timing
) -> np.ndarray:
    """Take the largest of values, (K, c), in the knot intervals between stations, (P - 1, c)."""
    each = np.zeros((len(breaks) - 1, values.shape[1]))
    for side in ("left", "right"):
        interval = np.searchsorted(breaks, t_norm, side=side) - 1
        np.maximum.at(each, interval.clip(0, len(each) - 1), values)
    t_norm = timing.times / timing.t_end
    first = np.searchsorted(breaks, t_norm[:-1], side="right") - 1
    last = np.searchsorted(breaks, t_norm[1:], side="left")
    first = np.clip(first, 0, len(each) - 1)
    pairs = np.column_stack([first, np.maximum(last, first + 1)]).ravel()
    ended = np.pad(each, ((0, 1), (0, 0)))
    return np.asarray(np.maximum.reduceat(ended, pairs)[::2])
