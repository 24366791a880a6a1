"""Joint quantities over time with their limits, for plots, report and viewer.

Joints in rad and joints in m are separate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from brachis.limits.tool import build_tool_speed
from brachis.robot.joints import UNITS, shown_unit
from brachis.robot.limits import Limits
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
        As it is written.
    t : (K,) ndarray
        s.
    joints : (j,) int ndarray
        In chain order; at least one.
    values : (K, j) ndarray
    lower, upper : (j,) ndarray
        Limits; infinite if a joint has no limit.
    centre : (j,) ndarray
        Value that uses nothing of the limits: zero, or the middle of a range of positions.
    share : str
        What the ratios are, for example ``torque / limit``.
    of : str
        What they are parts of: ``its limit``.
    """

    name: str
    symbol: str
    unit: str
    t: np.ndarray
    joints: np.ndarray
    values: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    centre: np.ndarray
    share: str
    of: str

    @property
    def ratios(self) -> np.ndarray:
        """Values over the limits of their directions, both from the centre, (K, j); NaN without a limit."""
        away = self.values - self.centre
        room = np.where(away > 0.0, self.upper - self.centre, self.centre - self.lower)
        return np.where(self.is_limited, away / room, np.nan)

    @property
    def is_limited(self) -> np.ndarray:
        """Whether joints have limits in both directions, (j,)."""
        return np.isfinite(self.lower) & np.isfinite(self.upper)

    def of_joints(self, kept: np.ndarray) -> Quantity | None:
        """Select joints, (j,) bool; None if no joint is left."""
        if not kept.any():
            return None
        return replace(
            self,
            joints=self.joints[kept],
            values=self.values[:, kept],
            lower=self.lower[kept],
            upper=self.upper[kept],
            centre=self.centre[kept],
        )

    def over_limits(self) -> Quantity | None:
        """Return the ratios of the joints with limits in both directions.

        Their limits are -1 and 1. None if no joint has limits in both directions.
        """
        part = self.of_joints(self.is_limited)
        if part is None:
            return None
        ones = np.ones(len(part.joints))
        return replace(
            part,
            unit="of the limit",
            values=part.ratios,
            lower=-ones,
            upper=ones,
            centre=np.zeros(len(ones)),
        )


@dataclass(frozen=True)
class _Kind:
    """A kind of quantity.

    Symbols and names are those of revolute and of prismatic joints. With `in_range` the
    limits are a range, and ratios count from its middle. A kind with `if_limited` is
    shown only if the robot limits it.
    """

    values: Callable[[Trajectory, Samples], np.ndarray]
    symbols: tuple[str, str]
    names: tuple[str, str]
    share: str = ""
    of: str = "its limit"
    in_range: bool = False
    if_limited: bool = False


KINDS = {
    "position": _Kind(
        lambda _, samples: samples.q,
        ("q", "q"),
        ("position", "position"),
        share="position in its range",
        of="the way from the middle of its range to an end",
        in_range=True,
    ),
    "velocity": _Kind(
        lambda _, samples: samples.qdot,
        (r"\dot{q}", r"\dot{q}"),
        ("velocity", "velocity"),
    ),
    "acceleration": _Kind(
        lambda _, samples: samples.qddot,
        (r"\ddot{q}", r"\ddot{q}"),
        ("acceleration", "acceleration"),
    ),
    "jerk": _Kind(
        lambda trajectory, samples: trajectory.jerk(samples.t),
        (r"\dddot{q}", r"\dddot{q}"),
        ("jerk", "jerk"),
        if_limited=True,
    ),
    "torque": _Kind(
        lambda _, samples: samples.tau, (r"\tau", "F"), ("torque", "force")
    ),
}
"""The table of what plots, report and viewer show of joints.

The keys are the names of the limits.
"""


def kinds_of(trajectory: Trajectory) -> tuple[str, ...]:
    """Return the kinds that are of interest for a motion."""
    limits = trajectory.robot.limits
    return tuple(
        name
        for name, kind in KINDS.items()
        if not kind.if_limited or np.isfinite(limits_of(limits, name)).any()
    )


def quantities(
    trajectory: Trajectory, samples: Samples, *kinds: str, degrees: bool = False
) -> list[Quantity]:
    """Split quantities by unit: revolute joints first, then prismatic ones.

    Parameters
    ----------
    trajectory : Trajectory
    samples : Samples
        Of the trajectory.
    *kinds : str
        Some of `KINDS`.
    degrees : bool, optional
        Whether angles are in degrees.

    Returns
    -------
    list of Quantity
        One or two of each kind.
    """
    robot = trajectory.robot
    joints_by_unit = {
        "rad": np.flatnonzero(robot.revolute),
        "m": np.flatnonzero(~robot.revolute),
    }
    found = []
    for name in kinds:
        kind = KINDS[name]
        lower, upper = limits_of(robot.limits, name)
        values = kind.values(trajectory, samples)
        for place, (base, joints) in enumerate(joints_by_unit.items()):
            if not len(joints):
                continue
            unit, factor = shown_unit(UNITS[name][base], degrees=degrees)
            low = factor * lower[joints]
            high = factor * upper[joints]
            centre = np.zeros(len(joints))
            if kind.in_range:
                is_range = np.isfinite(low) & np.isfinite(high)
                centre[is_range] = 0.5 * low[is_range] + 0.5 * high[is_range]
            found.append(
                Quantity(
                    name=kind.names[place],
                    symbol=kind.symbols[place],
                    unit=unit.replace("^2", "²").replace("^3", "³"),
                    t=samples.t,
                    joints=joints,
                    values=factor * values[:, joints],
                    lower=low,
                    upper=high,
                    centre=centre,
                    share=kind.share or f"{kind.names[place]} / limit",
                    of=kind.of,
                )
            )
    return found


def joint_quantities(
    trajectory: Trajectory, samples: Samples, *kinds: str, degrees: bool = False
) -> list[list[Quantity]]:
    """As `quantities`, but a list for each joint; every entry has this joint alone."""
    parts = quantities(trajectory, samples, *kinds, degrees=degrees)
    return [
        [one for part in parts if (one := part.of_joints(part.joints == joint))]
        for joint in range(trajectory.robot.n)
    ]


def limits_of(limits: Limits, kind: str) -> np.ndarray:
    """Lower and upper limits of one of `KINDS`, (2, n)."""
    ranges = {"position": np.array([limits.position_lower, limits.position_upper])}
    return ranges[kind] if kind in ranges else limits.both_ways(kind)


REACH = 0.3
"""Limits are shown if the motion comes as near to them as this part of its range."""


def near_tool_speeds(trajectory: Trajectory, samples: Samples) -> list[np.ndarray]:
    """Select the `allowed_tool_speeds`, (K,), that the motion comes near; NaN elsewhere."""
    reach = (1.0 + REACH) * max(float(samples.tool_speed.max()), 1e-9)
    found = [
        np.where(allowed < reach, allowed, np.nan)
        for allowed in allowed_tool_speeds(trajectory, samples)
    ]
    return [near for near in found if np.isfinite(near).any()]


def allowed_tool_speeds(trajectory: Trajectory, samples: Samples) -> np.ndarray:
    """Largest speeds of the tool that the task allows, (c, K), m/s; infinite without a limit."""
    limit = build_tool_speed(trajectory.robot, trajectory.task)
    if limit is None:
        return np.empty((0, len(samples.t)))
    return limit.largest_at(samples.s)[0].T
