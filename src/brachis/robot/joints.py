"""Calculations with joint positions: remaining joints, differences of angles, turns by 2 pi.

Units of joint quantities depend on the unit of the joint's position: rad for revolute, m for prismatic joints.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from brachis.common.arrays import clear_rounding
from brachis.task import LIMIT_KINDS

TURN = 2.0 * np.pi


def complement(n: int, joints: Iterable[int]) -> list[int]:
    """Return the indices, from 0 to n - 1, that are not in `joints`, ascending."""
    return sorted(set(range(n)).difference(joints))


def principal(angles: np.ndarray) -> np.ndarray:
    """Return the equivalent angles in [-pi, pi)."""
    return np.remainder(angles + np.pi, TURN) - np.pi


def difference(
    first: np.ndarray, second: np.ndarray, revolute: np.ndarray
) -> np.ndarray:
    """Return the displacement, (..., n), from `second` to `first`; in [-pi, pi) for `revolute` joints, a mask (n,)."""
    gap = first - second
    return np.where(revolute, principal(gap), gap)


def in_turn_of(q: np.ndarray, near: np.ndarray, revolute: np.ndarray) -> np.ndarray:
    """Return positions, (..., n), with every revolute joint in the turn that is closest to `near`."""
    return np.where(revolute, q + TURN * np.round((near - q) / TURN), q)


UNITS: Final[dict[str, dict[str, str]]] = {
    **{kind: row.units for kind, row in LIMIT_KINDS.items()},
    "viscous": {"rad": "Nm s/rad", "m": "N s/m"},
    "coulomb": {"rad": "Nm", "m": "N"},
    "armature": {"rad": "kg m^2", "m": "kg"},
}
"""Units of joint quantities, by the key of the limit or friction term in the task and by the unit of the position."""


def shown_unit(unit: str, *, degrees: bool) -> tuple[str, float]:
    """Return the unit in which figures in an SI unit are shown to a person, and the conversion factor.

    With `degrees`, angles and their time derivatives are shown in deg, deg/s, ...; other units do not change.
    """
    if degrees and unit.partition("/")[0] == "rad":
        return f"deg{unit.removeprefix('rad')}", 180.0 / math.pi
    return unit, 1.0


def write_values(
    values: np.ndarray, quantity: str, position_units: Sequence[str]
) -> str:
    """Write the values of a joint quantity, (n,), with their units."""
    units = [UNITS[quantity][unit] for unit in position_units]
    numbers = [
        f"{value:.4g}" if np.isfinite(value) else "none"
        for value in clear_rounding(values)
    ]
    if len(set(units)) == 1:
        return f"{', '.join(numbers)} {units[0]}"
    pairs = zip(numbers, units, strict=True)
    return ", ".join(
        number if number == "none" else f"{number} {unit}" for number, unit in pairs
    )
