"""Slopes by curves from slopes by joints, and entries of a Jacobian; see `brachis.optimise.evaluator`."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from brachis.kernel.library import address, as_doubles, load


class _Partial(ctypes.Structure):
    """`partial` of chain_rule.c."""

    _fields_ = [("numbers", ctypes.c_void_p), ("step", ctypes.c_long)]


class _MotionSlopes(ctypes.Structure):
    """`motion_slopes` of chain_rule.c."""

    _fields_ = [
        (name, ctypes.c_void_p)
        for name in ("gradient", "qdot_y", "qddot_y", "qddot_ydot", "qdddot_y")
    ]


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
    shape = motion.gradient.shape
    count, n, width = shape
    asks_for_jerk = any(by_joints[3] is not None for by_joints, _ in partials)
    if asks_for_jerk and motion.qdddot_y is None:
        raise ValueError("partials by qdddot need qdddot_y")
    parts = vars(motion).values()
    kept = [None if own is None else as_doubles(own, shape) for own in parts]
    slopes = _MotionSlopes(*map(_address, kept))
    orders = 3 if motion.qdddot_y is None else 4
    table = np.empty((orders, count, sum(sizes), width))
    first = 0
    for (by_joints, by_s), size in zip(partials, sizes, strict=True):
        given = [_prepare(own, (count, size, n)) for own in by_joints]
        along = None if by_s is None else as_doubles(by_s, (count, size))
        structures = (_Partial * 4)(*(_Partial(*own[:2]) for own in given))
        load().brachis_chain_rule(
            count,
            size,
            n,
            width,
            ctypes.byref(structures),
            _address(along),
            ctypes.byref(slopes),
            orders,
            table.shape[2],
            first,
            address(table),
        )
        first += size
    return table


def _prepare(
    values: Partial, shape: tuple[int, ...]
) -> tuple[int | None, int, np.ndarray | None]:
    """Return where partials are, how far those of one point are from those of the next, and what keeps them alive."""
    if values is None:
        return None, 0, None
    is_constant = values.shape == shape and values.strides[0] == 0
    kept = (
        as_doubles(values[0], shape[1:]) if is_constant else as_doubles(values, shape)
    )
    return address(kept), 0 if is_constant else kept[0].size, kept


def _address(values: Partial) -> int | None:
    return None if values is None else address(values)


def find_entries(
    slopes: np.ndarray, curve: int, points: np.ndarray, basis: np.ndarray
) -> np.ndarray:
    """Entries of a Jacobian, (z, c), of variables that each matter at one point.

    Parameters
    ----------
    slopes : (orders, K, c, width) ndarray
        As of `apply_chain_rule`.
    curve : int
        To which the variables belong.
    points : (z,) int64 ndarray
    basis : (orders, z) ndarray
        Slopes of the curve and its time derivatives by the variables.
    """
    orders, count, columns, width = slopes.shape
    if len(points) and not 0 <= points.min() <= points.max() < count:
        raise ValueError("a point does not exist")
    if not 0 <= curve < width:
        raise ValueError(f"curve {curve} does not exist; there are {width}")
    table = as_doubles(slopes, slopes.shape)
    kept = np.ascontiguousarray(points, dtype="l")
    factors = as_doubles(basis, (orders, len(points)))
    found = np.empty((len(points), columns))
    load().brachis_entries(
        orders,
        count,
        columns,
        width,
        address(table),
        curve,
        len(points),
        address(kept),
        address(factors),
        address(found),
    )
    return found
