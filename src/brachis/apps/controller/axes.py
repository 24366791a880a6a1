"""The axes of a controller, bound to the joints of a robot, with conversion of positions in both directions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from brachis.apps.controller.profile import Axis, Profile
from brachis.common.arguments import check_once
from brachis.errors import InputError, check_names
from brachis.robot import Robot

FACTORS = {"rad": 1.0, "deg": 180.0 / np.pi, "m": 1.0, "mm": 1e3}
"""Units of axes, and the factors that convert rad or m to them."""


_SINGULAR = 1e-9
"""Determinant below which couplings do not determine the joints."""


@dataclass(frozen=True, eq=False)
class ControllerAxes:
    """The m axes of a controller and the joints that they move.

    Attributes
    ----------
    names : tuple of str
        Names of the axes.
    units : tuple of str
        ``rad``, ``deg``, ``m`` or ``mm``.
    external : tuple of bool
        Whether each axis is external.
    joints : tuple of str
        Joint of the robot that each axis moves.
    index : (m,) int ndarray
        Indices of these joints in the robot's chain.
    zero : (m,) ndarray
        Position of each joint at which its axis, without coupling, is at 0, rad or m.
    matrix : (m, m) ndarray
        The axis values are ``matrix @ (q - zero)``, in the units of the axes.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    external: tuple[bool, ...]
    joints: tuple[str, ...]
    index: np.ndarray
    zero: np.ndarray
    matrix: np.ndarray

    def encode(self, q: np.ndarray) -> np.ndarray:
        """Return the axis values, (K, m), at postures (K, n), rad or m."""
        return (q[:, self.index] - self.zero) @ self.matrix.T

    def encode_rates(self, rates: np.ndarray) -> np.ndarray:
        """Return velocities or accelerations of the axes, (K, m), from those of the joints, (K, n)."""
        return rates[:, self.index] @ self.matrix.T

    def decode(self, values: np.ndarray) -> np.ndarray:
        """Return the positions of the joints that the axes move, (K, m), rad or m, from axis values, (K, m)."""
        return np.linalg.solve(self.matrix, values.T).T + self.zero

    def encode_torques(self, tau: np.ndarray) -> np.ndarray:
        """Return the torques of the axes, (K, m), Nm or N, that have the same power as joint torques, (K, n)."""
        factors = np.array([FACTORS[unit] for unit in self.units])
        slopes = self.matrix / factors[:, None]
        return np.linalg.solve(slopes.T, tau[:, self.index].T).T

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the axes, as in a recording's columns."""
        return self.names

    @property
    def position_units(self) -> tuple[str, ...]:
        """Units of the axes; columns of a recording have the same units unless their header states others."""
        return self.units


def bind_axes(profile: Profile, robot: Robot) -> ControllerAxes:
    """Bind the axes of a profile to a robot's joints.

    Raises
    ------
    UnknownNameError
        An axis names a joint that the robot does not have, or a coupling names an axis that does not exist.
    InputError
        A joint or an axis is given twice, the axes of the arm are not in chain order, or a group has too few names.
    """
    names = robot.urdf_joints
    units = dict(zip(names, robot.position_units, strict=False))
    axes = profile.axes or _axes_of_joints(names, units)
    joints = [axis.joint for axis in axes]
    check_names("joint", joints, names, "profile.axes")
    check_once("joint", joints, "profile.axes")
    for number, axis in enumerate(axes):
        if units[axis.joint] == "rad" and abs(axis.zero) > 2.0 * np.pi:
            raise InputError(
                "the zero of an axis is more than a turn away",
                where=f"profile.axes[{number}].zero",
                found=f"{axis.zero:g} rad",
                allowed="rad; or a number of degrees with !degrees",
            )
    arm = [axis.joint for axis in axes if not axis.external]
    in_order = [name for name in names if name in arm]
    if arm != in_order:
        raise InputError(
            "the axes of the arm are not in the order of the chain",
            where="profile.axes",
            found=", ".join(arm),
            allowed=", ".join(in_order),
        )
    named = _name_axes(axes, profile, units)
    axis_names, axis_units = map(tuple, zip(*named, strict=True))
    check_once("axis", axis_names, "profile")
    coupling = np.eye(len(axes))
    for name, factors in profile.coupled.items():
        check_names("axis", [name, *factors], axis_names, "profile.coupled")
        for source, factor in factors.items():
            coupling[axis_names.index(name), axis_names.index(source)] += factor
    if abs(np.linalg.det(coupling)) < _SINGULAR:
        raise InputError(
            "the axes do not determine the joints",
            where="profile.coupled",
            found=profile.coupled,
        )
    scales = [
        axis.sign * FACTORS[unit] for axis, unit in zip(axes, axis_units, strict=True)
    ]
    return ControllerAxes(
        axis_names,
        axis_units,
        tuple(axis.external for axis in axes),
        tuple(joints),
        np.array([names.index(joint) for joint in joints]),
        np.array([axis.zero for axis in axes]),
        coupling @ np.diag(scales),
    )


def _axes_of_joints(names: Sequence[str], units: dict[str, str]) -> tuple[Axis, ...]:
    """Return an axis for each joint, those of the arm first; linear joints before the first rotary one are external."""
    slides = list(takewhile(lambda name: units[name] == "m", names))
    arm = [*names[len(slides) :]] or slides
    ordered = dict.fromkeys((*arm, *slides))
    return tuple(Axis(joint=name, external=name not in arm) for name in ordered)


def _name_axes(
    axes: Sequence[Axis], profile: Profile, units: dict[str, str]
) -> Iterator[tuple[str, str]]:
    """Yield the name of each axis (its own, the next one of its group, or that of its joint) and its unit."""
    groups = {False: profile.arm, True: profile.external}
    unused = {kind: iter(group.names) for kind, group in groups.items()}
    for axis in axes:
        group = groups[axis.external]
        default = axis.joint if not group.names else None
        name = axis.name or default or next(unused[axis.external], None)
        if name is None:
            kind = "external axes" if axis.external else "axes of the arm"
            raise InputError(
                f"the profile has too few names for {kind}",
                where="profile",
                found=", ".join(entry.joint for entry in axes),
                allowed=", ".join(group.names),
                hint="Name the axes in a profile of your own; a rail has external: true",
            )
        yield name, group.angle if units[axis.joint] == "rad" else group.length
