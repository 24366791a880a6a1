"""Values of limits in groups: quantities of joints and formulas, which the kernel computes, and all others."""

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
"""In the order of motion.h."""
_TORQUE = len(QUANTITIES) - 1
_FORMULA = len(QUANTITIES)
_PARTIAL = ("q", "qdot", "qddot", "qdddot")
_OF_VALUES = ("joints", "offsets", "factors", "values_of", "slopes_of")
_GROUP = np.dtype(
    [
        ("values", "l"),
        ("quantity", "l"),
        *((name, np.intp) for name in _OF_VALUES),
        *((f"{name}_{part}", "l") for name in _PARTIAL for part in ("at", "step")),
        ("s", np.intp),
    ]
)
"""`group` of motion.h."""

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
class FormulaQuantity:
    """Values that are numbers of a formula of the posture times a factor.

    Attributes
    ----------
    values_of : Formula
        Of q, with c results.
    slopes_of : Formula
        Of q, with (c, n) results: their slopes by q.
    factors : (c,) ndarray
    """

    values_of: Formula
    slopes_of: Formula
    factors: np.ndarray


Quantity = ScaledQuantity | FormulaQuantity
"""What the kernel computes by itself."""


class ValueGroups:
    """Groups of values of a joint motion.

    Parameters
    ----------
    quantities : sequence of ScaledQuantity, FormulaQuantity or None
        Groups of which nothing is given here have partials.
    sizes : sequence of int
        How many values are in each.

    Attributes
    ----------
    chain : Chain or None
        Of which torques are; None where no group needs them.
    has_jerk : bool
        Whether a quantity is a jerk.
    with_partials : list of int
        Numbers of the groups that have partials.
    size : int
        Number of all values.
    """

    def __init__(
        self, quantities: Sequence[Quantity | None], sizes: Sequence[int]
    ) -> None:
        self._quantities = tuple(quantities)
        self._sizes = tuple(sizes)
        self._kept: list[np.ndarray] = []
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
            number for number, own in enumerate(quantities) if own is None
        ]
        for number, own in enumerate(quantities):
            if isinstance(own, FormulaQuantity):
                self._set_formula(number, own)
            elif own is not None:
                self._set(self._table[number], own)

    def __reduce__(self) -> tuple[type[ValueGroups], tuple[Any, ...]]:
        """Leave addresses behind."""
        return ValueGroups, (self._quantities, self._sizes)

    def _set_formula(self, number: int, own: FormulaQuantity) -> None:
        """Set what the library reads of a formula."""
        row = self._table[number]
        size = int(row["values"])
        (n,) = own.values_of.counts
        found = (own.values_of.shape, own.slopes_of.shape, own.slopes_of.counts)
        if found != ((size,), (size, n), (n,)):
            raise ValueError(f"the formulas of {size} values have the shapes {found}")
        factors = as_contiguous(own.factors, (size,))
        self._set_joints(n)
        self._kept.append(factors)
        self._formulas.append(number)
        row["quantity"] = _FORMULA
        row["factors"] = address(factors)
        row["values_of"] = own.values_of.address
        row["slopes_of"] = own.slopes_of.address

    def _set(self, row: np.void, own: ScaledQuantity) -> None:
        """Set what the library reads of a scaled quantity."""
        quantity = QUANTITIES.index(own.quantity)
        joints = np.ascontiguousarray(own.joints, dtype="l")
        count = row["values"]
        if len(joints) and not 0 <= joints.min() <= joints.max() < own.chain.n:
            raise ValueError(f"a joint does not exist; there are {own.chain.n}")
        offsets = as_contiguous(own.offsets, (count,))
        factors = as_contiguous(own.factors, (count,))
        if joints.shape != (count,):
            raise ValueError("joints are not as many as values")
        self._set_joints(own.chain.n)
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

    def _set_joints(self, n: int) -> None:
        if self._joints not in (None, n):
            raise ValueError("the chains have different numbers of joints")
        self._joints = n

    def check_joints(self, n: int) -> None:
        """Refuse a motion of another number of joints: the library would read beyond its end."""
        if self._joints not in (None, n):
            raise ValueError(f"the motion has {n} joints; needed: {self._joints}")

    def split(self, found: np.ndarray, count: int) -> list[np.ndarray]:
        """Divide values of K points, of one group behind the other, into (K, size) of each group."""
        parts = zip(self._first, self._sizes, strict=False)
        return [
            found[count * first : count * (first + size)].reshape(count, size)
            for first, size in parts
        ]

    def values(
        self, states: Sequence[np.ndarray], torque: Partial = None
    ) -> list[np.ndarray]:
        """Compute the values of quantities.

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
        self.check_joints(n)
        if self.has_jerk and len(states) < _TORQUE:
            raise ValueError("a group needs qdddot")
        if self.chain is not None and torque is None:
            raise ValueError("a group needs the torque")
        kept: list[np.ndarray] = []
        nothing = [None] * (_TORQUE - len(states))
        given = (*states, *nothing, torque)
        addresses = [keep_address(own, (count, n), kept) for own in given]
        found = np.empty(count * self.size)
        of_states = (ctypes.c_void_p * len(QUANTITIES))(*addresses)
        table = self._table
        call("brachis_values", count, n, of_states, len(table), table, found)
        return self.split(found, count)

    def table_with(
        self,
        partials: Sequence[tuple[Sequence[Partial], Partial]],
        points: tuple[int, int],
        kept: list[np.ndarray],
    ) -> np.ndarray:
        """Return what the library reads, with partials at K points of n joints; see `differentiate`.

        What is added to `kept` has to stay alive.
        """
        if not (self.with_partials or self._formulas):
            return self._table
        count, n = points
        table = self._table.copy()
        pairs = zip(self.with_partials, partials, strict=True)
        for number, (by_joints, by_s) in pairs:
            _set_partials(table[number], by_joints, by_s, points, kept)
        for number in self._formulas:
            size = self._sizes[number]
            kept.append(np.empty((count, size, n)))
            table[number]["q_at"] = address(kept[-1])
            table[number]["q_step"] = size * n
        return table


def keep_address(
    values: Partial, shape: tuple[int, ...], kept: list[np.ndarray]
) -> int | None:
    """Return where numbers are, None without any; what is added to `kept` has to stay alive."""
    if values is None:
        return None
    kept.append(as_contiguous(values, shape))
    return address(kept[-1])


def _set_partials(
    row: np.void,
    by_joints: Sequence[Partial],
    by_s: Partial,
    points: tuple[int, int],
    kept: list[np.ndarray],
) -> None:
    """Set what the library reads of partials at K points of n joints; see `keep_address`."""
    count, n = points
    size = int(row["values"])
    for name, partial in zip(_PARTIAL, by_joints, strict=True):
        if partial is None:
            continue
        own, step = as_doubles_at_points(partial, (count, size, n))
        kept.append(own)
        row[f"{name}_at"] = address(own)
        row[f"{name}_step"] = step
    row["s"] = keep_address(by_s, (count, size), kept) or 0
