"""The equations for q_a, p and theta, their resultant and their common roots; see `polynomial` for the formulas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.common.arrays import cross
from brachis.ik.displacement import Displacement
from brachis.ik.vectors import apply, dot, meeting_point, perpendiculars

_ROUNDS = 6
_STEPS = 2
"""Newton's method: after each round of steps the roots that are exact are left alone."""
_EXACT = 1e-9
_LONGEST_STEP = 0.3
_CREDIBLE = 1e-2
_SMALL = 1e-2


@dataclass(frozen=True)
class Terms:
    """What the equations are made of at some q_a, or its derivatives; all are (...) ndarrays.

    Attributes
    ----------
    alpha, level : ndarray
        Of the first equation, ``Re(alpha E) = level``; alpha is complex.
    rate, way : ndarray
        Of the second one, ``rate p = way``.
    place, slide : ndarray
        Of the third one, ``z(V - X) = place - p slide``, complex.
    """

    alpha: np.ndarray
    level: np.ndarray
    rate: np.ndarray
    way: np.ndarray
    place: np.ndarray
    slide: np.ndarray

    @classmethod
    def of(cls, stacked: np.ndarray) -> Terms:
        """Take apart a complex array (6, ...)."""
        alpha, level, rate, way, place, slide = stacked
        return cls(alpha, level.real, rate.real, way.real, place, slide)


@dataclass(frozen=True)
class Equations:
    """K times three equations for q_a, p and theta.

    Attributes
    ----------
    harmonics : (3, 6, K) complex ndarray
        Terms: constant part, factor of cos q_a, factor of sin q_a.
    arm, lever : (K,) complex ndarray
        z(Y - X) and z(W - Y).
    """

    harmonics: np.ndarray
    arm: np.ndarray
    lever: np.ndarray

    @classmethod
    def of(cls, equation: Displacement, turn: int, slide: int) -> Equations:
        """State the equations; `turn` and `slide` are the places of a and p, which are 0 and 1."""
        axes, points = equation.axes, equation.points
        a, n, u, v = (axes[:, i] for i in (turn, 2, 4, 5))
        base, start, middle = (points[:, i] for i in (turn, 2, 3))
        wrist = meeting_point(u, points[:, 4], v, points[:, 5])
        frame = np.stack([n, *perpendiculars(n)], axis=1)
        plane = frame[:, 1] + 1j * frame[:, 2]
        direction = _turned_back(a, frame, apply(equation.rotation, v))
        position = _turned_back(a, frame, equation.moved(wrist) - base)
        position[0] += dot(frame, (base - start)[:, None])
        rail = _turned_back(a, frame, axes[:, slide])
        if slide > turn:
            rail[0], rail[1:] = dot(frame, axes[:, slide, None]), 0.0
        level, way = -dot(n, u) * direction[:, 0], position[:, 0].copy()
        level[0] += dot(u, v)
        way[0] -= dot(n, wrist - start)
        alpha = dot(plane, u) * np.conj(_flat(direction))
        harmonics = np.stack(
            [alpha, level, rail[:, 0], way, _flat(position), _flat(rail)], axis=1
        )
        return cls(harmonics, dot(plane, middle - start), dot(plane, wrist - middle))

    def __getitem__(self, samples: np.ndarray) -> Equations:
        """Return some of the K."""
        return Equations(
            np.take(self.harmonics, samples, axis=2),
            self.arm[samples],
            self.lever[samples],
        )

    def terms(self, angle: np.ndarray) -> Terms:
        """Terms at angles (..., K)."""
        h = self.harmonics.reshape(3, 6, *[1] * (angle.ndim - 1), -1)
        return Terms.of(h[0] + h[1] * np.cos(angle) + h[2] * np.sin(angle))

    def _rates(self, angle: np.ndarray) -> Terms:
        """Differentiate the terms with respect to q_a at angles (K,)."""
        return Terms.of(
            self.harmonics[2] * np.cos(angle) - self.harmonics[1] * np.sin(angle)
        )

    def _distance(self, terms: Terms) -> tuple[np.ndarray, np.ndarray]:
        """Beta and right side of the third equation without p, times the square of the rate: ``Re(beta E) = right``."""
        scaled = terms.rate * terms.place - terms.way * terms.slide
        right = _square(scaled) + terms.rate**2 * (
            _square(self.lever) - _square(self.arm)
        )
        return 2.0 * terms.rate * self.lever * np.conj(scaled), right

    def resultant(self, angles: np.ndarray) -> np.ndarray:
        """Trigonometric polynomial F at angles (S,): (S, K)."""
        terms = self.terms(angles[:, None])
        beta, right = self._distance(terms)
        return (
            _square(right * terms.alpha - terms.level * beta)
            - (terms.alpha * np.conj(beta)).imag ** 2
        )

    def guesses(self, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Guess solutions for q_a, (K,), which are roots of the resultant but for rounding.

        Returns
        -------
        which : (M,) ndarray of int
            Of the K.
        roots : (3, M) ndarray
            q_a, p and theta.
        """
        terms = self.terms(angle)
        beta, right = self._distance(terms)
        # The first and the third equation have two roots theta each: those of the first are taken that the third one
        # believes. Where alpha is small, those of the third are better. Where the rail hardly moves the wrist along n,
        # way, rate and beta vanish together: F has a fourfold root, and p follows from the distance instead.
        flat, sideways = np.abs(terms.alpha) < _SMALL, np.abs(terms.rate) < _SMALL
        theta = np.stack(
            [*_cosine_roots(terms.alpha, terms.level), *_cosine_roots(beta, right)]
        )
        miss = np.abs((beta * np.exp(1j * theta)).real - right) / (
            np.abs(beta) + np.abs(right)
        )
        of_first = np.array([True, True, False, False])[:, None]
        free = np.abs(beta) < _SMALL  # the third equation does not know theta then
        usual = np.where(
            of_first,
            free | (miss < _CREDIBLE) | (miss <= miss[:2].min(axis=0)) | sideways,
            flat,
        )
        unusual = sideways & (of_first | flat)
        slides = np.stack(
            np.broadcast_arrays(terms.way / terms.rate, *self._slides(terms, theta))
        )
        kept = np.stack([usual, unusual, unusual])
        _, choice, which = np.nonzero(kept)
        return which, np.stack([angle[which], slides[kept], theta[choice, which]])

    def _slides(self, terms: Terms, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Both p that solve the third equation, or the nearest to it."""
        away = terms.place - self.lever * np.exp(1j * theta)
        size, middle = _square(terms.slide), _along(away, terms.slide)
        root = np.sqrt(
            np.maximum(
                middle * middle - size * (_square(away) - _square(self.arm)), 0.0
            )
        )
        return (middle - root) / size, (middle + root) / size

    def polished(self, roots: np.ndarray) -> np.ndarray:
        """Roots (3, K) after Newton's method on all three equations; most are exact after two steps."""
        rough, equations, roots = np.arange(roots.shape[1]), self, roots.copy()
        for _ in range(_ROUNDS):
            some = roots[:, rough]
            for _ in range(_STEPS):
                step = equations._step(*some)
                some = some - step
            roots[:, rough] = some
            left = np.flatnonzero(
                np.abs(step).max(axis=0) > _EXACT * (1.0 + np.abs(some[1]))
            )
            rough, equations = rough[left], equations[left]
            if len(rough) == 0:
                break
        return roots

    def _step(
        self, angle: np.ndarray, slide: np.ndarray, theta: np.ndarray
    ) -> np.ndarray:
        """One step (3, K) of Newton's method, by Cramer's rule."""
        t, d, turn, none = (
            self.terms(angle),
            self._rates(angle),
            np.exp(1j * theta),
            np.zeros_like(angle),
        )
        gap = t.place - slide * t.slide - self.lever * turn
        gap_rates = np.stack(
            [d.place - slide * d.slide, -t.slide, -1j * self.lever * turn]
        )
        first = np.stack(
            [(d.alpha * turn).real - d.level, none, -(t.alpha * turn).imag]
        )
        second = np.stack([d.way - slide * d.rate, -t.rate, none])
        third = 2.0 * _along(gap, gap_rates)
        values = (
            (t.alpha * turn).real - t.level,
            t.way - slide * t.rate,
            _square(gap) - _square(self.arm),
        )
        columns = cross(second, third), cross(third, first), cross(first, second)
        step = sum(
            value * column for value, column in zip(values, columns, strict=True)
        ) / dot(first, columns[0])
        step[::2] = np.clip(step[::2], -_LONGEST_STEP, _LONGEST_STEP)
        return step


def _turned_back(axis: np.ndarray, frame: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Components of R_a^T vector in the frame: constant part, factors of cos q_a and sin q_a, (3, 3, K)."""
    along = axis[:, None] * dot(axis[:, None], frame)
    return np.stack(
        [
            dot(part, vector[:, None])
            for part in (along, frame - along, cross(axis[:, None], frame))
        ]
    )


def _flat(components: np.ndarray) -> np.ndarray:
    """Vectors as complex numbers, from their components along n and two perpendicular to it in the second axis."""
    return components[:, 1] + 1j * components[:, 2]


def _square(number: np.ndarray) -> np.ndarray:
    """Squared size of complex numbers."""
    return number.real**2 + number.imag**2


def _along(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Scalar products of vectors that are written as complex numbers."""
    return first.real * second.real + first.imag * second.imag


def _cosine_roots(
    coefficient: np.ndarray, level: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Both angles with ``Re(coefficient exp(i theta)) = level``, or the nearest to it."""
    half = np.arccos(np.clip(level / np.abs(coefficient), -1.0, 1.0))
    middle = -np.angle(coefficient)
    return middle - half, middle + half
