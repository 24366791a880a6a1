"""Units of joint quantities, by the unit of the joint's position: rad where it turns, m where it slides."""

from __future__ import annotations

import math
from typing import Final

UNITS: Final[dict[str, dict[str, str]]] = {
    "position": {"rad": "rad", "m": "m"},
    "velocity": {"rad": "rad/s", "m": "m/s"},
    "acceleration": {"rad": "rad/s^2", "m": "m/s^2"},
    "jerk": {"rad": "rad/s^3", "m": "m/s^3"},
    "torque": {"rad": "Nm", "m": "N"},
    "rms_torque": {"rad": "Nm", "m": "N"},
    "torque_rate": {"rad": "Nm/s", "m": "N/s"},
    "power": {"rad": "W", "m": "W"},
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
