"""Units of lengths, angles and speeds, and quantities that are written with them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import pi
from typing import Final

LENGTHS: Final = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "inch": 0.0254}
ANGLES: Final = {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180.0}
SPEEDS: Final = {
    "m/s": 1.0,
    "mm/s": 1e-3,
    "m/min": 1.0 / 60.0,
    "mm/min": 1e-3 / 60.0,
    "in/min": 0.0254 / 60.0,
    "inch/min": 0.0254 / 60.0,
}
_QUANTITY = re.compile(r"^\s*([+-]?[0-9]*\.?[0-9]+(?:[eE][+-]?[0-9]+)?)\s*([a-z/]+)\s*$")


@dataclass(frozen=True)
class Units:
    """Units of the numbers in a file.

    Attributes
    ----------
    length, angle, speed : str or None
        Out of `LENGTHS`, `ANGLES`, `SPEEDS`; None where nobody has stated it.
    """

    length: str | None = None
    angle: str | None = None
    speed: str | None = None


def quantity(text: str, units: dict[str, float]) -> float | None:
    """Read ``0.05 mm`` as a number in SI units; None where it is none."""
    match = _QUANTITY.match(text)
    if match is None or match[2] not in units:
        return None
    return float(match[1]) * units[match[2]]
