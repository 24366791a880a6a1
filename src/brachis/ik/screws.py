"""One joint as a screw, and the circle or line on which it moves a position.

A step of a closed form puts a condition on a position that one joint moves: a component along a direction, or a
distance. On a circle either is ``a cos + b sin = c`` with two roots; on a line a component is linear and a distance
quadratic. Roots are told apart by the sign of the condition's derivative, so that a root keeps its place along any
continuous curve until the two meet: see Subproblems 1 to 4 of A. J. Elias, J. T. Wen, "IK-Geo: unified robot inverse
kinematics using subproblem decomposition", 2022, whose solutions are in no such order.

Vectors have their components along the first axis, then come the alternatives (one axis for each step with
two of them) and the samples; joint positions have alternatives and samples alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.arrays import cross
from brachis.ik.vectors import cosine_roots, dot


@dataclass(frozen=True)
class Screw:
    """A joint: a turn about the line through `point` along `axis`, or a slide along `axis`.

    Attributes
    ----------
    axis : (3, ...) ndarray
        Unit direction.
    point : (3, ...) ndarray
        m; without meaning for a slide.
    revolute : bool
    """

    axis: np.ndarray
    point: np.ndarray
    revolute: bool

    @property
    def inverse(self) -> Screw:
        """The joint that undoes this one."""
        return Screw(-self.axis, self.point, self.revolute)

    def velocity(self, position: np.ndarray) -> np.ndarray:
        """Differentiate a position with respect to the joint that moves it, (3, ...)."""
        return cross(self.axis, position - self.point) if self.revolute else self.axis

    def orbit(self, position: np.ndarray) -> Circle | Line:
        """Where the joint moves a position."""
        if not self.revolute:
            return Line(position, self.axis)
        circle = Circle.of(self.axis, position - self.point)
        return Circle(circle.middle + self.point, circle.arm, circle.across)


@dataclass(frozen=True)
class Circle:
    """The positions ``middle + arm cos(angle) + across sin(angle)``; all attributes are (3, ...) ndarrays."""

    middle: np.ndarray
    arm: np.ndarray
    across: np.ndarray

    @classmethod
    def of(cls, axis: np.ndarray, vector: np.ndarray) -> Circle:
        """Turn a vector about a unit axis (Rodrigues' formula)."""
        middle = axis * dot(axis, vector)
        return cls(middle, vector - middle, cross(axis, vector))

    def at(self, angle: np.ndarray) -> np.ndarray:
        """Position at an angle, (3, ...)."""
        return self.turned(np.cos(angle), np.sin(angle))

    def turned(self, cos: np.ndarray, sin: np.ndarray) -> np.ndarray:
        """Position at an angle of which cosine and sine are known, (3, ...)."""
        return self.arm * cos + self.across * sin + self.middle

    def component(self, direction: np.ndarray, level: np.ndarray, slot: int) -> np.ndarray:
        """Angles at which ``direction . position = level``: growing with the angle at the first, falling at the second.

        The two follow each other along the axis `slot`; NaN where there is none.
        """
        level = level - dot(direction, self.middle)
        return np.concatenate(cosine_roots(dot(direction, self.arm), dot(direction, self.across), level), axis=slot)

    def distance(self, other: np.ndarray, squared: np.ndarray, slot: int) -> np.ndarray:
        """Angles at a distance from another position: approaching it at the first, leaving it at the second."""
        away = other - self.middle
        level = 0.5 * (dot(away, away) + dot(self.arm, self.arm) - squared)
        return np.concatenate(cosine_roots(dot(away, self.arm), dot(away, self.across), level), axis=slot)


@dataclass(frozen=True)
class Line:
    """The positions ``start + axis slide``; all attributes are (3, ...) ndarrays."""

    start: np.ndarray
    axis: np.ndarray

    def at(self, slide: np.ndarray) -> np.ndarray:
        """Position after a slide, (3, ...)."""
        return self.start + self.axis * slide

    def component(self, direction: np.ndarray, level: np.ndarray, slot: int) -> np.ndarray:  # noqa: ARG002
        """Return the slide at which ``direction . position = level``; it is the only one, so `slot` is not used."""
        return (level - dot(direction, self.start)) / dot(direction, self.axis)

    def distance(self, other: np.ndarray, squared: np.ndarray, slot: int) -> np.ndarray:
        """Slides at a distance from another position: approaching it at the first, leaving it at the second."""
        away = other - self.start
        nearest = dot(self.axis, away)
        root = np.sqrt(nearest * nearest - dot(away, away) + squared)
        return np.concatenate([nearest - root, nearest + root], axis=slot)
