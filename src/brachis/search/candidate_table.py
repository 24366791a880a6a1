"""The candidates of a search as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from brachis.search.stages import coordinates

WORDS = ("joints", "branch", "origin")
TIMES = ("estimate [s]", "t_end [s]")
STATUS = "status"
"""Names of the columns, as in the JSON output."""


def candidate_rows(candidates: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Return a row of text for each candidate, which is a dictionary from `Candidate.to_dict`."""
    rows = []
    for candidate in candidates:
        status = str(candidate.get("status", ""))
        branch = str(candidate.get("branch", ""))
        joints = coordinates(candidate.get("redundant_joints", ()), branch)
        origin = str(candidate.get("origin", ""))
        times = (_write_seconds(candidate.get(key)) for key in ("estimate", "t_end"))
        rows.append((joints, branch, origin, *times, status))
    return rows


def _write_seconds(value: object) -> str:
    is_known = isinstance(value, int | float) and math.isfinite(value)
    return f"{value:.4f}" if is_known else ""
