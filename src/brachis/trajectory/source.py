"""Trajectories from results and files, the table of their phases, and changes of their robots."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from typing import Concatenate, ParamSpec, Protocol, TypeVar

from brachis.errors import InputError
from brachis.robot import Robot
from brachis.robot.from_task import in_use
from brachis.trajectory.phases import PHASE_COLUMNS, phase_rows
from brachis.trajectory.program import PART_COLUMNS, part_rows
from brachis.trajectory.trajectory import Trajectory

_P = ParamSpec("_P")
_R = TypeVar("_R")


class HasMotion(Protocol):
    """An object with a trajectory, such as the result of a plan."""

    @property
    def trajectory(self) -> Trajectory:
        """Return the trajectory."""


MotionSource = Trajectory | HasMotion | str | os.PathLike[str]


def motion_of(source: MotionSource, where: str = "trajectory") -> Trajectory:
    """Return the trajectory of `source`; `where` is the argument's name for messages.

    Raises
    ------
    ResultFileError
        The file is not a result file.
    InputError
        `source` is not a trajectory, a result or a file.
    """
    if isinstance(source, Trajectory):
        return source
    if isinstance(source, str | os.PathLike):
        return Trajectory.load(source)
    motion = getattr(source, "trajectory", None)
    if not isinstance(motion, Trajectory):
        raise InputError(
            "this is not a motion",
            where=where,
            found=type(source).__name__,
            allowed="a Trajectory, a Result, or the npz file of either",
        )
    return motion


def of_motion(
    function: Callable[Concatenate[Trajectory, _P], _R],
) -> Callable[Concatenate[MotionSource, _P], _R]:
    """Let a function of a trajectory accept everything that `motion_of` accepts."""

    @wraps(function)
    def taking(trajectory: MotionSource, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        """Call the function with the trajectory of the given source."""
        return function(motion_of(trajectory), *args, **kwargs)

    return taking  # type: ignore[return-value]  # mypy fears a second `trajectory` among the keywords


def phase_table(
    motion: Trajectory,
) -> tuple[str, tuple[str, ...], list[tuple[str, ...]]]:
    """Return the title, the columns and the rows of the table of a motion's phases, or of the parts of a program."""
    if motion.parts:
        return "parts", PART_COLUMNS, part_rows(motion.parts)
    return "phases", PHASE_COLUMNS, phase_rows(motion.phases)


def change_robots(motion: Trajectory, change: Callable[[Robot], Robot]) -> Trajectory:
    """Return a motion with a change of its robot, and of the robot of each motion of which it consists."""
    components = tuple(
        (begin, change_robots(component, change))
        for begin, component in motion.components
    )
    return replace(motion, robot=change(motion.robot), components=components)


def settings_in_use(motion: Trajectory) -> dict[str, str]:
    """Return the settings of the robot in use, with the payloads of all parts of a program."""
    shown = in_use(motion.robot, motion.node_accelerations)
    robots = [part.robot for _, part in motion.components]
    payloads = dict.fromkeys(in_use(robot).get("payload", "none") for robot in robots)
    if len(payloads) > 1:
        shown["payload"] = ", then ".join(payloads)
    return shown
