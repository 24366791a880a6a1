"""What a controller is given: the motion of a robot's joints at regular times."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from brachis.errors import UnknownNameError
from brachis.robot import ROLL_JOINT
from brachis.trajectory import Trajectory
from brachis.trajectory.samples import COLUMNS


@dataclass(frozen=True, eq=False)
class JointRows:
    """Motion of some joints at K times.

    Attributes
    ----------
    joints : tuple of str
        Names, in the order of the columns.
    units : tuple of str
        Of their positions, ``rad`` or ``m``.
    t, s : (K,) ndarray
        s; path coordinate, dimensionless.
    q, qdot, qddot, tau : (K, joints) ndarray
        Position (rad or m), velocity, acceleration, torque (Nm) or force (N).
    """

    joints: tuple[str, ...]
    units: tuple[str, ...]
    t: np.ndarray
    s: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    tau: np.ndarray

    def columns(self) -> Iterator[tuple[str, np.ndarray]]:
        """Yield names and values, (K,), of a table: ``t``, then ``q_``, ``qd_``, ``qdd_``, ``tau_`` of every joint."""
        yield "t", self.t
        for prefix, quantity in COLUMNS.items():
            yield from zip((f"{prefix}_{joint}" for joint in self.joints), getattr(self, quantity).T, strict=True)


def rows_of(trajectory: Trajectory, dt: float, last: str, joints: Sequence[str] | None) -> JointRows:
    """Sample joints of a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
    dt : float
        Period, s.
    last : {"exact", "hold"}
        See `Trajectory.sample`.
    joints : sequence of str or None
        Which, in which order; None: all that the robot has, which the virtual joint of a freely rolling tool is not.

    Raises
    ------
    InputError
        `dt` or `last` cannot be used.
    UnknownNameError
        There is no such joint.
    """
    names = trajectory.joint_names
    chosen = tuple(name for name in names if name != ROLL_JOINT) if joints is None else tuple(joints)
    unknown = [name for name in chosen if name not in names]
    if unknown:
        raise UnknownNameError("joint", unknown[0], names, where="joints")
    index = [names.index(name) for name in chosen]
    samples = trajectory.sample(dt, last=last)
    parts = (getattr(samples, quantity)[:, index] for quantity in COLUMNS.values())
    units = tuple(trajectory.robot.position_units[each] for each in index)
    return JointRows(chosen, units, samples.t, samples.s, *parts)
