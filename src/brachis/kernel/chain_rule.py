"""Slopes by curves from slopes by joints, and entries of a Jacobian; see `brachis.optimise.evaluator`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.kernel.library import address, as_doubles, load


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
    asks_for_jerk = any(by_joints[3] is not None for by_joints, _ in partials)
    if asks_for_jerk and motion.qdddot_y is None:
        raise ValueError("partials by qdddot need qdddot_y")
    kept: list[np.ndarray] = []
    groups = []
    for (by_joints, by_s), size in zip(partials, sizes, strict=True):
        of_joints = [_place_partials(own, (count, size, n), kept) for own in by_joints]
        along = _place(by_s, (count, size), kept)
        groups.append([*itertools.chain.from_iterable(of_joints), along, size])
    parts = [_place(own, (count, n, width), kept) for own in vars(motion).values()]
    # As `group` and `motion_slopes` of chain_rule.c are in memory.
    own_groups = np.array(groups, dtype=np.int64)
    slopes = np.array(parts, dtype=np.int64)
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
    """Return where numbers are, 0 where there are none; what is added to `kept` has to stay alive."""
    if values is None:
        return 0
    kept.append(as_doubles(values, shape))
    return address(kept[-1])


def _place_partials(
    values: Partial, shape: tuple[int, ...], kept: list[np.ndarray]
) -> tuple[int, int]:
    """Return the same, and how far the numbers of one point are from those of the next."""
    is_constant = values is not None and values.strides[0] == 0 and shape[0] > 1
    if is_constant and values is not None and values.shape == shape:
        return _place(values[0], shape[1:], kept), 0
    return _place(values, shape, kept), math.prod(shape[1:])


def find_entries(
    slopes: np.ndarray,
    every: np.ndarray,
    points: np.ndarray,
    curves: np.ndarray,
    basis: np.ndarray,
) -> np.ndarray:
    """Entries of a Jacobian, (b K + z, c), of what moves all curves, and of what moves one of them at one point.

    Parameters
    ----------
    slopes : (orders, K, c, width) ndarray
        As of `apply_chain_rule`.
    every : (b, orders, K, width) ndarray
        Slopes of the curves and their time derivatives, at every point, by what moves all of them.
    points, curves : (z,) int64 ndarray
        Where the others matter.
    basis : (orders, z) ndarray
        Slopes of the curve and its time derivatives by them.
    """
    orders, count, columns, width = slopes.shape
    for numbers, most, name in (points, count, "point"), (curves, width, "curve"):
        if len(numbers) and not 0 <= numbers.min() <= numbers.max() < most:
            raise ValueError(f"a {name} does not exist; there are {most}")
    broad = len(every)
    entries = len(points)
    table = as_doubles(slopes, slopes.shape)
    factors = as_doubles(every, (broad, orders, count, width))
    places = [np.ascontiguousarray(own, dtype="l") for own in (points, curves)]
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
