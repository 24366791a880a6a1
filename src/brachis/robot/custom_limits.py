"""Limits that are not built in: limits from a user's program, and limits from other packages.

A task names kinds of limits from other packages under ``custom_limits``. These kinds are entry points of the group
``brachis.limits``. Each entry point is a callable that takes the parameters of the task as keywords, and returns an
object whose ``bind(robot)`` returns the limit for a robot (see `brachis.limits.Limit`).
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np

from brachis.common.arguments import check_array, check_finite, check_list
from brachis.errors import BrachisError, InputError, UnknownNameError, suggest
from brachis.robot.robot import Robot
from brachis.task import Task

_SECTION = "custom_limits"


class LimitModel(Protocol):
    """A limit as a user gives it, not yet bound to a robot."""

    def bind(self, robot: Robot, /) -> Any:
        """Return the limit for a robot, a `brachis.limits.Limit`."""


def list_models(
    task: Task, own_limits: Sequence[LimitModel] = ()
) -> dict[str, LimitModel]:
    """List the limits of a task's ``custom_limits`` and of a program; keys are their places, such as ``own_limits[0]``.

    Raises
    ------
    UnknownNameError
        No installed package provides a kind that the task names.
    InputError
        A package cannot be loaded or refuses the parameters, or an object is not a limit.
    """
    check_list(own_limits, "own_limits", "limits")
    models = _make_plugins(task)
    models |= {f"own_limits[{i}]": model for i, model in enumerate(own_limits)}
    for where, model in models.items():
        is_class = isinstance(model, type)
        if is_class or not callable(getattr(model, "bind", None)):
            raise InputError(
                "this object is not a limit",
                where=where,
                found=model
                if is_class
                else f"an object of the class {type(model).__name__}",
                allowed="an object that inherits brachis.limits.Limit, or whose bind(robot) returns one "
                "(docs/own_limit.md)",
            )
    return models


def _make_plugins(task: Task) -> dict[str, LimitModel]:
    """Create the limits that a task names under ``custom_limits``."""
    if not task.custom_limits:
        return {}  # a search through the installed packages takes milliseconds
    entries = importlib.metadata.entry_points(group="brachis.limits")
    installed = {entry.name: entry for entry in entries}
    made = {}
    for kind, parameters in task.custom_limits.items():
        where = f"{_SECTION}.{kind}"
        if kind not in installed:
            raise UnknownNameError(
                "kind of limit",
                kind,
                installed,
                where=_SECTION,
                hint=suggest(kind, installed)
                or "Install the package that provides this kind (entry point brachis.limits)",
            )
        with name_failures(where, installed[kind].value):
            factory = installed[kind].load()
            try:
                made[where] = factory(**parameters)
            except (TypeError, ValueError) as error:
                raise InputError(
                    f"the plug-in refuses its parameters: {error}",
                    where=where,
                    found=parameters,
                ) from error
    return made


@contextmanager
def name_failures(where: str, method: str) -> Iterator[None]:
    """Turn an exception in the code of a plug-in into an error that names the limit and the method.

    Exceptions in the code of a user's program, under ``own_limits``, are passed on unchanged.

    Raises
    ------
    InputError
    """
    try:
        yield
    except BrachisError:
        raise
    except Exception as error:
        if not where.startswith(f"{_SECTION}."):
            raise
        raise InputError(
            f"the plug-in's {method} failed: {type(error).__name__}: {error}",
            where=where,
        ) from error


def bind_model(where: str, model: LimitModel, robot: Robot) -> Any:
    """Return the limit of a model for a robot.

    Raises
    ------
    InputError
        The limit cannot be built, or `bind` does not return a limit.
    """
    try:
        with name_failures(where, "bind"):
            limit = model.bind(robot)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"the limit cannot be built for this robot: {error}",
            where=where,
            found=type(model).__name__,
        ) from error
    if isinstance(limit, type) or not hasattr(limit, "origin"):
        raise InputError(
            "bind did not return a brachis.limits.Limit",
            where=where,
            found=f"an object of the class {type(limit).__name__}",
            allowed="an object of a class that inherits brachis.limits.Limit; its methods alone are not enough",
        )
    object.__setattr__(limit, "origin", where)  # it may be frozen
    return limit


def has_check(model: LimitModel) -> bool:
    """Tell whether a model has a separate formula for the verification."""
    return getattr(model, "check", None) is not None


def check_ratios(
    where: str, model: Any, robot: Robot, motion: Sequence[np.ndarray], size: int
) -> np.ndarray:
    """Call a model's ``check(robot, q, qdot, qddot, tau)``.

    Parameters
    ----------
    where : str
        Place of the model; see `list_models`.
    model : LimitModel
    robot : Robot
    motion : sequence of (K, n) ndarray
        q, qdot, qddot and tau at K moments.
    size : int
        Number of values of the limit, c.

    Returns
    -------
    (K, c) ndarray
        Magnitudes of the ratios.

    Raises
    ------
    InputError
        The result of the method is not finite, or has the wrong shape.
    """
    with name_failures(where, "check"):
        ratios = model.check(robot, *motion)
    here = f"{where}.check"
    if isinstance(ratios, list):
        try:
            ratios = np.array(ratios)
        except ValueError as error:
            raise InputError(
                f"the array has the wrong shape: {error}", where=here
            ) from error
    moments = len(motion[0])
    check_array(ratios, (moments, size), here, remark=f" for {moments} moments")
    check_finite(ratios, here)
    return np.abs(ratios)
