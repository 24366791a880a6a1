"""Candidates of a search: which of them are the same motion, and a table of all of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from brachis.errors import UnreachableError
from brachis.optimise.candidate import Candidate, coordinates

NOT_TRIED = "not tried: the time was up"
"""Status of a candidate for which there was no time."""
SAME_MOTION = "same motion as another"
"""Status of a candidate that agrees with one that ranks before it."""
WORTH_IT = 2e-4
"""A motion counts as faster if its end time is less by more than this fraction."""


def round_end_time(time: float) -> float:
    """Leave out the digits in which processes differ, so that these do not choose."""
    return float(f"{time:.6g}")


def is_same_motion(first: Candidate, second: Candidate) -> bool:
    """Tell whether a solved candidate is the same motion as another, and not faster."""
    # Splines of different measures of self-motion have different end times for the same motion.
    slower = 3e-3 if first.in_chart else 1e-4
    difference = first.coarse / second.coarse - 1.0
    if (
        first.redundant_joints != second.redundant_joints
        or first.branch != second.branch
        or not -WORTH_IT <= difference <= slower
    ):
        return False
    postures = []
    for candidate in (first, second):
        assert candidate.program is not None
        try:
            (state,) = candidate.program.states(candidate.reports[-1].x)
        except UnreachableError:
            return False
        postures.append(state.q)
    return bool(np.abs(postures[0] - postures[1]).max() < 0.1)  # rad or m


WORDS = ("joints", "branch", "origin")
TIMES = ("coarse [s]", "t_end [s]")
STATUS = "status"
"""The columns; named as in the JSON."""


def candidate_rows(candidates: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Return a row of text for each candidate, as `Candidate.to_dict` gives it; the same motion is listed once."""
    rows = []
    for candidate in candidates:
        status = str(candidate.get("status", ""))
        if status == SAME_MOTION:
            continue
        branch = str(candidate.get("branch", ""))
        joints = coordinates(candidate.get("redundant_joints", ()), branch)
        origin = str(candidate.get("origin", ""))
        times = (_write_seconds(candidate.get(key)) for key in ("coarse", "t_end"))
        rows.append((joints, branch, origin, *times, status))
    return rows


def _write_seconds(value: object) -> str:
    is_known = isinstance(value, int | float) and math.isfinite(value)
    return f"{value:.4f}" if is_known else ""
