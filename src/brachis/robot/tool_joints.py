"""Virtual joints between the tool and the path, one for each direction in which the tool may deviate from the path.

The pose of the tool is the pose on the path, displaced and turned in the axes of the path's orientation:

    tool = path Tr(x, y, z) Rx(-side) Ry(lead) Rz(roll).

So the pose on the path is the end of a longer chain. After the tool, the joints of this chain turn about -z, -y and x
and slide along -x, -y and -z. They have no mass, and no limits except their ranges. The position of such a joint is a
deviation of the tool from the path.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from brachis.task import Tolerances
from brachis.task.fields import POSITION

FREE_ROLL = "pose_free_roll"
"""Name of the task space of poses in which the roll about the tool axis is free."""
AXIS = "axis"
"""Word for the direction of the tool's z axis; it may be a row of a task space, or stand alone."""
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
_Range = tuple[float, float, str]
"""Ends of a range, rad or m, and the key of the task that sets them."""
_FREE: _Range = (-math.inf, math.inf, "task_space")


@dataclass(frozen=True)
class ToolJoint:
    """A virtual joint between the tool and the path.

    Attributes
    ----------
    direction : {"roll", "lead", "side", "x", "y", "z"}
        Direction in which the joint moves the tool.
    lower, upper : float
        Ends of its range, rad or m; infinite if the joint is free.
    key : str
        Key of the task that sets the range.
    """

    direction: str
    lower: float
    upper: float
    key: str

    @property
    def name(self) -> str:
        """Name of the joint."""
        return f"tool_{self.direction}"

    @property
    def axis(self) -> tuple[float, float, float]:
        """Axis about which the joint turns, or along which it slides."""
        return _DIRECTIONS[self.direction]

    @property
    def turns(self) -> bool:
        """Whether the joint is revolute; otherwise it is prismatic."""
        return self.direction in _TURNING

    @property
    def is_ranged(self) -> bool:
        """Whether the joint has a range."""
        return math.isfinite(self.upper)


def rolls_freely(space: str | Sequence[str]) -> bool:
    """Tell whether a task space leaves the roll of the tool about its z axis free."""
    return space == FREE_ROLL or AXIS in space


def tool_joints_of(
    space: str | Sequence[str], tolerances: Tolerances | None
) -> tuple[ToolJoint, ...]:
    """List the virtual joints that a task space and its tolerances need, in the order of the chain.

    A cone has the same width in lead and side. A sphere, and a box in the world's axes, have the same size along all
    axes. Ranges that the task does not state are slightly wider, so that the cone, sphere or box itself is the limit.
    """
    tolerances = tolerances or Tolerances()
    ranges: dict[str, _Range] = {}
    for direction in _DIRECTIONS:
        kind = "orientation" if direction in _TURNING else "position"
        ends = getattr(getattr(tolerances, kind), direction)
        if ends == "free":
            ranges[direction] = _FREE
        elif ends is not None:
            low, high = map(math.radians, ends) if direction in _TURNING else ends
            ranges[direction] = (low, high, f"tolerances.{kind}.{direction}")
    if tolerances.position.axes == "world":
        reach = math.hypot(*(max(map(abs, ranges[axis][:2])) for axis in POSITION))
        for axis in POSITION:
            ranges[axis] = _within(None, reach, ranges[axis][2])
    cone = math.radians(tolerances.orientation.tilt or math.inf)
    for reach, key, directions in (
        (cone, "tolerances.orientation.tilt", ("lead", "side")),
        (
            tolerances.position.sphere or math.inf,
            "tolerances.position.sphere",
            POSITION,
        ),
    ):
        for direction in directions if reach < math.inf else ():
            ranges[direction] = _within(ranges.get(direction), reach, key)
    if rolls_freely(space):
        ranges["roll"] = _FREE
    return tuple(
        ToolJoint(direction, *ranges[direction])
        for direction in _DIRECTIONS
        if direction in ranges
    )


def _within(ends: _Range | None, reach: float, key: str) -> _Range:
    """Limit a range to slightly more than `reach` on both sides of zero; `key` sets it if there was no range."""
    wide = 1.01 * reach
    low, high, own_key = ends or (-wide, wide, key)
    return max(low, -wide), min(high, wide), own_key
