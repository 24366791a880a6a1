"""From the roots q_a, p and theta to joints that have been put to the test; see `polynomial` for the formulas."""

from __future__ import annotations

import numpy as np

from brachis.arrays import cross
from brachis.ik.displacement import Displacement
from brachis.ik.vectors import angle_about, apply, apply_inverse, dot, meeting_point, rotate

_SAME = 1e-6
"""Roots whose q_a and theta (rad) and p (relative) differ by less are the same."""


def joints_of_roots(equation: Displacement, turn: int, roots: np.ndarray) -> np.ndarray:
    """All six joints (6, K) in their order, angles of any lift, from q_a, p and theta, (3, K).

    `turn` is the place of a, 0 or 1; the parallel axes are at 2 and 3, the meeting ones at 4 and 5.
    """
    angle, slide, theta = roots
    axes, points, rotation = equation.axes, equation.points, equation.rotation
    a, n, u, v = (axes[:, i] for i in (turn, 2, 4, 5))
    wrist = meeting_point(u, points[:, 4], v, points[:, 5])
    moved, rail = equation.moved(wrist), axes[:, 1 - turn] * slide
    if turn == 1:
        moved = moved - rail
    moved = points[:, turn] + rotate(a, -angle, moved - points[:, turn])
    if turn == 0:
        moved = moved - rail
    first = angle_about(n, points[:, 3] - points[:, 2], moved - points[:, 2] - rotate(n, theta, wrist - points[:, 3]))
    second = np.sign(dot(n, axes[:, 3])) * (theta - first)
    forth = rotate(n, -theta, rotate(a, -angle, apply(rotation, v)))
    back = apply_inverse(rotation, rotate(a, angle, rotate(n, theta, u)))
    before = (angle, slide) if turn == 0 else (slide, angle)
    return np.stack([*before, first, second, angle_about(u, v, forth), angle_about(v, back, u)])


def put_to_test(equation: Displacement, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Let six joints (6, K) move.

    Returns
    -------
    miss : (K,) ndarray
        Largest difference between their displacement and D, in the rotation matrix and the translation (m).
    determinant : (K,) ndarray
        Det J_nr.
    """
    count = joints.shape[1]
    rows = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, count))
    offset, columns = np.zeros((3, count)), np.zeros((6, 6, count))
    for i in range(6):
        axis = dot(rows, equation.axes[:, i, None])
        if not equation.revolute[i]:
            columns[:3, i] = axis
            offset = offset + axis * joints[i]
            continue
        point = equation.points[:, i, None]
        place = offset + dot(rows, point)
        columns[:3, i], columns[3:, i] = cross(place, axis), axis
        rows = rotate(-equation.axes[:, i, None], joints[i], rows)
        offset = place - dot(rows, point)
    turned = np.abs(np.swapaxes(rows, 0, 1) - equation.rotation).max(axis=(0, 1))
    shifted = np.abs(offset - equation.translation).max(axis=0)
    return np.maximum(turned, shifted), np.linalg.det(np.moveaxis(columns, 2, 0))


def distinct(sample: np.ndarray, roots: np.ndarray, negative: np.ndarray, miss: np.ndarray) -> np.ndarray:
    """Drop repetitions within a sample and sign, but for the one that misses least; return the indices of the rest."""
    order = np.lexsort((miss, negative, sample))
    group = 2 * sample[order] + negative[order]
    angle, slide, theta = roots[:, order]
    marks = np.stack([np.cos(angle), np.sin(angle), np.cos(theta), np.sin(theta), slide / (1.0 + np.abs(slide))])
    repeated, earlier = np.zeros(len(order), dtype=bool), np.arange(len(order))
    for ahead in range(1, len(order)):
        earlier = earlier[earlier + ahead < len(order)]
        earlier = earlier[group[earlier] == group[earlier + ahead]]
        if len(earlier) == 0:
            break
        gap = np.abs(marks[:, earlier] - marks[:, earlier + ahead]).max(axis=0)
        repeated[earlier[gap < _SAME] + ahead] = True
    return order[~repeated]


def in_slots(
    count: int, each: int, sample: np.ndarray, angle: np.ndarray, negative: np.ndarray, joints: np.ndarray
) -> np.ndarray:
    """Answers (count, 2 each, 6): those of positive sign before those of negative sign, by ascending angle."""
    order = np.lexsort((angle, negative, sample))
    sample, negative = sample[order], negative[order]
    rank = _ranks(2 * sample + negative)
    fits = rank < each
    answers = np.full((count, 2 * each, 6), np.nan)
    answers[sample[fits], negative[fits] * each + rank[fits]] = joints[:, order[fits]].T
    return answers


def _ranks(ascending: np.ndarray) -> np.ndarray:
    """How many equal numbers there are before each."""
    return np.arange(len(ascending)) - np.searchsorted(ascending, ascending)
