"""Rows of a task space, and what a path needs to know of them."""

from __future__ import annotations

from typing import Final

AXES: Final = ("x", "y", "z")
ROWS: Final = (*AXES, "yaw")
"""What a task space of rows may consist of."""
POSE_ROWS: Final = (*AXES, "rx", "ry", "rz")
"""Rows of a pose: displacement and rotation along and about the tool frame's axes."""
POSE_COORDINATES: Final = 12
"""Coordinates of a pose: the position, then the rotation matrix row by row."""


def is_pose(rows: tuple[str, ...]) -> bool:
    """Return whether the rows are those of a pose."""
    return rows == POSE_ROWS


def position_rows(rows: tuple[str, ...]) -> tuple[str, ...]:
    """Return the position rows; they come first."""
    return tuple(row for row in rows if row in AXES)
