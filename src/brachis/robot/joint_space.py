"""Joint positions as points of a joint space: which joints are left, differences of angles, turns by 2 pi."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

TURN = 2.0 * np.pi


def complement(n: int, joints: Iterable[int]) -> list[int]:
    """Return the joints, out of n, that are not among `joints`, ascending."""
    left_out = set(joints)
    return [i for i in range(n) if i not in left_out]


def principal(angles: np.ndarray) -> np.ndarray:
    """Return angles in [-pi, pi)."""
    return np.asarray(np.remainder(angles + np.pi, TURN) - np.pi)


def difference(first: np.ndarray, second: np.ndarray, revolute: np.ndarray) -> np.ndarray:
    """Displacement (..., n) from `second` to `first`; of revolute joints, a mask (n,), the shortest, in [-pi, pi)."""
    gap = first - second
    return np.where(revolute, principal(gap), gap)


def in_turn_of(q: np.ndarray, near: np.ndarray, revolute: np.ndarray) -> np.ndarray:
    """Return positions (..., n) with every revolute joint in the turn that brings it nearest to `near`."""
    return np.where(revolute, q + TURN * np.round((near - q) / TURN), q)
