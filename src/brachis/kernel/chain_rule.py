"""Slopes by curves from slopes by joints, and entries of a Jacobian; see `brachis.optimise.evaluator`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.kernel.library import address, as_doubles, load

_PARTIAL = (("numbers", np.intp), ("step", "l"))
"""`partial` of chain_rule.c."""


@dataclass(frozen=True, eq=False)
class MotionSlopes:
    """Derivatives of a joint motion at K points by c curves, (K, n, c) each; see `brachis.kinematics.JointDerivatives`.

    Attributes
    ----------
    gradient, qdot_y, qddot_y, qddot_ydot : (K, n, c) ndarray
    qdddot_y : (K, n, c) ndarray or None
        Where a value depends on the jerk.
    """

    gradient: np.ndarray
    qdot_y: np.ndarray
    qddot_y: np.ndarray
    qddot_ydot: np.ndarray
    qdddot_y: np.ndarray | None = None


Partial = np.ndarray | None
_PARTS = ("q", "qdot", "qddot", "qdddot")
_GROUP = np.dtype(
    [
        *((f"{part}_{name}", kind) for part in _PARTS for name, kind in _PARTIAL),
        ("s", np.intp),
        ("values", "l"),
    ]
)
"""`group` of chain_rule.c."""


def apply_chain_rule(
    partials: Sequence[tuple[Sequence[Partial], Partial]],
    sizes: Sequence[int],
    motion: MotionSlopes,
) -> np.ndarray:
    """Differentiate values by the curves and their time derivatives.

    Parameters
    ----------
    partials : sequence of (sequence of ndarray or None, ndarray or None)
        Of groups of values, (K, size, n), by q, qdot, qddot and qdddot, and (K, size) by the first curve.
    sizes : sequence of int
        Numbers of values in the groups.
    motion : MotionSlopes

    Returns
    -------
    (3 or 4, K, sum of sizes, c) ndarray
        Slopes by y, ydot, yddot and, with `qdddot_y`, ydddot.
    """
    count, n, width = motion.gradient.shape
    asks_for_jerk = any(by_joints[-1] is not None for by_joints, _ in partials)
    if asks_for_jerk and motion.qdddot_y is None:
        raise ValueError("partials by qdddot need qdddot_y")
    kept: list[np.ndarray] = []
    groups = []
    for (by_joints, by_s), size in zip(partials, sizes, strict=True):
        places = [_place_partials(own, (count, size, n), kept) for own in by_joints]
        along = _place(by_s, (count, size), kept)
        groups.append((*itertools.chain.from_iterable(places), along, size))
    own_groups = np.array(groups, dtype=_GROUP)
    slopes = np.array(
        [_place(own, (count, n, width), kept) for own in vars(motion).values()],
        dtype=np.intp,
    )
    orders = 3 if motion.qdddot_y is None else 4
    table = np.empty((orders, count, sum(sizes), width))
    load().brachis_chain_rule(
        count,
        n,
        width,
        len(groups),
        address(own_groups),
        address(slopes),
        orders,
        table.shape[2],
        address(table),
    )
    return table


def _place(values: Partial, shape: tuple[int, ...], kept: list[np.ndarray]) -> int:
    """Return where numbers are, 0 without any; what is added to `kept` has to stay alive."""
    if values is None:
        return 0
    kept.append(as_doubles(values, shape))
    return address(kept[-1])


def _place_partials(
    values: Partial, shape: tuple[int, ...], kept: list[np.ndarray]
) -> tuple[int, int]:
    """Return where partials are, and how far those of one point are from those of the next; see `_place`."""
    if values is None:
        return 0, 0
    is_constant = values.strides[0] == 0 and shape[0] > 1
    if is_constant and values.shape == shape:
        return _place(values[0], shape[1:], kept), 0
    return _place(values, shape, kept), math.prod(shape[1:])


def find_entries(
    slopes: np.ndarray,
    shared: np.ndarray,
    points: np.ndarray,
    curves: np.ndarray,
    basis: np.ndarray,
) -> np.ndarray:
    """Entries of a Jacobian, (b K + z, c): first of b variables that move all curves, then of variables of one curve.

    Parameters
    ----------
    slopes : (orders, K, c, width) ndarray
        As of `apply_chain_rule`.
    shared : (b, orders, K, width) ndarray
        Slopes of the curves and their time derivatives by the b variables, at all points.
    points, curves : (z,) int64 ndarray
        At which point the others matter, and for which curve.
    basis : (orders, z) ndarray
        Slopes of this curve and its time derivatives by them.
    """
    orders, count, columns, width = slopes.shape
    if not points.shape == curves.shape == basis.shape[1:]:
        raise ValueError("points, curves and basis are not as many")
    for numbers, most, name in (points, count, "point"), (curves, width, "curve"):
        if len(numbers) and not 0 <= numbers.min() <= numbers.max() < most:
            raise ValueError(f"a {name} does not exist; there are {most}")
    broad = len(shared)
    entries = len(points)
    table = as_doubles(slopes, slopes.shape)
    factors = as_doubles(shared, (broad, orders, count, width))
    places = [
        own.astype("l", order="C", casting="same_kind", copy=False)
        for own in (points, curves)
    ]
    own_basis = as_doubles(basis, (orders, entries))
    found = np.empty((broad * count + entries, columns))
    load().brachis_entries(
        orders,
        count,
        columns,
        width,
        address(table),
        broad,
        address(factors),
        entries,
        *map(address, places),
        address(own_basis),
        address(found),
    )
    return found
