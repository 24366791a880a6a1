"""Virtual joints between the tool and the path, one for each direction in which the tool may leave the path.

The tool is where the path says, then moved and turned in the axes of the path's orientation:

    tool = path Tr(x, y, z) Rx(-side) Ry(lead) Rz(roll).

So the path's place is the end of a longer chain. From the tool on its joints turn about -z, -y and x and slide along
-x, -y and -z; they have no mass, and no limits but their ranges. The position of such a joint says how far the tool is
from where the path wants it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from brachis.task import Tolerances

FREE_ROLL = "pose_free_roll"
"""The task space of poses whose roll about the tool axis is free."""
_DIRECTIONS = {
    "roll": (0.0, 0.0, -1.0),
    "lead": (0.0, -1.0, 0.0),
    "side": (1.0, 0.0, 0.0),
    "x": (-1.0, 0.0, 0.0),
    "y": (0.0, -1.0, 0.0),
    "z": (0.0, 0.0, -1.0),
}
"""Axes of the virtual joints, in the order of the chain."""
_TURNING = ("roll", "lead", "side")


@dataclass(frozen=True)
class ToolJoint:
    """A virtual joint between the tool and the path.

    Attributes
    ----------
    way : {"roll", "lead", "side", "x", "y", "z"}
        How it moves the tool.
    lower, upper : float
        Its range, rad or m; infinite where it is free.
    """

    way: str
    lower: float
    upper: float

    @property
    def name(self) -> str:
        """Name of the joint."""
        return f"tool_{self.way}"

    @property
    def axis(self) -> tuple[float, float, float]:
        """Direction about which it turns, or along which it slides."""
        return _DIRECTIONS[self.way]

    @property
    def turns(self) -> bool:
        """Whether it turns; it slides otherwise."""
        return self.way in _TURNING

    @property
    def is_ranged(self) -> bool:
        """Whether it has a range."""
        return math.isfinite(self.upper)

    @property
    def key(self) -> str:
        """Key of the task that sets its range."""
        part = "orientation" if self.turns else "position"
        return f"tolerances.{part}.{self.way}"


def tool_joints_of(
    space: str | Sequence[str], tolerances: Tolerances | None
) -> tuple[ToolJoint, ...]:
    """List the virtual joints that a task space and its tolerances need, in the order of the chain.

    A cone is as wide in lead and side, a sphere, or a box in the world's axes, as large along all axes.
    """
    given = tolerances or Tolerances()
    turn = given.orientation
    shift = given.position
    ranges: dict[str, tuple[float, float]] = {}
    if turn.roll == "free" or space == FREE_ROLL:
        ranges["roll"] = (-math.inf, math.inf)
    asked = {way: getattr(turn, way) for way in _TURNING}
    for way, ends in asked.items():
        if ends not in (None, "free"):
            ranges[way] = math.radians(ends[0]), math.radians(ends[1])
    if turn.tilt is not None:
        for way in ("lead", "side"):
            ranges[way] = _within(ranges.get(way), math.radians(turn.tilt))
    box = {way: getattr(shift, way) for way in "xyz"}
    if shift.axes == "world":
        sides = [max(map(abs, ends)) for ends in box.values() if ends is not None]
        reach = math.hypot(*sides) if sides else math.inf
        box = dict.fromkeys(box, (-reach, reach) if sides else None)
    ranges |= {way: ends for way, ends in box.items() if ends is not None}
    if shift.sphere is not None:
        for way in box:
            ranges[way] = _within(ranges.get(way), shift.sphere)
    return tuple(ToolJoint(way, *ranges[way]) for way in _DIRECTIONS if way in ranges)


def _within(ends: tuple[float, float] | None, reach: float) -> tuple[float, float]:
    """Cut a range down to both sides of zero."""
    low, high = ends or (-reach, reach)
    return max(low, -reach), min(high, reach)
