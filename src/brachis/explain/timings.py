"""Timings of the joint path of a phase: of all of it, or of what is beside one of its ends."""

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
"""Places at which a joint path is timed if a limit or a figure changes by 1 % or less: with 2000, three figures of four
motions were 1.2 to 1.5 % off those with 4000."""


def lay_course(
    phase: Phase, x: np.ndarray, places: int, intervals: slice = slice(None)
) -> TimedCourse | None:
    """Lay the joint path of a motion, (v,), over some intervals of its phase; None where its speed is given.

    None too where it leaves the joint map.
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
    """Time a joint path, s; NaN where that is not possible.

    The ends are passed as the motion passes them; one of them, 0 or -1, may be free. Limits may be `narrower`,
    see `PhasePlane.narrow`.
    """
    if course is None:
        return np.nan
    rates = course.speeds[[0, -1]]
    if free_end is not None:
        rates[free_end] = np.inf
    timing = course.solve((float(rates[0]), float(rates[-1])), narrower)
    return np.nan if timing is None else timing.t_end
