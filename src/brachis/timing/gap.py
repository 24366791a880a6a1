"""The timing gap: how much faster the joint path of a motion could be travelled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.common.arrays import spread
from brachis.common.summary import Summary
from brachis.errors import BrachisWarning
from brachis.limits import Limit
from brachis.robot.plausibility import Issue
from brachis.timing.joint_path import JointPath, divide_turns
from brachis.timing.phase_plane import PhasePlane, is_left_out
from brachis.trajectory import MotionPhase, Trajectory

PLACES = 2000
"""Minimum number of places at which the joint path of a motion is timed."""
_LEAST_PLACES = 4
"""Approximate number of places in each knot interval."""
_MOST_PLACES = 40_000
"""Approximate maximum number of places in all knot intervals together."""
WORTH_A_WARNING = 0.02
"""Timing gap above which a plan gives a warning."""
_STILL = 1e-9
"""Fraction of the largest speed below which a phase counts as beginning or ending at rest."""
_SHARE = 0.8
"""Fraction of the lost time that is lost within the s-interval named in the message."""
_EVERYWHERE = 0.7
"""Length above which an s-interval is not named, because the time is lost along the whole path."""


class SlowTimingWarning(BrachisWarning):
    """Another timing of the same joint path is much faster than the plan.

    The message says how much faster, where on the path the time is lost, and what would help. The warning is also in
    ``result.warnings``, and the figures are in ``result.timing_gap``.

    Examples
    --------
    >>> import warnings
    >>> import brachis
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> [warning.category.__name__ for warning in caught]
    ['SlowTimingWarning']
    >>> result.timing_gap.gap > 0.02
    True
    """


@dataclass(frozen=True, repr=False)
class TimingGap(Summary):
    """A motion compared with the fastest timing of its own joint path.

    Attributes
    ----------
    t_end : float
        End time of the motion, s.
    least_time : float
        Shortest time for the same joint path, s. The speeds at the ends of the phases are those of the motion, and
        accelerations may jump.
    places : int
        Number of grid points with which the least time was computed.
    left_out : tuple of str
        Types of limit that the least time leaves out. If there are any, the least time is only a lower bound.
    s_interval : tuple of float
        Shortest interval of the path coordinate in which four fifths of the extra time are lost.
    advice : str
        Advice on what may give a faster motion.
    """

    t_end: float
    least_time: float
    places: int
    left_out: tuple[str, ...]
    s_interval: tuple[float, float]
    advice: str

    @property
    def gap(self) -> float:
        """Time that the motion takes in excess of the least time, as a fraction of the least time."""
        return self.t_end / self.least_time - 1.0

    def __str__(self) -> str:
        """Return a sentence that says how much faster another timing could be."""
        saved = 100.0 * max(1.0 - self.least_time / self.t_end, 0.0)
        without = ""
        if self.left_out:
            without = f", even without the limit on {' and '.join(self.left_out)}"
        rounded = max(np.ceil(10.0 * saved - 1e-6) / 10.0, 0.1)
        return (
            f"no timing of this joint path is more than {rounded:.1f} % faster{without} "
            f"(on a grid of {self.places} places)"
        )

    def issues(self) -> tuple[Issue, ...]:
        """Say where time is lost and what would help. Return nothing if the gap is small or only a bound."""
        if self.gap <= WORTH_A_WARNING or self.left_out:
            return ()
        low, high = (round(s, 4) for s in self.s_interval)
        saved = 100.0 * (1.0 - self.least_time / self.t_end)
        where = "along the whole path"
        if high - low < _EVERYWHERE:
            where = f"mostly at s = {low:.3g} to {high:.3g}"
        message = (
            f"the same joint path can be travelled in {self.least_time:.4g} s, which is {saved:.1f} % faster; the "
            f"motion loses this time {where}; for a faster motion, {self.advice}"
        )
        motion_text = f"a motion of {self.t_end:.4g} s"
        usual = f"less than {100.0 * WORTH_A_WARNING:.0f} %"
        return (Issue("spline.intervals", message, motion_text, usual),)

    def summary(self) -> Mapping[str, object]:
        """Return the figures shown to the user."""
        return {"t_end": f"{self.t_end:.4f} s", "timing": str(self)}

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON."""
        return {
            "gap": self.gap,
            "least_time_s": self.least_time,
            "places": self.places,
            "left_out": list(self.left_out),
            "s_interval": list(self.s_interval),
        }


def find_timing_gap(
    trajectory: Trajectory, limits: Sequence[Limit]
) -> TimingGap | None:
    """Compare a motion with the fastest timing of its own joint path.

    Pauses and phases of given speed keep their durations in the least time.

    Parameters
    ----------
    trajectory : Trajectory
    limits : sequence of Limit
        Limits of the trajectory's task.

    Returns
    -------
    TimingGap or None
        None if the limits allow no timing of the joint path on the grid.
    """
    total = 0.0
    places = 0
    lost_s = [np.empty(0)]
    lost = [np.empty(0)]
    for phase, spline in zip(trajectory.phases, trajectory.phase_splines, strict=True):
        if phase.kind != "move":
            total += phase.duration
            continue
        timed = _time_phase(trajectory, phase, len(np.unique(spline.knots)) - 1, limits)
        if timed is None:
            return None
        path, motion_times, times = timed
        total += float(times[-1])
        places += len(times)
        lost_s.append(path.s[1:])
        lost.append(np.diff(motion_times) - np.diff(times))
    left_out = sorted({limit.name for limit in limits if is_left_out(limit)})
    interval = _narrowest(np.concatenate(lost_s), np.concatenate(lost))
    advice = "raise search.time_limit"
    if trajectory.task.spline.intervals != "auto":
        advice = "set spline.intervals: auto, or a larger number"
    return TimingGap(trajectory.t_end, total, places, tuple(left_out), interval, advice)


def _time_phase(
    trajectory: Trajectory,
    phase: MotionPhase,
    intervals: int,
    limits: Sequence[Limit],
) -> tuple[JointPath, np.ndarray, np.ndarray] | None:
    """Return a phase's joint path, and the times, (P,), s, of the motion and of the fastest timing at its stations."""
    count = max(PLACES, min(_LEAST_PLACES * intervals, _MOST_PLACES))
    ends = np.unique(np.clip(trajectory.times, phase.begin, phase.end))
    ends = ends[np.append(np.diff(ends) > _STILL * phase.duration, True)]
    # If there are very many nodes, use only some of them.
    ends = np.append(ends[: -1 : -(-len(ends) // count)], ends[-1])
    steps = np.ceil(count * np.diff(ends) / phase.duration).astype(int)
    t = spread(ends, steps)
    t = divide_turns(t, trajectory.velocity(t))
    s = trajectory.path_coordinate(t)
    qdot = trajectory.velocity(t)
    q = trajectory.position(t)
    path, times = JointPath(t, s, q, qdot, trajectory.acceleration(t)).by_length()
    speeds = np.linalg.norm(qdot, axis=1)
    speeds = np.where(speeds > _STILL * speeds.max(), speeds, 0.0)
    timing = PhasePlane(limits, path).solve((float(speeds[0]), float(speeds[-1])))
    if timing is None:
        return None
    return path, times, timing.times


def _narrowest(s: np.ndarray, lost: np.ndarray) -> tuple[float, float]:
    """Find the shortest interval of s, (P,), in which most of the lost time, (P,), is lost."""
    total = np.append(0.0, np.cumsum(np.maximum(lost, 0.0)))
    if np.isnan(s).any() or not total[-1] > 0.0:
        return 0.0, 1.0
    ends = np.searchsorted(total, total + _SHARE * total[-1])
    begins = np.flatnonzero(ends < len(total))
    places = np.append(s[0], s)
    lengths = places[ends[begins]] - places[begins]
    first = begins[int(np.argmin(lengths))]
    return float(places[first]), float(places[ends[first]])
