"""Limits of kinds that other packages add, named in a task under ``custom_limits``.

Their kinds are entry points of the group ``brachis.limits``: each loads to a callable that takes the parameters that
the task gives, as keywords, and returns an object with ``bind(robot)``, which gives the limit for a robot (see
`brachis.limits.Limit`).
"""

from __future__ import annotations

import importlib.metadata
from typing import Any, Protocol

from brachis.errors import InputError, UnknownNameError, suggest
from brachis.robot import Robot
from brachis.task import Task

GROUP = "brachis.limits"


class LimitModel(Protocol):
    """A limit as a user gives it, which does not know the robot yet."""

    def bind(self, robot: Robot, /) -> Any:
        """Return the limit for a robot, a `brachis.limits.Limit`."""


def custom_limits(task: Task) -> tuple[LimitModel, ...]:
    """Make the limits that a task names under ``custom_limits``.

    Raises
    ------
    UnknownNameError
        No installed package has such a kind.
    InputError
        The package cannot be loaded, or refuses the parameters.
    """
    if (
        not task.custom_limits
    ):  # looking through the installed packages takes milliseconds
        return ()
    installed = {
        entry.name: entry for entry in importlib.metadata.entry_points(group=GROUP)
    }
    made = []
    for kind, parameters in task.custom_limits.items():
        where = f"custom_limits.{kind}"
        if kind not in installed:
            raise UnknownNameError(
                "kind of limit",
                kind,
                installed,
                where="custom_limits",
                hint=suggest(kind, installed)
                or "Install the package that provides this kind (entry point brachis.limits)",
            )
        try:
            factory = installed[kind].load()
        except Exception as error:
            problem = f"the plug-in {installed[kind].value} cannot be loaded: {type(error).__name__}: {error}"
            raise InputError(problem, where=where) from error
        try:
            made.append(factory(**parameters))
        except (TypeError, ValueError) as error:
            raise InputError(
                f"the plug-in refuses its parameters: {error}",
                where=where,
                found=parameters,
            ) from error
    return tuple(made)
