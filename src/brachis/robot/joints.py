"""Joint positions as points of a joint space: which joints are left, differences of angles, turns by 2 pi.

Units of joint quantities, by the unit of the joint's position: rad where it turns, m where it slides.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np

from brachis.task import LIMIT_KINDS

TURN = 2.0 * np.pi


def complement(n: int, joints: Iterable[int]) -> list[int]:
    """Return the joints, out of n, that are not among `joints`, ascending."""
    return sorted(set(range(n)).difference(joints))


def principal(angles: np.ndarray) -> np.ndarray:
    """Return angles in [-pi, pi)."""
    return np.remainder(angles + np.pi, TURN) - np.pi


def difference(
    first: np.ndarray, second: np.ndarray, revolute: np.ndarray
) -> np.ndarray:
    """Displacement (..., n) from `second` to `first`; of revolute joints, a mask (n,), the shortest, in [-pi, pi)."""
    gap = first - second
    return np.where(revolute, principal(gap), gap)


def in_turn_of(q: np.ndarray, near: np.ndarray, revolute: np.ndarray) -> np.ndarray:
    """Return positions (..., n) with every revolute joint in the turn that brings it nearest to `near`."""
    return np.where(revolute, q + TURN * np.round((near - q) / TURN), q)


UNITS: Final[dict[str, dict[str, str]]] = {
    **{kind: row.units for kind, row in LIMIT_KINDS.items()},
    "viscous": {"rad": "Nm s/rad", "m": "N s/m"},
    "coulomb": {"rad": "Nm", "m": "N"},
    "armature": {"rad": "kg m^2", "m": "kg"},
}
"""The keys are those of limits and friction in the task."""


def shown_unit(unit: str, *, degrees: bool) -> tuple[str, float]:
    """Return the unit in which a person sees figures of an SI unit, and the factor that brings them there.

    With `degrees`, what is an angle over powers of time is shown in deg, deg/s, ...; all else stays as it is.
    """
    if degrees and unit.partition("/")[0] == "rad":
        return f"deg{unit.removeprefix('rad')}", 180.0 / math.pi
    return unit, 1.0
