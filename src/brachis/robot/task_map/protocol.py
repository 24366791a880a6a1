"""The protocol of task maps, from joint positions to task coordinates with derivatives; and the names of rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Final

import numpy as np

from brachis.common.summary import Summary
from brachis.errors import InputError
from brachis.kernel import Chain, Prescribed, tool_derivatives
from brachis.robot.robot import Robot
from brachis.robot.tool_joints import AXIS
from brachis.task import ToolPose

AXES: Final = ("x", "y", "z")
ANGLES: Final = ("roll", "pitch", "yaw")
"""Angles about the world's x, y and z axes, for tools that turn about only one of these axes."""
ROWS: Final = (*AXES, *ANGLES, AXIS)
"""Rows of which a task space may consist."""
TURN_ROWS: Final = ("rx", "ry", "rz")
POSE_ROWS: Final = (*AXES, *TURN_ROWS)
"""Rows of a pose: displacements along, and rotations about, the axes of the tool frame."""


_JOINT: Final = "joint "


def position_rows(rows: Sequence[str]) -> tuple[str, ...]:
    """Return the rows whose changes measure the length of a path: the position, which comes first, or all joints."""
    return tuple(row for row in rows if row not in {*ANGLES, *TURN_ROWS, AXIS})


def joint_rows(names: Sequence[str]) -> tuple[str, ...]:
    """Return the rows of a joint space with these joint names; no other row has such a name."""
    return tuple(_JOINT + name for name in names)


def joints_of(rows: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the joints whose joint space has these rows; empty if the rows are of the tool."""
    return tuple(row.removeprefix(_JOINT) for row in rows if row.startswith(_JOINT))


@dataclass(frozen=True)
class TaskDerivatives:
    """Derivatives of task velocity and acceleration for K states, (K, m, n) each.

    Attributes
    ----------
    velocity_q : (K, m, n) ndarray
        V_q = d(J qdot)/dq.
    acceleration_q, acceleration_qdot : (K, m, n) ndarray
        A_q and A_v, the derivatives of J qddot + Jdot qdot with respect to q and qdot.
    """

    velocity_q: np.ndarray
    acceleration_q: np.ndarray
    acceleration_qdot: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class TaskMap(Summary):
    """Map from the joint positions of a robot to the c task coordinates of its tool; the task velocity has m rows.

    Attributes
    ----------
    robot : Robot
    rows : tuple of str
        Names of the m rows: first the position (m), then the angles (rad).

    Examples
    --------
    >>> import brachis
    >>> task_map = brachis.task_map_of(brachis.robots.scara3, ["x", "y"])
    >>> task_map.m, task_map.rows
    (2, ('x', 'y'))
    """

    in_tool_axes: ClassVar[bool] = False
    """Whether twists are along the axes of the tool frame; otherwise they are along the axes of the world."""

    robot: Robot
    rows: tuple[str, ...]

    @cached_property
    def axes(self) -> tuple[int, ...]:
        """World axes (0, 1, 2) of the position rows; none in a joint space."""
        return tuple(AXES.index(row) for row in self.rows if row in AXES)

    @property
    def angles(self) -> tuple[str, ...]:
        """Rows after the position: an angle, or three rows of rotation; none in a joint space."""
        return () if joints_of(self.rows) else self.rows[len(self.axes) :]

    @cached_property
    def prescribed(self) -> Prescribed:
        """The prescribed quantities of the tool, in the form that the kernel needs; none in a joint space."""
        return Prescribed(self.axes, len(self.angles), in_tool_axes=self.in_tool_axes)

    @property
    def m(self) -> int:
        """Number of rows."""
        return len(self.rows)

    @property
    def is_of_tool(self) -> bool:
        """Whether the rows prescribe the tool; not in a joint space, and not without rows."""
        return bool(self.axes or self.angles)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of every row."""
        return tuple("m" if row in AXES else "rad" for row in self.rows)

    def read_start(self, stated: Sequence[float] | ToolPose) -> np.ndarray:
        """Return the task coordinates, (c,), of the ``path_start`` of a task, which states rows or a pose.

        Raises
        ------
        InputError
            The number of coordinates differs from the number of rows.
        """
        if isinstance(stated, ToolPose):
            rotation = stated.rotation.as_matrix()
            return self.of_placements(np.array([stated.position]), rotation[None])[0]
        if len(stated) != self.m:
            raise InputError(
                "this is the wrong number of coordinates",
                where="path_start",
                found=len(stated),
                allowed=f"{self.m}: {', '.join(self.rows)}",
            )
        return np.array(stated, dtype=float)

    def value(self, q: np.ndarray) -> np.ndarray:
        """Return the task coordinates, (c,), of one posture, (n,)."""
        return self.values(q[None])[0]

    def values(self, q: np.ndarray) -> np.ndarray:
        """Return the task coordinates, (K, c), of postures, (K, n)."""
        return self.of_placements(*self.robot.tool_placements(q))

    def of_placements(self, positions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
        """Return the task coordinates, (K, c), of tool positions (K, 3) and rotations (K, 3, 3); not in joint space."""
        return positions[:, list(self.axes)]

    def difference(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return the displacement, (..., m), from `second` to `first` task coordinates, (..., c), row by row."""
        return np.asarray(first - second, dtype=float)

    def norms(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the norms, (...), of the position part, m, and the angle part, rad, of displacements, (..., m)."""
        position, angle = np.split(displacement, [len(self.axes)], axis=-1)
        return np.linalg.norm(position, axis=-1), np.linalg.norm(angle, axis=-1)

    def twists(self, q: np.ndarray) -> np.ndarray:
        """Return the tool frame's Jacobian, (6, K, n), in postures (K, n): linear, then angular velocity."""
        return self.place(self.robot.chain, q)[2]

    def place(
        self, chain: Chain, q: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the placements of a chain's tool in K postures, and its `twists`; see `Chain.tool`."""
        return chain.tool(q, in_tool_axes=self.in_tool_axes)

    def rates(self, twists: np.ndarray) -> np.ndarray:
        """Return the task velocity, (m, ...), of twists of the tool, (6, ...); not in joint space."""
        return twists[self.prescribed.parts]

    def jacobian(self, twists: np.ndarray) -> np.ndarray:
        """Return the task Jacobian J, (K, m, n), from the `twists` in K postures."""
        return np.moveaxis(self.rates(twists), 0, 1)

    def sample_jacobians(self) -> np.ndarray:
        """Return task Jacobians J, (20, m, n), in random postures from -1 to 1 rad or m, which are always the same."""
        postures = np.random.default_rng(0).uniform(-1.0, 1.0, (20, self.robot.n))
        return self.jacobian(self.twists(postures))

    def derivatives(
        self, twists: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> TaskDerivatives:
        """Return V_q, A_q and A_v of K states, from the `twists` in their postures."""
        slopes = tool_derivatives(twists, qdot, qddot, in_tool_axes=self.in_tool_axes)
        return TaskDerivatives(*map(self.jacobian, slopes))
