"""Motions as they are given: a trajectory, what has one, or its file."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, Protocol, TypeVar

from brachis.errors import InputError
from brachis.trajectory.trajectory import Trajectory

_P = ParamSpec("_P")
_R = TypeVar("_R")


class HasMotion(Protocol):
    """A result of a plan."""

    @property
    def trajectory(self) -> Trajectory:
        """Return the motion."""


Motion = Trajectory | HasMotion | str | os.PathLike[str]


def motion_of(given: Motion, where: str = "trajectory") -> Trajectory:
    """Return the trajectory that is given, as the argument `where` of a public function.

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
        raise InputError("no motion", where=where, found=type(given).__name__, allowed=allowed)
    return motion


def of_motion(function: Callable[Concatenate[Trajectory, _P], _R]) -> Callable[Concatenate[Motion, _P], _R]:
    """Let a function of a trajectory take all that `motion_of` does."""

    @wraps(function)
    def taking(trajectory: Motion, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        return function(motion_of(trajectory), *args, **kwargs)

    return taking  # type: ignore[return-value]  # mypy fears a second `trajectory` among the keywords
