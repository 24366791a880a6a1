"""Tell whether two solved candidates are the same motion."""

from __future__ import annotations

import numpy as np

from brachis.common import tolerances
from brachis.errors import UnreachableError
from brachis.optimise.candidate import Candidate

SAME_MOTION = "same motion as another"
"""Status of a candidate that agrees with one that ranks before it."""
_COMPARED = 49
"""Even times, or places, at which motions of a phase are compared."""
_SAME_LATER = 4e-3
"""Part of the end time by which a rough answer may be later, and be the same motion."""


def is_same_motion(first: Candidate, second: Candidate) -> bool:
    """Tell whether a solved candidate is the same motion as another, and not faster."""
    # Splines of different measures of self-motion have different end times for the same motion, and some are rough.
    is_rough = first.in_chart or first.is_over_path
    slower = _SAME_LATER if is_rough else tolerances.END_TIME
    difference = first.coarse / second.coarse - 1.0
    if (
        first.redundant_joints != second.redundant_joints
        or first.branch != second.branch
        or not -tolerances.GAIN <= difference <= slower
    ):
        return False
    try:
        pair = _postures_of(first), _postures_of(second)
    except UnreachableError:
        return False
    return bool(np.abs(pair[0] - pair[1]).max() < 0.1)  # rad or m


def _postures_of(candidate: Candidate) -> np.ndarray:
    """Take postures at even times of every phase, or at even places of the path, (P, n), of a solved candidate.

    Raises UnreachableError where it leaves its joint map.
    """
    start = candidate.start
    program = candidate.program
    assert start is not None and program is not None
    if candidate.is_over_path:
        count = _COMPARED * len(start.problem.legs)
        return start.postures_at(np.linspace(0.0, 1.0, count))
    motions = program.motions(candidate.reports[-1].x)
    found = []
    for phase, motion in zip(program.phases, motions, strict=True):
        t = np.linspace(0.0, motion.t_end, _COMPARED)
        found.append(phase.joint_map.state(*motion.at(t), t=t).q)
    return np.concatenate(found)
