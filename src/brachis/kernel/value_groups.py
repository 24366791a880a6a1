"""Values of limits in groups. The kernel itself computes joint quantities and formulas, but not other values."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.kernel.chain import Chain
from brachis.kernel.formula import Formula
from brachis.kernel.library import address, as_contiguous, as_doubles_at_points, call

QUANTITIES = ("q", "qdot", "qddot", "qdddot", "torque")
"""Quantities of a joint, in the order of motion.h."""
_TORQUE = len(QUANTITIES) - 1
_FORMULA = len(QUANTITIES)
_PARTIAL = ("q", "qdot", "qddot", "qdddot")
_OF_VALUES = ("joints", "offsets", "factors", "values_of", "slopes_of")
_GROUP = np.dtype(
    [
        ("values", "l"),
        ("quantity", "l"),
        *((name, np.intp) for name in _OF_VALUES),
        *((f"{name}_{field}", "l") for name in _PARTIAL for field in ("at", "step")),
        ("s", np.intp),
    ]
)
"""The structure `value_group` of motion.h."""

Partial = np.ndarray | None


@dataclass(frozen=True, eq=False)
class ScaledQuantity:
    """Values of the form (quantity of one joint - offset) factor.

    Attributes
    ----------
    quantity : str
        One of `QUANTITIES`.
    joints : (c,) int ndarray
    offsets, factors : (c,) ndarray
    chain : Chain
        Chain of the joints, which also gives the torques.
    """

    quantity: str
    joints: np.ndarray
    offsets: np.ndarray
    factors: np.ndarray
    chain: Chain


@dataclass(frozen=True, eq=False)
class FormulaQuantity:
    """Values that are results of a formula of the posture, times a factor.

    Attributes
    ----------
    values_of : Formula
        Formula of q, with c results.
    slopes_of : Formula
        Formula of q, with (c, n) results: the slopes of the values with respect to q.
    factors : (c,) ndarray
    """

    values_of: Formula
    slopes_of: Formula
    factors: np.ndarray


Quantity = ScaledQuantity | FormulaQuantity
"""A quantity that the kernel computes itself."""


class ValueGroups:
    """Groups of values of a joint motion.

    Parameters
    ----------
    quantities : sequence of ScaledQuantity, FormulaQuantity or None
        Quantities of the groups. None stands for a group whose values the kernel does not compute; it has partials.
    sizes : sequence of int
        Number of values in each group.

    Attributes
    ----------
    chain : Chain or None
        Chain that gives the torques; None if no group needs them.
    has_jerk : bool
        Whether a quantity is a jerk.
    with_partials : list of int
        Indices of the groups that have partials.
    size : int
        Total number of values.
    """

    def __init__(
        self, quantities: Sequence[Quantity | None], sizes: Sequence[int]
    ) -> None:
        self._quantities = tuple(quantities)
        self._sizes = tuple(sizes)
        self._arrays: list[np.ndarray] = []
        self._first = np.cumsum([0, *sizes]).tolist()
        self._table = np.zeros(len(self._sizes), dtype=_GROUP)
        self._table["values"] = self._sizes
        self._table["quantity"] = -1
        self.size = self._first[-1]
        self.chain: Chain | None = None
        self.has_jerk = False
        self._joints: int | None = None
        self._formulas: list[int] = []
        self.with_partials = [
            i for i, quantity in enumerate(quantities) if quantity is None
        ]
        for number, quantity in enumerate(quantities):
            if isinstance(quantity, FormulaQuantity):
                self._set_formula(number, quantity)
            elif quantity is not None:
                self._set(self._table[number], quantity)

    def __reduce__(self) -> tuple[type[ValueGroups], tuple[Any, ...]]:
        """Leave out addresses when pickling."""
        return ValueGroups, (self._quantities, self._sizes)

    def _set_formula(self, number: int, quantity: FormulaQuantity) -> None:
        """Set the fields that the library reads for a formula."""
        row = self._table[number]
        size = int(row["values"])
        values_of = quantity.values_of
        slopes_of = quantity.slopes_of
        (n,) = values_of.counts
        shapes = (values_of.shape, slopes_of.shape, slopes_of.counts)
        if shapes != ((size,), (size, n), (n,)):
            raise ValueError(f"the formulas of {size} values have the shapes {shapes}")
        factors = as_contiguous(quantity.factors, (size,))
        self._set_joints(n)
        self._arrays.append(factors)
        self._formulas.append(number)
        row["quantity"] = _FORMULA
        row["factors"] = address(factors)
        row["values_of"] = values_of.address
        row["slopes_of"] = slopes_of.address

    def _set(self, row: np.void, scaled: ScaledQuantity) -> None:
        """Set the fields that the library reads for a scaled quantity."""
        quantity = QUANTITIES.index(scaled.quantity)
        joints = np.ascontiguousarray(scaled.joints, dtype="l")
        count = row["values"]
        if len(joints) and not 0 <= joints.min() <= joints.max() < scaled.chain.n:
            raise ValueError(f"a joint does not exist; there are {scaled.chain.n}")
        offsets = as_contiguous(scaled.offsets, (count,))
        factors = as_contiguous(scaled.factors, (count,))
        if joints.shape != (count,):
            raise ValueError("there must be as many joints as values")
        self._set_joints(scaled.chain.n)
        row["quantity"] = quantity
        row["joints"] = address(joints)
        row["offsets"] = address(offsets)
        row["factors"] = address(factors)
        self._arrays += [joints, offsets, factors]
        self.has_jerk |= scaled.quantity == "qdddot"
        if quantity == _TORQUE:
            if self.chain not in (None, scaled.chain):
                raise ValueError("torques belong to more than one chain")
            self.chain = scaled.chain

    def _set_joints(self, n: int) -> None:
        if self._joints not in (None, n):
            raise ValueError("the chains have different numbers of joints")
        self._joints = n

    def check_joints(self, n: int) -> None:
        """Raise an error for a different number of joints: the library would read beyond the ends of arrays."""
        if self._joints not in (None, n):
            raise ValueError(f"the motion has {n} joints; needed: {self._joints}")

    def split(self, values: np.ndarray, count: int) -> list[np.ndarray]:
        """Divide values at K points, stored group after group, into one array per group, (K, size)."""
        groups = zip(self._first, self._sizes, strict=False)
        return [
            values[count * first : count * (first + size)].reshape(count, size)
            for first, size in groups
        ]

    def values(
        self, states: Sequence[np.ndarray], torque: Partial = None
    ) -> list[np.ndarray]:
        """Compute the values of the groups that have a quantity.

        Parameters
        ----------
        states : sequence of (K, n) ndarray
            q, qdot and qddot, and also qdddot if a group needs it.
        torque : (K, n) ndarray, optional
            Torque, if a group needs it.

        Returns
        -------
        list of (K, size) ndarray
            Values of each group. The values of groups with partials are not set.
        """
        count, n = states[0].shape
        self.check_joints(n)
        if self.has_jerk and len(states) < _TORQUE:
            raise ValueError("a group needs qdddot")
        if self.chain is not None and torque is None:
            raise ValueError("a group needs the torque")
        arrays: list[np.ndarray] = []
        missing = [None] * (_TORQUE - len(states))
        quantities = (*states, *missing, torque)
        addresses = [hold_and_address(q, (count, n), arrays) for q in quantities]
        values = np.empty(count * self.size)
        of_states = (ctypes.c_void_p * len(QUANTITIES))(*addresses)
        table = self._table
        call("brachis_values", count, n, of_states, len(table), table, values)
        return self.split(values, count)

    def table_with(
        self,
        partials: Sequence[tuple[Sequence[Partial], Partial]],
        points: tuple[int, int],
        arrays: list[np.ndarray],
    ) -> np.ndarray:
        """Return the table that the library reads, including partials at K points of n joints; see `differentiate`.

        The arrays that are added to `arrays` must stay alive.
        """
        if not (self.with_partials or self._formulas):
            return self._table
        count, n = points
        table = self._table.copy()
        pairs = zip(self.with_partials, partials, strict=True)
        for number, (by_joints, by_s) in pairs:
            _set_partials(table[number], by_joints, by_s, points, arrays)
        for number in self._formulas:
            size = self._sizes[number]
            arrays.append(np.empty((count, size, n)))
            table[number]["q_at"] = address(arrays[-1])
            table[number]["q_step"] = size * n
        return table


def hold_and_address(
    values: Partial, shape: tuple[int, ...], arrays: list[np.ndarray]
) -> int | None:
    """Return the address of an array, or None. The array added to `arrays` must stay alive."""
    if values is None:
        return None
    arrays.append(as_contiguous(values, shape))
    return address(arrays[-1])


def _set_partials(
    row: np.void,
    by_joints: Sequence[Partial],
    by_s: Partial,
    points: tuple[int, int],
    arrays: list[np.ndarray],
) -> None:
    """Set the fields that the library reads for partials at K points of n joints; see `hold_and_address`."""
    count, n = points
    size = int(row["values"])
    for name, partial in zip(_PARTIAL, by_joints, strict=True):
        if partial is None:
            continue
        numbers, step = as_doubles_at_points(partial, (count, size, n))
        arrays.append(numbers)
        row[f"{name}_at"] = address(numbers)
        row[f"{name}_step"] = step
    row["s"] = hold_and_address(by_s, (count, size), arrays) or 0
