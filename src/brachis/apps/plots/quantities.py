"""Joint quantities over time with their limits: what plots, report and viewer show, joints in rad and in m apart."""

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
        Limits; infinite where there is none.
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
        """Values over the limits of their directions, both from the centre, (K, j); NaN where there is no limit."""
        away = self.values - self.centre
        room = np.where(away > 0.0, self.upper - self.centre, self.centre - self.lower)
        return np.where(self.is_limited, away / room, np.nan)

    @property
    def is_limited(self) -> np.ndarray:
        """Whether joints have limits in both directions, (j,)."""
        return np.isfinite(self.lower) & np.isfinite(self.upper)

    def of_joints(self, kept: np.ndarray) -> Quantity | None:
        """Return the same of some of its joints, (j,) bool; None where there is none."""
        parts = {
            name: getattr(self, name)[kept]
            for name in ("joints", "lower", "upper", "centre")
        }
        return (
            replace(self, values=self.values[:, kept], **parts) if kept.any() else None
        )

    def limited(self) -> Quantity | None:
        """Return the same of the joints with limits in both directions; None where there is no such joint."""
        return self.of_joints(self.is_limited)


@dataclass(frozen=True)
class _Kind:
    """A kind of quantity: how it is called where joints turn and where they slide, and what its ratios are."""

    symbols: tuple[str, str]
    values: Callable[[Trajectory, Samples], np.ndarray]
    names: tuple[str, str] | None = None
    share: str = ""
    of: str = "its limit"
    in_range: bool = False
    """Whether the limits are a range, from whose middle ratios count."""
    if_limited: bool = False
    """Whether it is of interest only where there is a limit."""


KINDS = {
    "position": _Kind(
        ("q", "q"),
        lambda _, samples: samples.q,
        share="position in its range",
        of="the way from the middle of its range to an end",
        in_range=True,
    ),
    "velocity": _Kind((r"\dot{q}", r"\dot{q}"), lambda _, samples: samples.qdot),
    "acceleration": _Kind((r"\ddot{q}", r"\ddot{q}"), lambda _, samples: samples.qddot),
    "jerk": _Kind(
        (r"\dddot{q}", r"\dddot{q}"),
        lambda trajectory, samples: trajectory.jerk(samples.t),
        if_limited=True,
    ),
    "torque": _Kind(
        (r"\tau", "F"), lambda _, samples: samples.tau, names=("torque", "force")
    ),
}
"""Kinds of joint quantities by the name that their limits have."""


def kinds_of(trajectory: Trajectory) -> tuple[str, ...]:
    """Return the kinds that are of interest for a motion."""
    limits = trajectory.robot.limits
    return tuple(
        kind
        for kind, own in KINDS.items()
        if not own.if_limited or np.isfinite(limits_of(limits, kind)).any()
    )


def quantities(
    trajectory: Trajectory, samples: Samples, kind: str, *, degrees: bool = False
) -> tuple[Quantity, ...]:
    """Split one kind of quantity by unit: that of revolute joints first, then that of prismatic ones.

    Parameters
    ----------
    trajectory : Trajectory
    samples : Samples
        Of the trajectory.
    kind : str
        One of `KINDS`.
    degrees : bool, optional
        Whether angles are in degrees.

    Returns
    -------
    tuple of Quantity
        One or two.
    """
    robot = trajectory.robot
    own = KINDS[kind]
    lower, upper = limits_of(robot.limits, kind)
    values = own.values(trajectory, samples)
    found = []
    for place, (base, of_kind) in enumerate(
        (("rad", robot.revolute), ("m", ~robot.revolute))
    ):
        joints = np.flatnonzero(of_kind)
        if not len(joints):
            continue
        unit, factor = shown_unit(UNITS[kind][base], degrees=degrees)
        low = factor * lower[joints]
        high = factor * upper[joints]
        ended = np.isfinite(low) & np.isfinite(high) & own.in_range
        centre = 0.5 * np.where(ended, low, 0.0) + 0.5 * np.where(ended, high, 0.0)
        name = own.names[place] if own.names else kind
        found.append(
            Quantity(
                name=name,
                symbol=own.symbols[place],
                unit=unit.replace("^2", "²").replace("^3", "³"),
                t=samples.t,
                joints=joints,
                values=factor * values[:, joints],
                lower=low,
                upper=high,
                centre=centre,
                share=own.share or f"{name} / limit",
                of=own.of,
            )
        )
    return tuple(found)


def limits_of(limits: Limits, kind: str) -> np.ndarray:
    """Lower and upper limits of one of `KINDS`, (2, n)."""
    ranges = {"position": np.array([limits.position_lower, limits.position_upper])}
    return ranges[kind] if kind in ranges else limits.both_ways(kind)


def allowed_tool_speeds(trajectory: Trajectory, samples: Samples) -> np.ndarray:
    """Largest speeds of the tool that the task allows, (c, K), m/s; infinite where there is no limit."""
    limit = build_tool_speed(trajectory.robot, trajectory.task)
    return (
        np.empty((0, len(samples.t)))
        if limit is None
        else limit.largest_at(samples.s)[0].T
    )
