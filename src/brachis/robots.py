"""Included robots: ``brachis.robots.scara3`` is a `Robot`.

`path_of` returns the URDF file of a robot, and `names` lists the names of all robots.

Examples
--------
>>> import brachis
>>> brachis.robots.scara3.joint_names
('j1', 'j2', 'j3')
>>> brachis.robots.path_of("iiwa14").name
'robot.urdf'
"""

from __future__ import annotations

import difflib
import os
from functools import cache
from pathlib import Path

from brachis.common.files import ROBOT_SUFFIXES, is_file, shipped_folder, shipped_robots
from brachis.errors import check_names, no_attribute
from brachis.robot import Robot


def names() -> tuple[str, ...]:
    """Return the names of the robots, in alphabetical order."""
    return shipped_robots()


def path_of(name: str) -> Path:
    """Return the URDF file of a robot.

    Raises
    ------
    UnknownNameError
        brachis has no robot with this name.
    """
    check_names("robot", [name], names(), "brachis.robots")
    return shipped_folder("robots") / name / "robot.urdf"


def is_robot(source: object) -> bool:
    """Return whether something is a robot: a `Robot`, a URDF or MJCF file, or a name from `names` or similar to one."""
    if isinstance(source, Robot):
        return True
    return isinstance(source, str | os.PathLike) and (
        Path(source).suffix.lower() in ROBOT_SUFFIXES or _is_name(source)
    )


def locate(
    robot: str | os.PathLike[str] | Robot | None,
) -> str | os.PathLike[str] | Robot | None:
    """Return the URDF file of a robot that is given by its name; return anything else unchanged.

    Raises
    ------
    UnknownNameError
        The text is neither a file nor the name of a robot, but similar to such a name.
    """
    return path_of(robot) if isinstance(robot, str) and _is_name(robot) else robot


def _is_name(source: str | os.PathLike[str]) -> bool:
    """Return whether a text is a robot's name, its first letters or a misspelling of it, but not the name of a file."""
    known = names()
    path = Path(source)
    if source in known or path.suffix or len(path.parts) != 1 or is_file(path):
        return source in known
    word = str(source)
    begins = any(name.startswith(word) for name in known)
    return begins or bool(difflib.get_close_matches(word, known, cutoff=0.75))


_WORKPIECES = {"tx90l_positioner": "workpiece"}
"""Links that carry the workpiece, of robots with a positioner."""


@cache
def _robot(name: str) -> Robot:
    return Robot.from_urdf(path_of(name), workpiece_frame=_WORKPIECES.get(name))


def __getattr__(name: str) -> Robot:
    """Read a robot when it is first used."""
    if name not in names():
        raise no_attribute(__name__, "robots", name, names())
    return _robot(name)


def __dir__() -> list[str]:
    """List the names for completion."""
    return ["names", "path_of", *names()]
