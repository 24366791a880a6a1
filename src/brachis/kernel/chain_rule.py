"""Slopes of values with respect to curves, from slopes with respect to joints, and the entries of a Jacobian.

See `brachis.optimise.evaluator`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.kernel.library import address, call, call_checked, declare_fields
from brachis.kernel.value_groups import Partial, ValueGroups, hold_and_address


@dataclass(frozen=True, eq=False)
class MotionSlopes:
    """Derivatives of a joint motion at K points in c curves, (K, n, c) each; see `brachis.kinematics.JointDerivatives`.

    Attributes
    ----------
    gradient, qdot_y, qddot_y, qddot_ydot : (K, n, c) ndarray
    qdddot_y : (K, n, c) ndarray or None
        Derivative of the jerk, needed if a value depends on the jerk.
    """

    gradient: np.ndarray
    qdot_y: np.ndarray
    qddot_y: np.ndarray
    qddot_ydot: np.ndarray
    qdddot_y: np.ndarray | None = None


class _Variables(ctypes.Structure):
    """The structure `variables` of chain_rule.c."""

    _fields_ = declare_fields(
        "l orders shared_count; p shared; l entries; p points curves basis"
    )


class CurvePattern:
    """Where each of z variables has an effect: at one of K points and on one of c curves.

    Parameters
    ----------
    points, curves : (z,) int ndarray
    count, width : int
        Numbers of points and curves, K and c.
    """

    def __init__(
        self, points: np.ndarray, curves: np.ndarray, count: int, width: int
    ) -> None:
        if points.shape != curves.shape:
            raise ValueError("there must be as many points as curves")
        for indices, size, name in (points, count, "point"), (curves, width, "curve"):
            if len(indices) and not 0 <= indices.min() <= indices.max() < size:
                raise ValueError(f"a {name} does not exist; there are {size}")
        self.size = len(points)
        self.shape = count, width
        self._indices = [
            indices.astype("l", order="C", casting="same_kind")
            for indices in (points, curves)
        ]

    @property
    def addresses(self) -> list[int]:
        """Addresses of the points and the curves."""
        return [address(indices) for indices in self._indices]


@dataclass(frozen=True, eq=False)
class VariableSlopes:
    """Slopes of c curves and their time derivatives, at K points, with respect to variables.

    Derivatives on which no value depends are left out.

    Attributes
    ----------
    shared : (b, orders, K, c) ndarray
        Slopes with respect to the b variables that affect all curves at all points.
    pattern : CurvePattern
        Pattern of the other z variables.
    basis : (orders, z) ndarray
        Slopes of each variable's curve and its time derivatives with respect to the variable.
    """

    shared: np.ndarray
    pattern: CurvePattern
    basis: np.ndarray

    @property
    def entries(self) -> int:
        """Number of entries of each value in the Jacobian, b K + z."""
        return len(self.shared) * self.pattern.shape[0] + self.pattern.size

    def structure(self, orders: int, arrays: list[np.ndarray]) -> _Variables:
        """Return the structure that the library reads. The arrays added to `arrays` must stay alive."""
        orders = min(orders, len(self.basis))
        count = len(self.shared)
        size = self.pattern.size
        shape = (count, orders, *self.pattern.shape)
        shared = hold_and_address(self.shared[:, :orders], shape, arrays)
        basis = hold_and_address(self.basis[:orders], (orders, size), arrays)
        return _Variables(orders, count, shared, size, *self.pattern.addresses, basis)

    def find_entries(self, slopes: np.ndarray) -> np.ndarray:
        """Return entries of a Jacobian, (b K + z, values), from slopes by the curves, (orders, K, values, c)."""
        orders, count, _, width = slopes.shape
        if (count, width) != self.pattern.shape:
            raise ValueError("the slopes belong to different points or curves")
        arrays: list[np.ndarray] = []
        structure = ctypes.byref(self.structure(orders, arrays))
        entries: np.ndarray = call_checked(
            "brachis_entries", slopes, structure, e=self.entries
        )
        return entries


def differentiate(
    groups: ValueGroups,
    motion: MotionSlopes,
    states: Sequence[np.ndarray],
    partials: Sequence[tuple[Sequence[Partial], Partial]],
    variables: VariableSlopes | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Differentiate values with respect to the curves and their time derivatives.

    Parameters
    ----------
    groups : ValueGroups
    motion : MotionSlopes
    states : sequence of (K, n) ndarray
        q, qdot and qddot.
    partials : sequence of (sequence of ndarray or None, ndarray or None)
        Partials of the groups in ``groups.with_partials``. The partials with respect to q, qdot, qddot and qdddot have
        the shape (K, size, n), or (size, n) if all points share them. The partial by the first curve is (K, size).
    variables : VariableSlopes, optional

    Returns
    -------
    slopes : (3 or 4, K, sum of sizes, c) ndarray
        Slopes with respect to y, ydot and yddot, and also to ydddot if `qdddot_y` is given.
    entries : (b K + z, sum of sizes) ndarray
        Entries of the Jacobian, see `VariableSlopes.find_entries`; (0, sum of sizes) if no variables are given.
    """
    count, n, width = motion.gradient.shape
    groups.check_joints(n)
    arrays: list[np.ndarray] = []
    table = groups.table_with(partials, (count, n), arrays)
    has_jerk = groups.has_jerk or any(by_q[-1] is not None for by_q, _ in partials)
    if has_jerk and motion.qdddot_y is None:
        raise ValueError("values that depend on qdddot need qdddot_y")
    shape = count, n, width
    derivatives = (
        motion.gradient,
        motion.qdot_y,
        motion.qddot_y,
        motion.qddot_ydot,
        motion.qdddot_y,
    )
    slopes = [hold_and_address(values, shape, arrays) for values in derivatives]
    of_states = [hold_and_address(q, (count, n), arrays) for q in states[:3]]
    arm = None
    if groups.chain is not None:
        slopes.append(hold_and_address(np.empty((3, *shape)), (3, *shape), arrays))
        arm = groups.chain.address
    columns = groups.size
    orders = 3 if motion.qdddot_y is None else 4
    by_curves = np.empty((orders, count, columns, width))
    entries = np.empty((0, columns))
    by = None
    if variables is not None:
        if variables.pattern.shape != (count, width):
            raise ValueError("the variables belong to different points or curves")
        entries = np.empty((variables.entries, columns))
        by = ctypes.byref(variables.structure(orders, arrays))
    call(
        "brachis_differentiate",
        count,
        n,
        width,
        len(table),
        orders,
        columns,
        arm,
        (ctypes.c_void_p * 3)(*of_states),
        (ctypes.c_void_p * 6)(*slopes),
        table,
        by_curves,
        by,
        entries,
    )
    return by_curves, entries
