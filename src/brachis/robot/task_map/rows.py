"""Names of the rows of task spaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

AXES: Final = ("x", "y", "z")
YAW: Final = "yaw"
ROWS: Final = (*AXES, YAW)
"""What a task space of rows may consist of."""
POSE_ROWS: Final = (*AXES, "rx", "ry", "rz")
"""Rows of a pose: displacement and rotation along and about the tool frame's axes."""
POSE_COORDINATES: Final = 12
"""Coordinates of a pose: the position, then the rotation matrix row by row."""


def position_rows(rows: Sequence[str]) -> tuple[str, ...]:
    """Return the position rows; they come first."""
    return tuple(row for row in rows if row in AXES)
