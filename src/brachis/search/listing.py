"""What the search looked at, as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from brachis.attempt import coordinates
from brachis.search.record import SAME_MOTION

WORDS, TIMES, STATUS = ("joints", "branch", "origin"), ("coarse [s]", "t_end [s]"), "status"
"""The columns; named as in the JSON."""


def candidate_rows(candidates: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Return a row of text for each candidate, as `Attempt.to_dict` gives it; the same motion is listed once."""
    return [
        (
            coordinates(candidate.get("redundant_joints", ()), str(candidate.get("branch", ""))),
            *(str(candidate.get(key, "")) for key in ("branch", "origin")),
            *(_seconds(candidate.get(key)) for key in ("coarse", "t_end")),
            str(candidate.get("status", "")),
        )
        for candidate in candidates
        if candidate.get("status") != SAME_MOTION
    ]


def _seconds(value: object) -> str:
    return f"{value:.4f}" if isinstance(value, int | float) and math.isfinite(value) else ""
