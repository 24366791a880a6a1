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


_ANGLES: Final = (YAW, *POSE_ROWS[3:])
_JOINT: Final = "joint "


def position_rows(rows: Sequence[str]) -> tuple[str, ...]:
    """Return the rows whose change is a path's length: those of the position, which come first, or all joints."""
    return tuple(row for row in rows if row not in _ANGLES)


def joint_rows(names: Sequence[str]) -> tuple[str, ...]:
    """Return the rows of a space of joints, from their names; no other row is called so."""
    return tuple(_JOINT + name for name in names)


def joints_of(rows: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the joints whose space has these rows; none where it is the space of a tool."""
    return tuple(row.removeprefix(_JOINT) for row in rows if row.startswith(_JOINT))
