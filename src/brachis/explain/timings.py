"""Timings of the joint path of a phase, or of the part next to one of its ends."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from brachis.common.arrays import spread
from brachis.errors import UnreachableError
from brachis.limits import Limit
from brachis.optimise.phase import Phase
from brachis.timing import Course, TimedCourse

FINE_PLACES = 3000
"""Number of points at which a joint path is timed if a limit or a figure changes by 1 % or less. With 2000 points,
three figures of four motions differed by 1.2 to 1.5 % from the results with 4000 points."""


def lay_course(
    phase: Phase, x: np.ndarray, places: int, intervals: slice = slice(None)
) -> TimedCourse | None:
    """Return the timed course of a motion, (v,), over some intervals of its phase.

    Return None if the speed of the phase is given, or if the motion leaves the joint map.
    """
    if phase.time_law is not None:
        return None
    curves = phase.motion(x)
    breaks = curves.breaks[intervals]
    t = spread(breaks, max(2, places // len(breaks)))
    course = Course(t, *curves.at(t)[:3])
    try:
        # The parameter is the time of the motion, so that its rate is 1.
        return TimedCourse(course, phase.joint_map, phase.limits, np.ones_like(t))
    except UnreachableError:
        return None


def least_time(
    course: TimedCourse | None,
    free_end: int | None = None,
    narrower: Mapping[Limit, np.ndarray] = MappingProxyType({}),
) -> float:
    """Return the least time along a joint path, s; NaN if there is none.

    The speeds at the ends are those of the motion, except that the speed at one end, 0 or -1, may be free. Limits may
    be `narrower`; see `PhasePlane.narrow`.
    """
    if course is None:
        return np.nan
    rates = course.speeds[[0, -1]]
    if free_end is not None:
        rates[free_end] = np.inf
    timing = course.solve((float(rates[0]), float(rates[-1])), narrower)
    return np.nan if timing is None else timing.t_end
