"""Making a first task: what to prescribe, where to begin and lead, and a plan that shows that it works."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from brachis import planner
from brachis.deadline import Deadline
from brachis.errors import PlanningError
from brachis.result import Result
from brachis.robot import Robot, bind
from brachis.robot.limb import first_limb
from brachis.robot.urdf import read_chain, read_file
from brachis.starter.choice import choices
from brachis.starter.missing import placeholders
from brachis.starter.space import spaces
from brachis.starter.text import task_text
from brachis.task import load_task
from brachis.task.yaml_reader import read_yaml

_SOON = {"search.effort": "single", "search.time_limit": 20.0, "spline.intervals": 10, "search.least_motion": False}
"""Keys of the plan by which a task is tried."""
_LONGEST = 90.0
"""Time after which no further space is tried, s."""


@dataclass(frozen=True)
class Starter:
    """A first task.

    Attributes
    ----------
    text : str
        The task file.
    robot : Robot
    result : Result
        A quick plan of it, verified.
    """

    text: str
    robot: Robot
    result: Result


def starter_task(
    urdf: str | os.PathLike[str],
    *,
    folder: str | os.PathLike[str] = ".",
    tool_frame: str | None = None,
    base_frame: str | None = None,
    listener: Callable[[str], None] | None = None,
) -> Starter:
    """Write a commented task for a robot: a short line from a good posture, everything else left open.

    Parameters
    ----------
    urdf : path
    folder : path, optional
        Where the task file will be; the URDF's path in it is relative to it where that is near.
    tool_frame, base_frame : str, optional
        As in a task. By default the ends of the chain of most joints; see `first_limb`.
    listener : callable, optional
        Is told what is done.

    Raises
    ------
    UrdfError, UnknownNameError
        See `Robot.from_urdf`.
    PlanningError
        No posture and line were found from which a plan was verified.

    Examples
    --------
    >>> import brachis
    >>> starter = starter_task(brachis.robots.path_of("gantry2"))
    >>> starter.result.verified
    True
    >>> starter.text.splitlines()[2]
    'brachis: 1'
    """
    tell = listener or (lambda _text: None)
    path = Path(urdf)
    text = read_file(path)
    base, tool = base_frame, tool_frame
    if tool is None:
        limb = first_limb(text, str(path))
        base, tool = base or limb.base, limb.tool
    chain = read_chain(text, str(path), tool_frame=tool, base_frame=base, locked_joints={})
    limits = placeholders(chain.joint_names, chain.limits)
    robot = Robot.from_urdf(path, tool_frame=tool, base_frame=base, limits=limits)
    deadline = Deadline.after(_LONGEST)
    for space in spaces(robot):
        tell(f"looking for a first motion that prescribes {space if isinstance(space, str) else ', '.join(space)}")
        bound, task_map = bind(robot, space)
        for choice in () if deadline.passed else choices(task_map):
            written = task_text(bound, space, choice, limits, Path(folder))
            result = _tried(written, path, tell)
            if result is not None and result.verified:
                return Starter(written, bound, result)
    raise PlanningError(
        "no first motion was found",
        where=str(path),
        found=f"chain {robot.base_frame} -> {robot.tool_frame} with {', '.join(robot.joint_names)}",
        hint="Name another tool frame; brachis inspect shows limits and closed forms",
    )


def _tried(text: str, urdf: Path, listener: Callable[[str], None]) -> Result | None:
    """Plan a task quickly; None where there is no plan."""
    content = read_yaml(text, "starter task")
    assert isinstance(content, dict)  # noqa: S101  (as it was written)
    task = load_task(content, changes={**_SOON, "robot.urdf": str(urdf.absolute())})
    try:
        return planner.plan(task, listener=listener, check_advice=False)
    except PlanningError:
        return None
