"""Limits on how fast the tool moves, turns and accelerates, as ratios to the limit: |v| / v_max <= 1.

With J the Jacobian of a velocity of the tool, v = J(q) qdot and its direction e = v / |v|,

    d|v|/dqdot = e . J,        d|v|/dq = e . dv/dq,

and likewise for the size of the acceleration a = J qddot + Jdot qdot. A vector of zero size gets the direction zero: it
is far from its limit.

The largest speed of the tool frame's origin may depend on the path coordinate: piecewise linear (`SpeedTable`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from brachis.limits.protocol import (
    Bound,
    JointStates,
    Label,
    Limit,
    Partials,
    Role,
)
from brachis.robot import Robot
from brachis.task import SpeedTable as SpeedTableModel
from brachis.task import Task


class ToolRatios(Limit):
    """Ratios of what the tool does to its limits, at most 1.

    Parameters
    ----------
    labels : (c,) sequence of Label
    figures : (c,) sequence of float
        The limits, in the units of the labels.
    """

    role = Role.PROCESS

    def __init__(self, labels: Sequence[Label], figures: Sequence[float]) -> None:
        self.labels = tuple(labels)
        self.lower = np.full(len(labels), -np.inf)
        self.upper = np.ones(len(labels))
        self.bounds = tuple(
            Bound(column, figure, figure, 1.0 / figure)
            for column, figure in enumerate(figures)
        )


class SpeedTable:
    """Largest sizes of a motion at path coordinates: piecewise linear, with steps made into ramps on their faster side.

    Parameters
    ----------
    s : (P,) sequence of float
        Ascending; a place that occurs twice is a step.
    speed : (P,) sequence of float
        m/s.
    whole : bool, optional
        Whether the first and the last speed hold beyond their places too; otherwise nothing does there.

    Attributes
    ----------
    places : (p,) ndarray
        Path coordinates between which the speed is linear, each once.
    speeds : (p,) ndarray
        m/s; between the given places nowhere above the given ones.
    largest : float
        Of the given ones, m/s.
    """

    def __init__(
        self, s: Sequence[float], speed: Sequence[float], *, whole: bool = True
    ) -> None:
        given = np.array(s, dtype=float)
        places = given.copy()
        speeds = np.array(speed, dtype=float)
        ramp = 5e-3  # length in s: Newton's steps need a slope
        for first in np.flatnonzero(np.diff(given) == 0.0).tolist():
            # The side with the higher speed moves away from the step, on the line to the next place.
            rises = speeds[first + 1] > speeds[first]
            moved = first + 1 if rises else first
            onwards = 1 if rises else -1
            beyond = moved + onwards
            length = ramp
            if 0 <= beyond < len(given):
                gap = abs(given[beyond] - given[moved])
                length = min(ramp, 0.4 * gap)
                speeds[moved] += length / gap * (speed[beyond] - speed[moved])
            places[moved] += onwards * length
        self.largest = float(speeds.max())
        self._whole = whole
        if not whole:  # beyond its ends the speed goes on rising within a ramp
            places = np.concatenate([[places[0] - ramp], places, [places[-1] + ramp]])
            speeds = np.concatenate([20.0 * speeds[:1], speeds, 20.0 * speeds[-1:]])
        slopes = np.concatenate([[np.nan], np.diff(speeds) / np.diff(places), [np.nan]])
        bends = ~np.isclose(slopes[1:], slopes[:-1], rtol=1e-12, atol=1e-12)
        self.places = places[bends]
        self.speeds = speeds[bends]

    def at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Largest speeds, (K,), m/s, at path coordinates s, (K,), and their derivatives by s; infinite off the path."""
        if len(self.places) == 1:
            return np.full(len(s), self.speeds[0]), np.zeros(len(s))
        slopes = np.diff(self.speeds) / np.diff(self.places)
        slopes = np.concatenate([[0.0], slopes, [0.0]])
        piece = np.searchsorted(self.places, s, side="right")
        beyond = (s < self.places[0]) | (s > self.places[-1])
        is_free = np.isnan(s) | (beyond & (not self._whole))
        speeds = np.interp(s, self.places, self.speeds)
        return np.where(is_free, np.inf, speeds), slopes[piece]


class ToolMotionLimit(ToolRatios):
    """Size of a motion of the tool over its limits: speed or acceleration of its frame's origin, or angular speed.

    Virtual joints do not move the tool: they say how far it is from the path.

    Parameters
    ----------
    robot : Robot
    quantity : {"speed", "angular speed", "acceleration"}
    tables : (c,) sequence of SpeedTable
        The limits, m/s, rad/s or m/s^2.
    labels : (c,) sequence of Label
    """

    longer_time = "relieves"

    def __init__(
        self,
        robot: Robot,
        quantity: str,
        tables: Sequence[SpeedTable],
        labels: Sequence[Label],
    ) -> None:
        # The largest figure of a table stands for all of them.
        super().__init__(labels, [table.largest for table in tables])
        self.kind = f"tool_{quantity}".replace(" ", "_")
        self._robot = robot
        self._quantity = quantity
        self._tables = tables
        steps = [table.places for table in tables if len(table.places) > 1]
        self.breaks = np.unique(np.concatenate(steps or [[]]))

    def largest_at(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Largest sizes, (K, c), at path coordinates s, (K,), and their derivatives by s."""
        largest, slopes = zip(*(table.at(s) for table in self._tables), strict=True)
        return np.column_stack(largest), np.column_stack(slopes)

    def _states(self, motion: JointStates) -> list[np.ndarray]:
        """Return q, qdot and qddot of the real joints, (K, n) each."""
        states = (motion.q, motion.qdot, motion.qddot)
        return [self._robot.of_real_joints(own) for own in states]

    def values(self, motion: JointStates) -> np.ndarray:
        chain = self._robot.chain
        sizes = chain.tool_sizes(self._quantity, *self._states(motion))
        return sizes[:, None] / self.largest_at(motion.s)[0]

    def partials(self, motion: JointStates) -> Partials:
        """Slopes of the values by q, qdot and, for accelerations, qddot, (K, c, n) each, and by s, (K, c)."""
        chain = self._robot.chain
        sizes, slopes = chain.tool_size_slopes(self._quantity, *self._states(motion))
        largest, slope = self.largest_at(motion.s)
        q, qdot, qddot = (
            self._robot.of_real_joints(part)[:, None] / largest[:, :, None]
            for part in slopes
        )
        s = -sizes[:, None] * slope / largest**2
        if self._quantity == "acceleration":
            return Partials(q, qdot, qddot, s=s)
        return Partials(q, qdot, s=s)


def _label(quantity: str, unit: str) -> Label:
    key = f"tool_limits.{quantity}".replace(" ", "_")
    return Label("tool", quantity, unit, key, share=f"tool {quantity} / limit")


def build_tool_speed(robot: Robot, task: Task) -> ToolMotionLimit | None:
    """Build the limit of a task that has one, or whose path has feed rates or leads to process speeds."""
    limits = task.tool_limits
    speed = limits.speed
    tables = []
    labels = []
    if speed is not None:
        tables.append(
            SpeedTable(speed.s, speed.speed)
            if isinstance(speed, SpeedTableModel)
            else SpeedTable([0.0], [speed])
        )
        labels.append(_label("speed", "m/s"))
    leads = [lead for part in limits.process_speed for lead in part.leads]
    for quantity, key, parts in (
        ("feed rate", "feed", limits.feed),
        ("speed of a lead", "process_speed", leads),
    ):
        for part in parts:
            tables.append(SpeedTable(part.s, part.speed, whole=False))
            where = f"tool, s = {part.s[0]:.4g} to {part.s[-1]:.4g},"
            labels.append(Label(where, quantity, "m/s", f"tool_limits.{key}"))
    return ToolMotionLimit(robot, "speed", tables, labels) if tables else None


def build_constant(
    quantity: str, unit: str, robot: Robot, task: Task
) -> ToolMotionLimit | None:
    """Build the limit of a task that has one figure for a quantity of `ToolMotionLimit`."""
    figure = getattr(task.tool_limits, quantity.replace(" ", "_"))
    if figure is None:
        return None
    table = SpeedTable([0.0], [figure])
    return ToolMotionLimit(robot, quantity, [table], [_label(quantity, unit)])
