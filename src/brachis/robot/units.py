"""Units of joint quantities, by the unit of the joint's position: rad where it turns, m where it slides."""

from __future__ import annotations

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
