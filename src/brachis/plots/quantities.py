"""Joint quantities over time with their limits: what a panel shows, joints in rad and joints in m apart."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from brachis.robot import Robot
from brachis.trajectory import Samples, Trajectory


@dataclass(frozen=True, eq=False)
class Quantity:
    """One quantity of the joints that share its unit.

    Attributes
    ----------
    name : str
        In words: ``position``, ``torque``, ``force``, ...
    symbol : str
        In Matplotlib's mathematics, without dollars.
    unit : str
    t : (K,) ndarray
        s.
    joints : (j,) int ndarray
        In chain order; at least one.
    values : (K, j) ndarray
    lower, upper : (j,) ndarray
        Limits; infinite where there is none.
    around_zero : bool
        Whether the limits lie around zero, so that ratios to them say how near they are.
    """

    name: str
    symbol: str
    unit: str
    t: np.ndarray
    joints: np.ndarray
    values: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    around_zero: bool

    @property
    def ratios(self) -> np.ndarray:
        """Values over the limits of their directions, (K, j)."""
        return self.values / np.where(self.values > 0.0, self.upper, -self.lower)

    def limited(self) -> Quantity | None:
        """Return the same of the joints with limits in both directions; None where there is no such joint."""
        kept = np.isfinite(self.lower) & np.isfinite(self.upper)
        parts = {"joints": self.joints[kept], "values": self.values[:, kept]}
        return replace(self, **parts, lower=self.lower[kept], upper=self.upper[kept]) if kept.any() else None


@dataclass(frozen=True)
class _Kind:
    """How one kind of quantity is called where joints turn and where they slide."""

    names: tuple[str, str]
    symbols: tuple[str, str]
    units: tuple[str, str]
    samples: str
    around_zero: bool = True


KINDS = {
    "position": _Kind(("position",) * 2, ("q",) * 2, ("rad", "m"), "q", around_zero=False),
    "velocity": _Kind(("velocity",) * 2, (r"\dot{q}",) * 2, ("rad/s", "m/s"), "qdot"),
    "acceleration": _Kind(("acceleration",) * 2, (r"\ddot{q}",) * 2, ("rad/s²", "m/s²"), "qddot"),
    "torque": _Kind(("torque", "force"), (r"\tau", "F"), ("Nm", "N"), "tau"),
}
"""Kinds of joint quantities by the name that their limits have."""


def quantities(trajectory: Trajectory, samples: Samples, kind: str) -> tuple[Quantity, ...]:
    """Split one kind of quantity by unit: that of revolute joints first, then that of prismatic ones.

    Parameters
    ----------
    trajectory : Trajectory
    samples : Samples
        Of the trajectory.
    kind : str
        One of `KINDS`.

    Returns
    -------
    tuple of Quantity
        One or two.
    """
    robot, words = trajectory.robot, KINDS[kind]
    lower, upper = limits_of_joints(robot, kind)
    values = getattr(samples, words.samples)
    return tuple(
        Quantity(
            name, symbol, unit, samples.t, joints, values[:, joints], lower[joints], upper[joints], words.around_zero
        )
        for name, symbol, unit, joints in zip(
            words.names,
            words.symbols,
            words.units,
            (np.flatnonzero(robot.revolute), np.flatnonzero(~robot.revolute)),
            strict=True,
        )
        if len(joints)
    )


def limits_of_joints(robot: Robot, kind: str) -> np.ndarray:
    """Lower and upper limits of one of `KINDS`, (2, n)."""
    limits = robot.limits
    ranges = {"position": np.array([limits.position_lower, limits.position_upper])}
    return ranges[kind] if kind in ranges else limits.both_ways(kind)
