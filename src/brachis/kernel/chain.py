"""A serial chain of joints and rigid bodies: placement, Jacobian and dynamics at many postures in one call."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from brachis.kernel.library import (
    Structured,
    address,
    as_contiguous,
    call_checked,
    declare_fields,
    shape_of,
)

_QUANTITIES = ("speed", "angular speed", "acceleration")
"""Quantities of the tool's motion, in the order of tool.c."""


_SHAPES = {
    "revolute": "n",
    "axes": "n3",
    "points": "n3",
    "tool_position": "3",
    "tool_rotation": "33",
    "masses": "n",
    "centers": "n3",
    "inertias": "n6",
    "gravity": "3",
    "friction": "n4",
}
"""Shapes of the arrays of a chain with n joints, in the order of chain.h."""


class _Chain(ctypes.Structure):
    """The structure `chain` of chain.h."""

    _fields_ = declare_fields(f"l joints carriers; p {' '.join(_SHAPES)}")


class TorqueDerivatives(NamedTuple):
    """Derivatives of the torque of K states, each (K, n, n): row joint torque, column joint.

    Attributes
    ----------
    q, qdot, qddot : (K, n, n) ndarray
        Derivatives with respect to position, velocity and acceleration. The last one is the mass matrix, to which the
        rotor inertias are added.
    """

    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray


@dataclass(frozen=True, eq=False)
class Chain(Structured):
    """A serial chain at its zero posture, in the world frame.

    Attributes
    ----------
    revolute : (n,) bool ndarray
        True for revolute joints; the others are prismatic.
    axes : (n, 3) ndarray
        Unit vectors along the joint axes.
    points : (n, 3) ndarray
        A point on each axis, m.
    tool_position : (3,) ndarray
        Position of the tool, m.
    tool_rotation : (3, 3) ndarray
        Orientation of the tool.
    masses : (n,) ndarray
        Mass of the body after each joint, kg.
    centers : (n, 3) ndarray
        Centers of mass, m.
    inertias : (n, 6) ndarray
        Moments of inertia about the centers of mass, kg m^2: xx, xy, xz, yy, yz, zz.
    gravity : (3,) ndarray
        Acceleration of gravity, m/s^2.
    friction : (n, 4) ndarray
        For each joint: rotor inertia, kg m^2; viscous term, Nm s; Coulomb term, Nm; v_eps of ``tanh(qdot / v_eps)``,
        rad/s. For a prismatic joint the units are kg, N s/m, N and m/s.
    carriers : int
        Number of joints, the first ones, that carry the workpiece, last joint first. For torques, they are a chain of
        their own from the world, and so are the joints after them.
    """

    revolute: np.ndarray
    axes: np.ndarray
    points: np.ndarray
    tool_position: np.ndarray
    tool_rotation: np.ndarray
    masses: np.ndarray
    centers: np.ndarray
    inertias: np.ndarray
    gravity: np.ndarray
    friction: np.ndarray
    carriers: int = 0

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.revolute)

    def _make_structure(self) -> _Chain:
        sizes = {"n": self.n}
        arrays = [
            as_contiguous(getattr(self, name), shape_of(letters, sizes))
            for name, letters in _SHAPES.items()
        ]
        structure = _Chain(self.n, self.carriers, *map(address, arrays))
        structure.arrays = arrays
        return structure

    def torques(self, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> np.ndarray:
        """Compute torques, (K, n), Nm or N, of rigid bodies, rotors and friction in K states, (K, n) each."""
        torques: np.ndarray = self._call("brachis_torques", q, qdot, qddot)
        return torques

    def torque_derivatives(
        self, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> TorqueDerivatives:
        """Differentiate `torques` with respect to q, qdot and qddot."""
        states = (q, qdot, qddot)
        return TorqueDerivatives(*self._call("brachis_torque_derivatives", *states))

    def mass_matrices(self, q: np.ndarray) -> np.ndarray:
        """Compute the mass matrices, (K, n, n), including the rotors, at K postures, (K, n)."""
        matrices: np.ndarray = self._call("brachis_mass_matrices", q)
        return matrices

    def tool(
        self, q: np.ndarray, *, in_tool_axes: bool
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Compute the pose of the tool and its Jacobian at K postures, (K, n).

        Returns
        -------
        positions : (K, 3) ndarray
            m.
        rotations : (K, 3, 3) ndarray
        twists : (6, K, n) ndarray
            Columns of the Jacobian: linear, then angular velocity at the tool's origin, along the axes of the tool or
            of the world.
        """
        positions, rotations, twists = self._call("brachis_tool", q, in_tool_axes)
        return positions, rotations, twists

    def tool_sizes(
        self, quantity: str, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> np.ndarray:
        """Compute the magnitude of the tool's velocity, angular velocity or acceleration in K states.

        Parameters
        ----------
        quantity : {"speed", "angular speed", "acceleration"}
            Quantity of the tool's origin, in the world frame.
        q, qdot, qddot : (K, n) ndarray

        Returns
        -------
        (K,) ndarray
            m/s, rad/s or m/s^2.
        """
        return self._find_sizes(quantity, (q, qdot, qddot), None)

    def tool_size_slopes(
        self, quantity: str, q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Compute `tool_sizes`, (K,), and slopes by q, qdot and qddot, (K, n) each; they are 0 where the size is 0."""
        by_q, by_qdot, by_qddot = slopes = np.empty((3, len(q), self.n))
        sizes = self._find_sizes(quantity, (q, qdot, qddot), slopes)
        return sizes, (by_q, by_qdot, by_qddot)

    def _find_sizes(
        self,
        quantity: str,
        states: tuple[np.ndarray, np.ndarray, np.ndarray],
        slopes: np.ndarray | None,
    ) -> np.ndarray:
        """Return `tool_sizes`, and fill in `slopes`, (3, K, n), unless it is None."""
        number = _QUANTITIES.index(quantity)
        sizes: np.ndarray = self._call("brachis_tool_sizes", number, *states, slopes)
        return sizes

    def _call(self, name: str, *arguments: np.ndarray | int | None) -> Any:
        """Call a function of the library for this chain."""
        return call_checked(name, self.address, *arguments, n=self.n)
