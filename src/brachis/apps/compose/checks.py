"""What the figures of a composition have to be; each function raises `InputError` otherwise."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from brachis.errors import InputError


def identifier(value: str, where: str) -> str:
    """Check a name of links and joints."""
    if not (
        isinstance(value, str) and re.fullmatch(r"[A-Za-z_][\w.-]*", value, re.ASCII)
    ):
        raise InputError(
            "is not a name",
            where=where,
            found=repr(value),
            allowed="a letter or underscore, then letters, digits, underscores, dots and hyphens",
        )
    return value


def vector(
    values: Sequence[float],
    where: str,
    allowed: str,
    *,
    length: int = 3,
    above: float = -math.inf,
) -> tuple[float, ...]:
    """Check the number of finite components, and that each lies above a bound."""
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if (
        array.shape != (length,)
        or not np.all(np.isfinite(array))
        or not np.all(array > above)
    ):
        raise InputError("is wrong", where=where, found=values, allowed=allowed)
    return tuple(float(value) for value in array)


def direction(values: Sequence[float], where: str) -> tuple[float, ...]:
    """Turn a vector of any length but zero into a unit vector."""
    array = np.array(vector(values, where, "a direction [x, y, z]"))
    largest = np.abs(array).max()
    if largest == 0.0:
        raise InputError(
            "has no direction",
            where=where,
            found=list(values),
            allowed="[x, y, z], not all zero",
        )
    array /= (
        largest  # the squares of very long and very short vectors are not representable
    )
    return tuple(float(value) for value in array / np.linalg.norm(array))


def interval(values: Sequence[float], where: str, unit: str) -> tuple[float, float]:
    """Check a range that is finite and not empty."""
    low, high = vector(values, where, f"[low, high] in {unit}, both finite", length=2)
    if not low < high:
        raise InputError(
            "is empty",
            where=where,
            found=f"[{low:g}, {high:g}] {unit}",
            allowed="low < high",
        )
    return low, high


def positive(value: float, where: str, unit: str) -> float:
    """Check a finite number above zero."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise InputError(
            "is not positive",
            where=where,
            found=f"{value} {unit}",
            allowed=f"a finite number > 0 {unit}",
        )
    return number
