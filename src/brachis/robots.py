"""Robots that come with brachis: ``brachis.robots.scara3`` is a `Robot`; `path_of` has its URDF, `names` all names.

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

from brachis.common.files import is_file, shipped_folder
from brachis.errors import UnknownNameError, no_attribute
from brachis.robot import Robot

_MISSPELT = 0.75
"""Likeness to a name from which on a word is taken for it; so are its first letters."""


def names() -> tuple[str, ...]:
    """Return the names of the robots, in alphabetical order."""
    return tuple(
        sorted(
            path.parent.name for path in shipped_folder("robots").glob("*/robot.urdf")
        )
    )


def path_of(name: str) -> Path:
    """Return the URDF file of a robot.

    Raises
    ------
    UnknownNameError
        brachis has no robot of this name.
    """
    if name not in names():
        raise UnknownNameError("robot", name, names(), where="brachis.robots")
    return shipped_folder("robots") / name / "robot.urdf"


def is_robot(given: object) -> bool:
    """Tell whether something is a robot: a `Robot`, the file name of a URDF, or a name from `names` or like one."""
    if isinstance(given, Robot):
        return True
    return isinstance(given, str | os.PathLike) and (
        Path(given).suffix.lower() == ".urdf" or _is_name(given)
    )


def locate(
    robot: str | os.PathLike[str] | Robot | None,
) -> str | os.PathLike[str] | Robot | None:
    """Return the URDF file where a robot is given by its name, and everything else as it is.

    Raises
    ------
    UnknownNameError
        It is neither a file nor a name, but like a name.
    """
    return path_of(robot) if isinstance(robot, str) and _is_name(robot) else robot


def _is_name(given: str | os.PathLike[str]) -> bool:
    """Tell a name, misspelt perhaps, from the file name of something."""
    if given in names():
        return True
    path = Path(given)
    bare = not path.suffix and len(path.parts) == 1 and not is_file(path)
    begun = any(name.startswith(str(given)) for name in names())
    return bare and (
        begun or bool(difflib.get_close_matches(str(given), names(), cutoff=_MISSPELT))
    )


@cache
def _robot(name: str) -> Robot:
    return Robot.from_urdf(path_of(name))


def __getattr__(name: str) -> Robot:
    """Read a robot when it is first used."""
    if name not in names():
        raise no_attribute(__name__, "robots", name, names())
    return _robot(name)


def __dir__() -> list[str]:
    """Names for completion."""
    return ["names", "path_of", *names()]
