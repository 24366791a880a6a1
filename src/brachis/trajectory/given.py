"""Motions as they are given: a trajectory, what has one, or its file."""

from __future__ import annotations

import os
from typing import Protocol

from brachis.errors import InputError
from brachis.trajectory.trajectory import Trajectory


class HasMotion(Protocol):
    """A result of a plan."""

    @property
    def trajectory(self) -> Trajectory:
        """Return the motion."""


Motion = Trajectory | HasMotion | str | os.PathLike[str]


def motion_of(given: Motion) -> Trajectory:
    """Return the trajectory that is given.

    Raises
    ------
    ResultFileError
        A file is none of a motion.
    InputError
        It is something else.
    """
    if isinstance(given, Trajectory):
        return given
    if isinstance(given, str | os.PathLike):
        return Trajectory.load(given)
    motion = getattr(given, "trajectory", None)
    if not isinstance(motion, Trajectory):
        allowed = "a Trajectory, a Result, or the npz file of one"
        raise InputError("no motion", where="trajectory", found=type(given).__name__, allowed=allowed)
    return motion
