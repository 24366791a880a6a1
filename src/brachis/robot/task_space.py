"""The task space: which rows of the tool's placement the path prescribes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from brachis.errors import InputError
from brachis.robot.robot import Robot

AXES = ("x", "y", "z")
YAW = "yaw"
_IN_PLANE = 1.0 - 1e-9


@dataclass(frozen=True)
class TaskSpace:
    """Rows of the tool frame's world position, and the in-plane angle where asked for.

    Attributes
    ----------
    rows : tuple of str
        Out of x, y, z (metres, world frame) and, last, yaw (rad). Yaw turns the first position row's axis towards the
        second's; it is the direction of the tool-frame axis `yaw_axis` within the plane of these two rows.
    yaw_axis : int or None
        Axis of the tool frame (0, 1, 2) whose direction is the yaw angle; None without yaw.
    """

    rows: tuple[str, ...]
    yaw_axis: int | None = None

    @classmethod
    def of(cls, robot: Robot, rows: Sequence[str]) -> TaskSpace:
        """Bind the asked rows to a robot.

        Raises
        ------
        InputError
            A row is unknown, or no axis of the tool frame lies in the yaw plane.
        """
        if isinstance(rows, str):
            raise InputError(
                "this task space is not supported yet",
                where="task_space",
                found=rows,
                allowed="rows out of x, y, z, yaw",
            )
        names = tuple(rows)
        positions = [row for row in names if row in AXES]
        if any(row not in (*AXES, YAW) for row in names) or len(set(names)) != len(names) or not positions:
            raise InputError(
                "rows are not usable", where="task_space", found=list(names), allowed="x, y, z, yaw, each once"
            )
        if YAW not in names:
            return cls(names)
        if names[-1] != YAW or len(positions) != 2:  # noqa: PLR2004
            raise InputError(
                "yaw needs exactly two position rows before it",
                where="task_space",
                found=list(names),
                allowed="[x, y, yaw]",
            )
        rotation = robot.tool_placement(np.zeros(robot.n)).rotation
        in_plane = np.linalg.norm(rotation[[AXES.index(row) for row in positions]], axis=0)
        if in_plane.max() < _IN_PLANE:
            raise InputError(
                "no axis of the tool frame lies in the plane in which yaw turns",
                where="task_space",
                found=list(names),
                hint="Attach a tool frame with an axis in this plane",
            )
        return cls(names, int(np.argmax(in_plane >= _IN_PLANE)))

    @property
    def m(self) -> int:
        """Number of rows."""
        return len(self.rows)

    @property
    def axes(self) -> tuple[int, ...]:
        """World axes (0, 1, 2) of the position rows."""
        return tuple(AXES.index(row) for row in self.rows if row in AXES)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of every row."""
        return tuple("rad" if row == YAW else "m" for row in self.rows)

    @property
    def yaw_sign(self) -> float:
        """+1 where yaw turns about the positive third world axis, -1 otherwise."""
        first, second = self.axes[:2]
        return 1.0 if (second - first) % 3 == 1 else -1.0

    @property
    def yaw_world_axis(self) -> int:
        """World axis (0, 1, 2) about which yaw turns."""
        return 3 - sum(self.axes[:2])

    def value(self, placement: pin.SE3) -> np.ndarray:
        """Task coordinates, (m,), of one tool placement in the world frame; yaw in (-pi, pi]."""
        return self.values(np.array(placement.translation)[None], np.array(placement.rotation)[None])[0]

    def values(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """Task coordinates, (K, m), of tool positions (K, 3) and rotations (K, 3, 3)."""
        rows = list(self.axes)
        coordinates = positions[:, rows]
        if self.yaw_axis is None:
            return coordinates
        direction = rotations[:, rows, self.yaw_axis]
        return np.column_stack([coordinates, np.arctan2(direction[:, 1], direction[:, 0])])

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Difference of task coordinates (..., m); angles in [-pi, pi)."""
        delta = np.asarray(first - second, dtype=float).copy()
        if self.yaw_axis is not None:
            delta[..., -1] = np.remainder(delta[..., -1] + np.pi, 2.0 * np.pi) - np.pi
        return delta
