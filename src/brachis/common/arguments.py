"""Checks of the arguments of public functions: wrong names and types are rejected like any other wrong input."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import wraps
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from brachis.common.summary import show_value
from brachis.errors import InputError, UnknownNameError

_P = ParamSpec("_P")
_R = TypeVar("_R")


def check_keywords(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Make a function reject unknown keyword arguments with a message that lists the existing ones.

    Raises
    ------
    UnknownNameError
        A keyword argument does not exist.
    InputError
        A required argument is missing, or there are too many positional arguments.
    """
    signature = inspect.signature(function)
    name = function.__name__
    parameters = dict(signature.parameters)
    parameters.pop("self", None)

    @wraps(function)
    def call(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        """Check the arguments, then call the function."""
        for keyword in kwargs:
            if keyword not in parameters:
                raise UnknownNameError("keyword", keyword, parameters, where=name)
        try:
            signature.bind(*args, **kwargs)
        except TypeError as error:
            allowed = ", ".join(
                parameter.name
                + ("=" if parameter.kind is parameter.KEYWORD_ONLY else "")
                + (" (needed)" if parameter.default is parameter.empty else "")
                for parameter in parameters.values()
            )
            raise InputError(str(error), where=name, allowed=allowed) from None
        return function(*args, **kwargs)

    return call


def _wrong_type(value: object, where: str, allowed: str) -> InputError:
    shown = repr(value) if isinstance(value, str) else show_value(value)
    return InputError("wrong type", where=where, found=shown, allowed=allowed)


def check_listener(listener: object) -> None:
    """Raise an error unless the listener is a function or None.

    Raises
    ------
    InputError
    """
    if listener is not None and not callable(listener):
        raise _wrong_type(listener, "listener", "a function, or None")


def check_executor(value: object) -> None:
    """Raise an error unless the value is an executor.

    Raises
    ------
    InputError
    """
    if not hasattr(value, "submit"):
        raise _wrong_type(
            value,
            "executor",
            "an executor, such as concurrent.futures.ProcessPoolExecutor()",
        )


def check_list(value: object, where: str, of: str) -> None:
    """Raise an error unless the value is a list or tuple; `of` names its items in the message.

    Raises
    ------
    InputError
    """
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise InputError(
            "this is not a list",
            where=where,
            found=repr(value),
            allowed=f"a list of {of}: {where}=[...]",
        )


def check_array(
    value: object, shape: tuple[int, ...], where: str, *, remark: str = ""
) -> None:
    """Raise an error unless the value is an array of real numbers with this shape.

    `remark` is text that the message shows after the shape of the value, for example " for 2 moments".

    Raises
    ------
    InputError
    """
    if not isinstance(value, np.ndarray):
        raise InputError(
            "wrong type",
            where=where,
            found=f"{type(value).__name__} {value!r:.60}",
            allowed=f"a numpy array, {shape}",
        )
    if value.dtype.kind not in "fiu":
        raise InputError(
            "the array does not hold real numbers",
            where=where,
            found=f"an array of {value.dtype}",
            allowed="an array of float",
        )
    if value.shape != shape:
        raise InputError(
            "the array has the wrong shape",
            where=where,
            found=f"{value.shape}{remark}",
            allowed=shape,
        )


def check_finite(value: np.ndarray, where: str) -> None:
    """Raise an error unless all numbers of an array are finite.

    Raises
    ------
    InputError
    """
    if not np.all(np.isfinite(value)):
        raise InputError(
            "the values are not finite",
            where=where,
            found=value.ravel().tolist(),
            allowed="finite numbers",
        )


def numbers(value: ArrayLike, where: str, unit: str) -> np.ndarray:
    """Return a number, or an array of numbers, as floats.

    Raises
    ------
    InputError
        The value is not a number or an array of numbers.
    """
    with suppress(TypeError, ValueError):
        if np.asarray(value).dtype.kind in "fiuU":  # neither None nor booleans
            return np.asarray(value, dtype=float)
    raise _wrong_type(value, where, f"a number, {unit}")


def number(value: float, where: str, unit: str) -> float:
    """Return a single number as a float; see `numbers`."""
    array = numbers(value, where, unit)
    if array.ndim:
        raise _wrong_type(value, where, f"a number, {unit}")
    return float(array)


def count(value: int, where: str) -> int:
    """Return a count, which must be 1 or more.

    Raises
    ------
    InputError
        The value is not a whole number, or is below 1.
    """
    allowed = "a whole number >= 1"
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise _wrong_type(value, where, allowed)
    if value < 1:
        raise InputError("out of range", where=where, found=value, allowed=allowed)
    return int(value)


def check_most(
    value: float, largest: float, unit: str, problem: str, where: str, hint: str = ""
) -> None:
    """Reject a size or a count above `largest`, because it would need too much time or memory.

    Raises
    ------
    InputError
    """
    if value > largest:
        raise InputError(
            problem,
            where=where,
            found=f"{value:.4g} {unit}",
            allowed=f"at most {largest:g} {unit}",
            hint=hint,
        )


def check_once(kind: str, names: Sequence[str], where: str) -> None:
    """Refuse names that are given twice, with an `InputError`."""
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"{kind} {name!r} is given twice", where=where, allowed="each name once"
            )
