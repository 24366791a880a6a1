"""Samples of a trajectory at given times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from brachis.common.arrays import freeze, with_like_signs
from brachis.common.summary import Summary
from brachis.errors import NotInstalledError
from brachis.robot import Robot

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = {"q": "q", "qd": "qdot", "qdd": "qddot", "tau": "tau"}
"""Prefixes of the columns of a table, and the quantities that they stand for."""


@dataclass(frozen=True, eq=False, repr=False)
class Samples(Summary):
    """A trajectory sampled at K times, with the joints in chain order. The arrays are read-only.

    Attributes
    ----------
    t : (K,) ndarray
        Times of the samples, s.
    s : (K,) ndarray
        Path coordinates, dimensionless.
    q, qdot, qddot : (K, n) ndarray
        Joint positions (rad or m), velocities and accelerations.
    tau : (K, n) ndarray or None
        Joint torques (Nm or N); None if the URDF has no masses.
    tool_position : (K, 3) ndarray
        Position of the tool frame in the frame of the paths, m: in the world, or in the robot's workpiece frame.
    tool_quaternion : (K, 4) ndarray
        Orientation of the tool frame, w, x, y, z, with signs chosen so that successive quaternions are close.
    tool_speed : (K,) ndarray
        Speed of the tool frame's origin in the frame of the paths, m/s.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single")
    >>> samples = result.sample(dt=0.1)
    >>> samples.tool_position[-1].round(3).tolist(), samples.tool_quaternion.shape
    ([1.732, 1.0, 0.0], (24, 4))
    """

    t: np.ndarray
    s: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    tau: np.ndarray | None
    tool_position: np.ndarray
    tool_quaternion: np.ndarray
    tool_speed: np.ndarray

    def __post_init__(self) -> None:
        """Make the arrays read-only copies."""
        freeze(self, *(field.name for field in fields(self)))

    @property
    def columns(self) -> dict[str, str]:
        """Entries of `COLUMNS` whose quantities are known for these samples."""
        return {
            prefix: quantity
            for prefix, quantity in COLUMNS.items()
            if getattr(self, quantity) is not None
        }

    def __len__(self) -> int:
        """Return the number of times, K."""
        return len(self.t)

    def joint_columns(self, joint_names: Sequence[str]) -> dict[str, np.ndarray]:
        """Return the columns, (K,), of a table by name: ``q_``, ``qd_``, ``qdd_`` and ``tau_`` plus a joint's name.

        Torques are left out if they are unknown.
        """
        columns: dict[str, np.ndarray] = {}
        for prefix, quantity in self.columns.items():
            names = [f"{prefix}_{joint}" for joint in joint_names]
            columns |= zip(names, getattr(self, quantity).T, strict=True)
        return columns

    def to_dataframe(self, joint_names: tuple[str, ...]) -> pd.DataFrame:
        """Return a pandas table with a row for each time; see `Trajectory.to_dataframe`.

        Raises
        ------
        NotInstalledError
            pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError:
            raise NotInstalledError("a table", "pandas", "pandas") from None
        columns = {"t": self.t, "s": self.s, **self.joint_columns(joint_names)}
        names = [f"tool_{axis}" for axis in ("x", "y", "z", "qw", "qx", "qy", "qz")]
        pose = np.hstack([self.tool_position, self.tool_quaternion])
        columns |= zip(names, pose.T, strict=True)
        return pd.DataFrame({**columns, "tool_speed": self.tool_speed})

    def summary(self) -> Mapping[str, object]:
        """Return the range of times and the shapes, for display."""
        return {
            "t": f"{self.t[0]:.4g} to {self.t[-1]:.4g} s" if len(self) else "none",
            "K": len(self),
            "n": self.q.shape[1],
        }


def tool_motion(
    robot: Robot, q: np.ndarray, qdot: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the pose and the speed of the tool frame in the frame of the paths. Virtual joints do not move it.

    Parameters
    ----------
    robot : Robot
    q, qdot : (K, n) ndarray

    Returns
    -------
    position : (K, 3) ndarray
        Positions of the tool frame, m.
    quaternion : (K, 4) ndarray
        Unit quaternions w, x, y, z, with signs chosen so that successive quaternions are close.
    speed : (K,) ndarray
        Speeds of the frame's origin, m/s.
    """
    q = robot.of_real_joints(q)
    qdot = robot.of_real_joints(qdot)
    position, rotations = robot.tool_placements(q)
    coefficients = [pin.Quaternion(rotation).coeffs() for rotation in rotations]
    quaternion = np.roll(np.reshape(coefficients, (-1, 4)), 1, axis=1)
    speed = robot.chain.tool_sizes("speed", q, qdot, np.zeros_like(q))
    return position, with_like_signs(quaternion), speed
