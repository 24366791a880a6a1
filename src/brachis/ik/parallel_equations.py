"""The equations around three parallel axes, solved for K samples at once; see `parallel_axes` for the formulas."""

from __future__ import annotations

import numpy as np

from brachis.arrays import cross
from brachis.ik.displacement import Displacement
from brachis.ik.parallel_chain import ParallelChain
from brachis.ik.vectors import (
    across,
    angle_about,
    apply,
    apply_inverse,
    cosine_roots,
    dot,
    meeting_point,
    perpendiculars,
    rotate,
)


class ParallelEquations:
    """K equations E_1 ... E_6 = D, and the joints that have been solved for so far.

    Arrays end in (shoulder, wrist, K), the slots being one where there is nothing to choose, and the solved joints in
    (shoulder, elbow, wrist, K). Positions count from a point on the axis a. `frame` is n and two vectors perpendicular
    to it, `turned` the same as a turns them, both (3, 3 vectors, ...).
    """

    def __init__(self, chain: ParallelChain, equation: Displacement) -> None:
        self._chain = chain
        self._equation = equation
        self._origin = equation.points[:, chain.first if chain.turn is None else chain.turn]
        self._axes = _slots(equation.axes)
        self._points = _slots(equation.points - self._origin[:, None])
        self._rotation = _slots(equation.rotation)
        self._n = self._axes[:, chain.first]
        self._frame = self._turned = np.stack([self._n, *perpendiculars(self._n)], axis=1)
        self._joints: dict[int, np.ndarray] = {}

    def solve(self) -> tuple[np.ndarray, np.ndarray]:
        """Solve for all joints.

        Returns
        -------
        joints : (6, shoulder, elbow, wrist, K) ndarray
            In their order.
        along : (shoulder, 1, wrist, K) or (1, 1, 1, K) ndarray
            Rate n . s at which p moves the arm along the parallel axes, as a has turned it; one without p.
        """
        turn, one_after = self._chain.turn, len(self._chain.after) == 1
        fixed, image = self._one_after(turn) if one_after and turn is not None else self._two_after(turn)
        place, along = self._slide(fixed, self._moved(fixed))
        self._parallel(fixed, place, image)
        return np.stack(np.broadcast_arrays(*(self._joints[i] for i in range(6)))), along

    def _moved(self, position: np.ndarray) -> np.ndarray:
        """Apply D to a position."""
        return _slots(self._equation.moved(position[:, 0, 0] + self._origin) - self._origin)

    def _two_after(self, turn: int | None) -> tuple[np.ndarray, np.ndarray]:
        """Solve for e, f and, if there is one, a; return P and R_D R_post^T e."""
        e, f, n = self._axes[:, 4], self._axes[:, 5], self._n
        fixed = meeting_point(e, self._points[:, 4], f, self._points[:, 5])
        if turn is not None:
            rising, falling = _turns(-self._axes[:, turn], self._moved(fixed), n, dot(n, fixed))
            self._turn(turn, np.concatenate([falling, rising], axis=0))
        y = apply_inverse(self._rotation, self._turned[:, 0])
        last = np.concatenate(_turns(f, y, e, dot(e, n)), axis=1)
        self._joints[5] = last[..., None, :, :]
        self._joints[4] = angle_about(e, rotate(f, last, y), n)[..., None, :, :]
        return fixed, apply(self._rotation, rotate(f, -last, e))

    def _one_after(self, turn: int) -> tuple[np.ndarray, np.ndarray]:
        """Solve for w and a; return P and R_D w, as R_post leaves w in place."""
        a, w, n = self._axes[:, turn], self._axes[:, 5], self._n
        rising, falling = _turns(-w, n, apply_inverse(self._rotation, a), dot(a, n))
        last = np.concatenate([falling, rising], axis=1)
        self._joints[5] = last[..., None, :, :]
        self._turn(turn, angle_about(a, n, apply(self._rotation, rotate(w, -last, n))))
        return self._points[:, 5], apply(self._rotation, w)

    def _turn(self, turn: int, angle: np.ndarray) -> None:
        """Keep the joint a, and the frame as a turns it."""
        self._joints[turn] = angle[..., None, :, :]
        self._turned = rotate(self._axes[:, turn, None], angle, self._frame)

    def _slide(self, fixed: np.ndarray, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Solve for p; return G P in the frame's components, and n . s."""
        place, slide = dot(self._turned, moved[:, None]), self._chain.slide
        if slide is None:
            return place, np.ones((1, 1, 1, 1))
        s = dot(self._turned if self._chain.slide_first else self._frame, self._axes[:, slide, None])
        way = (place[0] - dot(self._n, fixed)) / s[0]
        self._joints[slide] = way[..., None, :, :]
        return place - way * s, s[0][..., None, :, :]

    def _parallel(self, fixed: np.ndarray, place: np.ndarray, image: np.ndarray) -> None:
        """Solve for b, c and d, in the plane perpendicular to n with its vectors as complex numbers."""
        first = self._chain.first
        plane = self._frame[:, 1] + 1j * self._frame[:, 2]
        turned = self._turned[:, 1] + 1j * self._turned[:, 2]
        b, c, d = (dot(plane, self._points[:, first + k]) for k in range(3))
        turn = dot(turned, image) / dot(plane, self._axes[:, first + 3])
        reach = (place[1] + 1j * place[2] - b + turn * (d - dot(plane, fixed)))[..., None, :, :]
        upper, lower = c - b, d - c
        corner = np.conj(upper) * lower
        sense_c, sense_d = (np.sign(dot(self._n, self._axes[:, first + k])) for k in (1, 2))
        level = 0.5 * (_square(reach) - _square(upper) - _square(lower))
        elbow = np.concatenate(cosine_roots(corner.real, -sense_c * corner.imag, level), axis=-3)
        inner = sense_c * elbow
        outer = np.angle(reach / (upper + np.exp(1j * inner) * lower))
        self._joints[first] = outer
        self._joints[first + 1] = elbow
        self._joints[first + 2] = sense_d * (np.angle(turn)[..., None, :, :] - outer - inner)


def _slots(array: np.ndarray) -> np.ndarray:
    """Make room for the slots of shoulder and wrist before the samples."""
    return array[..., None, None, :]


def _square(vector: np.ndarray) -> np.ndarray:
    """Squared lengths of vectors of the plane."""
    return vector.real**2 + vector.imag**2


def _turns(
    axis: np.ndarray, vector: np.ndarray, direction: np.ndarray, level: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Angles about an axis by which a vector reaches a level along a direction: rising and falling."""
    lever = across(axis, vector)
    rest = dot(direction, vector - lever)
    return cosine_roots(dot(direction, lever), dot(direction, cross(axis, lever)), level - rest)
