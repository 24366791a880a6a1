"""Values of limits in groups: quantities of joints, whose slopes the kernel knows, and all others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.kernel.chain import Chain
from brachis.kernel.library import (
    WHOLE,
    address,
    as_contiguous,
    as_doubles_at_points,
)

QUANTITIES = ("q", "qdot", "qddot", "qdddot", "torque")
"""In the order of motion.h."""
_JERK = QUANTITIES.index("qdddot")
_TORQUE = QUANTITIES.index("torque")
_PARTIAL = ("q", "qdot", "qddot", "qdddot")
_GROUP = np.dtype(
    [
        ("values", "l"),
        ("quantity", "l"),
        ("joints", np.intp),
        ("factors", np.intp),
        *((f"{name}_{part}", "l") for name in _PARTIAL for part in ("at", "step")),
        ("s", np.intp),
    ]
)
"""`group` of motion.h."""

Partial = np.ndarray | None


@dataclass(frozen=True, eq=False)
class ScaledQuantity:
    """Values that are each a quantity of one joint, less a constant, times a factor.

    Attributes
    ----------
    quantity : str
        One of `QUANTITIES`.
    joints : (c,) int ndarray
    factors : (c,) ndarray
    chain : Chain
        Of the joints.
    """

    quantity: str
    joints: np.ndarray
    factors: np.ndarray
    chain: Chain


class ValueGroups:
    """Groups of values of a joint motion.

    Parameters
    ----------
    quantities : sequence of ScaledQuantity or None
        Groups of which nothing is given here have partials.
    sizes : sequence of int
        How many values are in each.

    Attributes
    ----------
    chain : Chain or None
        Of the quantities; None where there are none.
    has_jerk, has_torque : bool
        Whether a quantity is a jerk, or a torque.
    with_partials : list of int
        Numbers of the groups that have partials.
    size : int
        Number of all values.
    """

    def __init__(
        self, quantities: Sequence[ScaledQuantity | None], sizes: Sequence[int]
    ) -> None:
        self._quantities = tuple(quantities)
        self._sizes = tuple(sizes)
        self._kept: list[np.ndarray] = []
        self._table = np.zeros(len(self._sizes), dtype=_GROUP)
        self._table["values"] = self._sizes
        self._table["quantity"] = -1
        self.size = sum(self._sizes)
        self.chain: Chain | None = None
        self.with_partials = []
        for number, quantity in enumerate(self._quantities):
            if quantity is None:
                self.with_partials.append(number)
            else:
                self._set(self._table[number], quantity)
        kinds = self._table["quantity"]
        self.has_jerk = _JERK in kinds
        self.has_torque = _TORQUE in kinds

    def __reduce__(self) -> tuple[type[ValueGroups], tuple[Any, ...]]:
        """Leave addresses behind."""
        return ValueGroups, (self._quantities, self._sizes)

    def _set(self, row: np.void, own: ScaledQuantity) -> None:
        """Set what the library reads of a scaled quantity."""
        shape = (int(row["values"]),)
        joints = as_contiguous(own.joints, shape, WHOLE)
        factors = as_contiguous(own.factors, shape)
        if len(joints) and not 0 <= joints.min() <= joints.max() < own.chain.n:
            raise ValueError(f"a joint does not exist; there are {own.chain.n}")
        if self.chain not in (None, own.chain):
            raise ValueError("quantities are of more than one chain")
        self.chain = own.chain
        row["quantity"] = QUANTITIES.index(own.quantity)
        row["joints"] = address(joints)
        row["factors"] = address(factors)
        self._kept += [joints, factors]

    def check_joints(self, n: int) -> None:
        """Refuse a motion of another number of joints: the library would read beyond its end."""
        if self.chain is not None and self.chain.n != n:
            raise ValueError(f"the motion has {n} joints; needed: {self.chain.n}")

    def table_with(
        self,
        partials: Sequence[tuple[Sequence[Partial], Partial]],
        points: tuple[int, int],
        kept: list[np.ndarray],
    ) -> np.ndarray:
        """Return what the library reads, with partials at K points of n joints; see `differentiate`.

        What is added to `kept` has to stay alive.
        """
        if not self.with_partials:
            return self._table
        table = self._table.copy()
        pairs = zip(self.with_partials, partials, strict=True)
        for number, (by_joints, by_s) in pairs:
            _set_partials(table[number], by_joints, by_s, points, kept)
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
