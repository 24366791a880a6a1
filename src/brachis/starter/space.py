"""What a robot's path can prescribe."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from brachis.ik import natural_space
from brachis.robot import Robot
from brachis.robot.task_map.rows import AXES


def spaces(robot: Robot) -> Iterator[str | list[str]]:
    """Give what a robot might prescribe, the most natural first, then ever fewer rows of its tool's position."""
    yield natural_space(robot)
    for count in range(min(robot.n, len(AXES)), 0, -1):
        yield from (list(rows) for rows in combinations(AXES, count))
