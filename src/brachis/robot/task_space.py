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
POSE_ROWS = ("x", "y", "z", "rx", "ry", "rz")
FREE_ROLL = "pose_free_roll"
WORDS = ("position", "pose", FREE_ROLL)
_POSITIONS = 3
_POSE_COORDINATES = 12
_IN_PLANE = 1.0 - 1e-9


@dataclass(frozen=True)
class TaskSpace:
    """Rows of the tool frame's world position and the in-plane angle where asked for, or the tool frame's pose.

    Task coordinates are the rows themselves. A pose has 12 coordinates for its 6 rows: the position (3), then the
    rotation matrix row by row (9), both in the world frame; its rows are those of the body twist, in the tool frame.

    Attributes
    ----------
    rows : tuple of str
        Out of x, y, z (metres, world frame) and, last, yaw (rad). Yaw turns the first position row's axis towards the
        second's; it is the direction of the tool-frame axis `yaw_axis` within the plane of these two rows.
        Or `POSE_ROWS`: displacement (m) and rotation (rad) along and about the tool frame's own axes.
    yaw_axis : int or None
        Axis of the tool frame (0, 1, 2) whose direction is the yaw angle; None without yaw.
    """

    rows: tuple[str, ...]
    yaw_axis: int | None = None

    @classmethod
    def of(cls, robot: Robot, rows: Sequence[str]) -> TaskSpace:
        """Bind the asked rows, or the word for them, to a robot.

        Raises
        ------
        InputError
            A row or word is unknown, no axis of the tool frame lies in the yaw plane, or the tool cannot roll freely.
        """
        if rows == "position":
            rows = AXES
        if isinstance(rows, str):
            return cls._of_word(robot, rows)
        names = tuple(rows)
        if names == POSE_ROWS:
            return cls(names)
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

    @classmethod
    def _of_word(cls, robot: Robot, word: str) -> TaskSpace:
        """Return the poses, after a check that the tool can roll where that is asked for."""
        if word not in WORDS:
            raise InputError(
                "this task space does not exist",
                where="task_space",
                found=word,
                allowed=f"rows out of {', '.join((*AXES, YAW))}, or one of {', '.join(WORDS)}",
            )
        if word == FREE_ROLL and not robot.rolls_freely:
            raise InputError(
                "the robot's tool does not roll freely",
                where="task_space",
                found=word,
                hint="brachis.robot.bind makes a robot whose tool does",
            )
        return cls(POSE_ROWS)

    @property
    def oriented(self) -> bool:
        """Whether the whole pose is prescribed, so that targets have 12 coordinates."""
        return self.rows == POSE_ROWS

    @property
    def coordinates(self) -> int:
        """Number of coordinates of a target: one for each row, 12 for a pose."""
        return _POSE_COORDINATES if self.oriented else self.m

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
        return tuple("m" if row in AXES else "rad" for row in self.rows)

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
        """Task coordinates, (c,), of one tool placement in the world frame; yaw in (-pi, pi]."""
        return self.values(np.array(placement.translation)[None], np.array(placement.rotation)[None])[0]

    def values(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """Task coordinates, (K, c), of tool positions (K, 3) and rotations (K, 3, 3)."""
        rows = list(self.axes)
        coordinates = positions[:, rows]
        if self.oriented:
            return np.concatenate([coordinates, rotations.reshape(-1, 9)], axis=1)
        if self.yaw_axis is None:
            return coordinates
        direction = rotations[:, rows, self.yaw_axis]
        return np.column_stack([coordinates, np.arctan2(direction[:, 1], direction[:, 0])])

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Displacement (..., m) that leads from the `second` task coordinates (..., c) to the `first`.

        Angles are in [-pi, pi). Between poses it is the translation and the rotation vector, in the frame of `second`.
        """
        if self.oriented:
            return _pose_difference(np.asarray(first, dtype=float), np.asarray(second, dtype=float))
        delta = np.asarray(first - second, dtype=float).copy()
        if self.yaw_axis is not None:
            delta[..., -1] = np.remainder(delta[..., -1] + np.pi, 2.0 * np.pi) - np.pi
        return delta


def _pose_difference(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """See `TaskSpace.difference`; for poses of shape (..., 12)."""
    first, second = np.broadcast_arrays(first, second)
    to = first[..., _POSITIONS:].reshape(*first.shape[:-1], 3, 3)
    back = np.swapaxes(second[..., _POSITIONS:].reshape(*first.shape[:-1], 3, 3), -1, -2)
    shift = np.einsum("...ij,...j->...i", back, first[..., :_POSITIONS] - second[..., :_POSITIONS])
    return np.concatenate([shift, rotation_vectors(back @ to)], axis=-1)


def rotation_vectors(rotations: np.ndarray) -> np.ndarray:
    """Rotation vectors, (..., 3), rad, of rotation matrices (..., 3, 3); accurate for the smallest turns as well."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  (a fifth of a second that other tasks need not wait)

    shape = rotations.shape[:-2]
    return Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_rotvec().reshape(*shape, 3)
