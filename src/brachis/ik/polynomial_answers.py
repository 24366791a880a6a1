"""From the roots q_a, p and theta to joints; see `polynomial` for the formulas."""

from __future__ import annotations

import numpy as np

from brachis.ik.displacement import Displacement
from brachis.ik.vectors import (
    angle_about,
    apply,
    apply_inverse,
    dot,
    meeting_point,
    rotate,
)


def joints_of_roots(equation: Displacement, turn: int, roots: np.ndarray) -> np.ndarray:
    """All six joints (6, K) in their order, angles of any turn, from q_a, p and theta, (3, K).

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
    first = angle_about(
        n,
        points[:, 3] - points[:, 2],
        moved - points[:, 2] - rotate(n, theta, wrist - points[:, 3]),
    )
    second = np.sign(dot(n, axes[:, 3])) * (theta - first)
    forth = rotate(n, -theta, rotate(a, -angle, apply(rotation, v)))
    back = apply_inverse(rotation, rotate(a, angle, rotate(n, theta, u)))
    before = (angle, slide) if turn == 0 else (slide, angle)
    return np.stack(
        [*before, first, second, angle_about(u, v, forth), angle_about(v, back, u)]
    )
