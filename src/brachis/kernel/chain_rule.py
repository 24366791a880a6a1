"""Values of limits, their slopes by curves from slopes by joints, and entries of a Jacobian.

See `brachis.optimise.evaluator`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.kernel.chain import Chain
from brachis.kernel.library import address, as_doubles, as_doubles_at_points, load
from brachis.kernel.path_motion import PathMotion

QUANTITIES = ("q", "qdot", "qddot", "qdddot", "torque")
"""In the order of chain_rule.c."""
_TORQUE = len(QUANTITIES) - 1
_PARTIAL = ("q", "qdot", "qddot", "qdddot")
_GROUP = np.dtype(
    [
        ("values", "l"),
        ("quantity", "l"),
        *((name, np.intp) for name in ("joints", "offsets", "factors")),
        *((f"{name}_{part}", "l") for name in _PARTIAL for part in ("at", "step")),
        ("s", np.intp),
    ]
)
"""`group` of chain_rule.c."""

Partial = np.ndarray | None


@dataclass(frozen=True, eq=False)
class ScaledQuantity:
    """Values that are each a quantity of one joint, less an offset, times a factor.

    Attributes
    ----------
    quantity : str
        One of `QUANTITIES`.
    joints : (c,) int ndarray
    offsets, factors : (c,) ndarray
    chain : Chain
        Of the joints; of which torques are.
    """

    quantity: str
    joints: np.ndarray
    offsets: np.ndarray
    factors: np.ndarray
    chain: Chain


@dataclass(frozen=True, eq=False)
class MotionSlopes:
    """Derivatives of a joint motion at K points by c curves, (K, n, c) each; see `brachis.kinematics.JointDerivatives`.

    Attributes
    ----------
    gradient, qdot_y, qddot_y, qddot_ydot : (K, n, c) ndarray
    qdddot_y : (K, n, c) ndarray or None
        Where a value depends on the jerk.
    path_motion : PathMotion or None
        Along a path the motion whose slopes they are. All but `gradient` are without numbers until that is
        differentiated: by `PathMotion.derivatives`, or by `ValueGroups.differentiate`.
    """

    gradient: np.ndarray
    qdot_y: np.ndarray
    qddot_y: np.ndarray
    qddot_ydot: np.ndarray
    qdddot_y: np.ndarray | None = None
    path_motion: PathMotion | None = None


class _Variables(ctypes.Structure):
    """`variables` of chain_rule.c."""

    _fields_ = [
        ("orders", ctypes.c_long),
        ("shared_count", ctypes.c_long),
        ("shared", ctypes.c_void_p),
        ("entries", ctypes.c_long),
        *((name, ctypes.c_void_p) for name in ("points", "curves", "basis")),
    ]


class CurvePattern:
    """Where each of z variables matters: at which of K points, and for which of c curves.

    Parameters
    ----------
    points, curves : (z,) int ndarray
    count, width : int
        K and c.
    """

    def __init__(
        self, points: np.ndarray, curves: np.ndarray, count: int, width: int
    ) -> None:
        if points.shape != curves.shape:
            raise ValueError("points and curves are not as many")
        for numbers, most, name in (points, count, "point"), (curves, width, "curve"):
            if len(numbers) and not 0 <= numbers.min() <= numbers.max() < most:
                raise ValueError(f"a {name} does not exist; there are {most}")
        self.size = len(points)
        self.shape = count, width
        self._kept = [
            own.astype("l", order="C", casting="same_kind") for own in (points, curves)
        ]

    @property
    def addresses(self) -> list[int]:
        """Where the library finds points and curves."""
        return [address(own) for own in self._kept]


@dataclass(frozen=True, eq=False)
class VariableSlopes:
    """Slopes of c curves and their time derivatives, at K points, by variables.

    Orders that values do not depend on are left out.

    Attributes
    ----------
    shared : (b, orders, K, c) ndarray
        By the b variables that move all curves, at all points.
    pattern : CurvePattern
        Of the other z variables.
    basis : (orders, z) ndarray
        Slopes of the curve of each, and of its time derivatives, by it.
    """

    shared: np.ndarray
    pattern: CurvePattern
    basis: np.ndarray

    @property
    def entries(self) -> int:
        """How many entries a value has in the Jacobian, b K + z."""
        return len(self.shared) * self.pattern.shape[0] + self.pattern.size

    def structure(self, orders: int, kept: list[np.ndarray]) -> _Variables:
        """Return what the library reads; what is added to `kept` has to stay alive."""
        orders = min(orders, len(self.basis))
        count = len(self.shared)
        size = self.pattern.size
        whole = (count, orders, *self.pattern.shape)
        shared = _keep_address(self.shared[:, :orders], whole, kept)
        basis = _keep_address(self.basis[:orders], (orders, size), kept)
        return _Variables(orders, count, shared, size, *self.pattern.addresses, basis)

    def find_entries(self, slopes: np.ndarray) -> np.ndarray:
        """Entries of a Jacobian, (b K + z, values), of values with slopes by the curves, (orders, K, values, c)."""
        orders, count, columns, width = slopes.shape
        if (count, width) != self.pattern.shape:
            raise ValueError("slopes are of other points or curves")
        kept: list[np.ndarray] = []
        table = as_doubles(slopes, slopes.shape)
        found = np.empty((self.entries, columns))
        load().brachis_entries(
            count,
            columns,
            width,
            address(table),
            ctypes.byref(self.structure(orders, kept)),
            address(found),
        )
        return found


class ValueGroups:
    """Groups of values of a joint motion.

    Parameters
    ----------
    scaled : sequence of ScaledQuantity or None
        Groups of which nothing is given here have partials.
    sizes : sequence of int
        How many values are in each.

    Attributes
    ----------
    chain : Chain or None
        Of which torques are; None where no group needs them.
    has_jerk : bool
        Whether a scaled quantity is a jerk.
    with_partials : list of int
        Numbers of the groups that have partials.
    """

    def __init__(
        self, scaled: Sequence[ScaledQuantity | None], sizes: Sequence[int]
    ) -> None:
        self._scaled = tuple(scaled)
        self._sizes = tuple(sizes)
        self._kept: list[np.ndarray] = []
        self._first = np.cumsum([0, *sizes]).tolist()
        self._table = np.zeros(len(self._sizes), dtype=_GROUP)
        self._table["values"] = self._sizes
        self._table["quantity"] = -1
        self.chain: Chain | None = None
        self.has_jerk = False
        self._joints: int | None = None
        self.with_partials = [
            number for number, own in enumerate(scaled) if own is None
        ]
        for row, own in zip(self._table, scaled, strict=True):
            if own is not None:
                self._set(row, own)

    def __reduce__(self) -> tuple[type[ValueGroups], tuple[Any, ...]]:
        """Leave addresses behind."""
        return ValueGroups, (self._scaled, self._sizes)

    def _set(self, row: np.void, own: ScaledQuantity) -> None:
        """Set what the library reads of a scaled quantity."""
        quantity = QUANTITIES.index(own.quantity)
        joints = np.ascontiguousarray(own.joints, dtype="l")
        count = row["values"]
        if len(joints) and not 0 <= joints.min() <= joints.max() < own.chain.n:
            raise ValueError(f"a joint does not exist; there are {own.chain.n}")
        offsets = as_doubles(own.offsets, (count,))
        factors = as_doubles(own.factors, (count,))
        if joints.shape != (count,):
            raise ValueError("joints are not as many as values")
        if self._joints not in (None, own.chain.n):
            raise ValueError("the chains have different numbers of joints")
        self._joints = own.chain.n
        row["quantity"] = quantity
        row["joints"] = address(joints)
        row["offsets"] = address(offsets)
        row["factors"] = address(factors)
        self._kept += [joints, offsets, factors]
        self.has_jerk |= own.quantity == "qdddot"
        if quantity == _TORQUE:
            if self.chain not in (None, own.chain):
                raise ValueError("torques are of more than one chain")
            self.chain = own.chain

    def _check_joints(self, n: int) -> None:
        """Refuse a motion of another number of joints: the library would read beyond its end."""
        if self._joints not in (None, n):
            raise ValueError(f"the motion has {n} joints; needed: {self._joints}")

    def values(
        self, states: Sequence[np.ndarray], torque: Partial = None
    ) -> list[np.ndarray]:
        """Compute the values of scaled quantities.

        Parameters
        ----------
        states : sequence of (K, n) ndarray
            q, qdot, qddot and, where a group needs it, qdddot.
        torque : (K, n) ndarray, optional
            Where a group needs it.

        Returns
        -------
        list of (K, size) ndarray
            Of every group; nothing is set where it has partials.
        """
        count, n = states[0].shape
        self._check_joints(n)
        if self.has_jerk and len(states) < _TORQUE:
            raise ValueError("a group needs qdddot")
        if self.chain is not None and torque is None:
            raise ValueError("a group needs the torque")
        kept: list[np.ndarray] = []
        nothing = [None] * (_TORQUE - len(states))
        given = (*states, *nothing, torque)
        addresses = [_keep_address(own, (count, n), kept) for own in given]
        found = np.empty(count * self._first[-1])
        load().brachis_values(
            count,
            n,
            (ctypes.c_void_p * len(QUANTITIES))(*addresses),
            len(self._table),
            address(self._table),
            address(found),
        )
        parts = zip(self._first, self._sizes, strict=False)
        return [
            found[count * first : count * (first + size)].reshape(count, size)
            for first, size in parts
        ]

    def differentiate(
        self,
        motion: MotionSlopes,
        states: Sequence[np.ndarray],
        partials: Sequence[tuple[Sequence[Partial], Partial]],
        variables: VariableSlopes | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Differentiate the values by the curves and their time derivatives.

        Parameters
        ----------
        motion : MotionSlopes
        states : sequence of (K, n) ndarray
            q, qdot and qddot.
        partials : sequence of (sequence of ndarray or None, ndarray or None)
            Of the groups that are not scaled quantities, in order: (K, size, n), or (size, n) if all points share them,
            by q, qdot, qddot and qdddot, and (K, size) by the first curve.
        variables : VariableSlopes, optional

        Returns
        -------
        slopes : (3 or 4, K, sum of sizes, c) ndarray
            By y, ydot, yddot and, with `qdddot_y`, ydddot.
        entries : (b K + z, sum of sizes) ndarray
            See `VariableSlopes.find_entries`; (0, sum of sizes) without variables.
        """
        count, n, width = motion.gradient.shape
        self._check_joints(n)
        kept: list[np.ndarray] = []
        table = self._table
        has_jerk = self.has_jerk
        if self.with_partials:
            table = table.copy()
            for number, (by_joints, by_s) in zip(
                self.with_partials, partials, strict=True
            ):
                has_jerk |= by_joints[-1] is not None
                _set_partials(table[number], by_joints, by_s, (count, n), kept)
        if has_jerk and motion.qdddot_y is None:
            raise ValueError("values that depend on qdddot need qdddot_y")
        shape = count, n, width
        parts = (motion.gradient, motion.qdot_y, motion.qddot_y, motion.qddot_ydot)
        slopes = [_keep_address(own, shape, kept) for own in (*parts, motion.qdddot_y)]
        of_states = [_keep_address(own, (count, n), kept) for own in states[:3]]
        along = motion.path_motion
        if along is not None and along.chain.n != n:
            raise ValueError("the motion along the path has other joints")
        arm = None
        if self.chain is not None:
            slopes.append(_keep_address(np.empty((3, *shape)), (3, *shape), kept))
            arm = self.chain.address
        columns = self._first[-1]
        orders = 3 if motion.qdddot_y is None else 4
        found = np.empty((orders, count, columns, width))
        entries = np.empty((0, columns))
        by = None
        if variables is not None:
            if variables.pattern.shape != (count, width):
                raise ValueError("variables are of other points or curves")
            entries = np.empty((variables.entries, columns))
            by = ctypes.byref(variables.structure(orders, kept))
        load().brachis_differentiate(
            count,
            n,
            width,
            None if along is None else along.address,
            arm,
            (ctypes.c_void_p * 3)(*of_states),
            (ctypes.c_void_p * 6)(*slopes),
            len(table),
            address(table),
            orders,
            columns,
            address(found),
            by,
            address(entries),
        )
        return found, entries


def _keep_address(
    values: Partial, shape: tuple[int, ...], kept: list[np.ndarray]
) -> int | None:
    """Return where numbers are, None without any; what is added to `kept` has to stay alive."""
    if values is None:
        return None
    kept.append(as_doubles(values, shape))
    return address(kept[-1])


def _set_partials(
    row: np.void,
    by_joints: Sequence[Partial],
    by_s: Partial,
    points: tuple[int, int],
    kept: list[np.ndarray],
) -> None:
    """Set what the library reads of partials at K points of n joints; see `_keep_address`."""
    count, n = points
    size = int(row["values"])
    for name, partial in zip(_PARTIAL, by_joints, strict=True):
        if partial is None:
            continue
        own, step = as_doubles_at_points(partial, (count, size, n))
        kept.append(own)
        row[f"{name}_at"] = address(own)
        row[f"{name}_step"] = step
    row["s"] = _keep_address(by_s, (count, size), kept) or 0
