"""Units of lengths, angles and speeds, and conventions for orientations.

Orientations are written as quaternions, rotation vectors, or the angles used by manufacturers of robots.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    import numpy.typing as npt
    from scipy.spatial.transform import Rotation


LENGTHS: Final = {
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "in": 0.0254,
    "inch": 0.0254,
}
ANGLES: Final = {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180.0}
SPEEDS: Final = {
    "m/s": 1.0,
    "mm/s": 1e-3,
    "m/min": 1.0 / 60.0,
    "mm/min": 1e-3 / 60.0,
    "in/min": 0.0254 / 60.0,
    "inch/min": 0.0254 / 60.0,
}
UNITS: Final = {"length": LENGTHS, "angle": ANGLES, "speed": SPEEDS}
"""Conversion factors to SI units, by kind of quantity."""


@dataclass(frozen=True)
class Convention:
    """A convention for the numbers that describe an orientation.

    Attributes
    ----------
    meaning : str
        Meaning of the numbers, in words.
    makers : str
        Manufacturers and software that use the convention.
    euler : str
        SciPy's code for the axes of three angles: small letters for fixed axes, capitals for axes that turn with the
        tool; empty for a convention without such angles.
    """

    meaning: str
    makers: str
    euler: str = ""


CONVENTIONS: Final = {
    "quaternion_wxyz": Convention("quaternion, w first", "ABB, MuJoCo, Drake"),
    "quaternion_xyzw": Convention(
        "quaternion, w last", "ROS, SciPy, Pinocchio's vectors"
    ),
    "rotation_vector": Convention("axis times angle", "Universal Robots"),
    "rpy": Convention(
        "roll, pitch, yaw about the fixed x, then y, then z axis",
        "URDF, Yaskawa, Mitsubishi, UFACTORY",
        "xyz",
    ),
    "kuka_abc": Convention(
        "A about z, B about the new y, C about the new x axis", "KUKA", "ZYX"
    ),
    "staubli_xyz": Convention(
        "Rx about x, Ry about the new y, Rz about the new z axis",
        "Staubli, Mecademic, RoboDK's targets",
        "XYZ",
    ),
    "fanuc_wpr": Convention(
        "W, P, R about the fixed x, then y, then z axis", "Fanuc", "xyz"
    ),
    "euler_zyz": Convention(
        "O about z, A about the new y, T about the new z axis",
        "Kawasaki, Comau (A, E, R), Adept",
        "ZYZ",
    ),
}
"""Conventions for orientations, by name."""


def choices(names: tuple[str, ...] = tuple(CONVENTIONS), suffix: str = "") -> str:
    """List conventions with meaning and users, for messages; `suffix` is added to names of angle conventions."""
    listed = ((name, CONVENTIONS[name]) for name in names)
    return "; ".join(
        f"{name}{suffix if c.euler else ''} ({c.meaning}: {c.makers})"
        for name, c in listed
    )


def rotation_by(convention: str, values: npt.NDArray[Any]) -> Rotation:
    """Return the rotations of orientations, (..., 3) in rad or (..., 4), in one of the `CONVENTIONS`."""
    from scipy.spatial.transform import Rotation

    if convention.startswith("quaternion"):
        return Rotation.from_quat(values, scalar_first=convention.endswith("wxyz"))
    if convention == "rotation_vector":
        return Rotation.from_rotvec(values)
    return Rotation.from_euler(CONVENTIONS[convention].euler, values)


def values_of(convention: str, rotation: Rotation) -> npt.NDArray[Any]:
    """Return the numbers, (..., 3) in rad or (..., 4), of rotations in one of the `CONVENTIONS`."""
    if convention.startswith("quaternion"):
        return rotation.as_quat(scalar_first=convention.endswith("wxyz"))
    if convention == "rotation_vector":
        return rotation.as_rotvec()
    with warnings.catch_warnings():
        # In gimbal lock, any of the many ways to write a rotation is accepted.
        warnings.filterwarnings("ignore", "Gimbal lock")
        return rotation.as_euler(CONVENTIONS[convention].euler)  # type: ignore[call-overload]


def quaternions_of(rotation: Rotation) -> npt.NDArray[Any]:
    """Return unit quaternions w, x, y, z of rotations, (..., 4), with either sign."""
    return rotation.as_quat(scalar_first=True)
