"""A joint as a screw, and the circle or line on which it moves a position.

A step of a closed form sets a condition on a position that one joint moves: its component along a direction, or its
distance from a point. On a circle, both conditions have the form ``a cos + b sin = c``, with two roots. On a line, a
component is linear and a distance quadratic. Roots are distinguished by the sign of the condition's derivative, so a
root keeps its place along any continuous curve until the two roots meet. See Subproblems 1 to 4 of A. J. Elias, J. T.
Wen, "IK-Geo: unified robot inverse kinematics using subproblem decomposition", 2022, where the solutions have no such
order.

Vectors have their components along the first axis, followed by the alternatives (one axis for each step with two
solutions) and the samples. Joint positions only have alternatives and samples.

`ChainGeometry` holds the screw axes of a chain, computed from the Pinocchio model. The closed forms use only these
axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from brachis.common.arrays import cross
from brachis.ik.vectors import apply, apply_inverse, cosine_roots, determinants, dot
from brachis.kernel import Chain, formula
from brachis.robot import Robot


@dataclass(frozen=True)
class Screw:
    """A joint: a turn about the line through `point` along `axis`, or a slide along `axis`.

    Attributes
    ----------
    axis : (3, ...) ndarray
        Unit vector along the axis of the joint.
    point : (3, ...) ndarray
        A point on the axis, m; without meaning for a slide.
    revolute : bool
    """

    axis: np.ndarray
    point: np.ndarray
    revolute: bool

    @property
    def inverse(self) -> Screw:
        """The joint with the inverse motion."""
        return Screw(-self.axis, self.point, self.revolute)

    def velocity(self, position: np.ndarray) -> np.ndarray:
        """Differentiate a position with respect to this joint, which moves it, (3, ...)."""
        return cross(self.axis, position - self.point) if self.revolute else self.axis

    def orbit(self, position: np.ndarray) -> Circle | Line:
        """Return the circle or line on which the joint moves a position."""
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
        """Return the position at an angle, (3, ...)."""
        turned = self.arm * formula.cos(angle) + self.across * formula.sin(angle)
        return turned + self.middle

    def component(
        self, direction: np.ndarray, level: np.ndarray, slot: int
    ) -> np.ndarray:
        """Return the angles at which ``direction . position = level``; the left side rises at the first one.

        The two angles follow each other along the axis `slot`. Both are NaN if the level is out of reach.
        """
        level = level - dot(direction, self.middle)
        return cosine_roots(
            dot(direction, self.arm), dot(direction, self.across), level, slot
        )

    def distance(
        self, position: np.ndarray, squared: np.ndarray, slot: int
    ) -> np.ndarray:
        """Return the two angles at a distance from another position, first the one at which the distance decreases."""
        away = position - self.middle
        level = 0.5 * (dot(away, away) + dot(self.arm, self.arm) - squared)
        return cosine_roots(dot(away, self.arm), dot(away, self.across), level, slot)


def rotate(axis: np.ndarray, angle: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Turn a vector about a unit axis, shape (3, ...)."""
    return Circle.of(axis, vector).at(angle)


@dataclass(frozen=True)
class Line:
    """The positions ``start + axis slide``; all attributes are (3, ...) ndarrays."""

    start: np.ndarray
    axis: np.ndarray

    def at(self, slide: np.ndarray) -> np.ndarray:
        """Return the position after a slide, (3, ...)."""
        return self.start + self.axis * slide

    def component(
        self, direction: np.ndarray, level: np.ndarray, slot: int
    ) -> np.ndarray:
        """Return the slide at which ``direction . position = level``. There is only one, so `slot` is not used."""
        return (level - dot(direction, self.start)) / dot(direction, self.axis)

    def distance(
        self, position: np.ndarray, squared: np.ndarray, slot: int
    ) -> np.ndarray:
        """Return the two slides at a distance from another position, first the one at which the distance decreases."""
        away = position - self.start
        nearest = dot(self.axis, away)
        root = formula.sqrt(nearest * nearest - dot(away, away) + squared)
        return np.concatenate([nearest - root, nearest + root], axis=slot)


@dataclass(frozen=True)
class PosedScrews:
    """Screw axes of a chain in K postures, in the world frame; components are along the first axis (see `vectors`).

    Attributes
    ----------
    axes : (3, n, K) ndarray
        Unit directions of rotation or translation.
    points : (3, n, K) ndarray
        A point on each axis of rotation, m; without meaning for prismatic joints.
    tool_position : (3, K) ndarray
        Position of the tool, m.
    tool_rotation : (3, 3, K) ndarray
    revolute : (n,) bool ndarray
    """

    axes: np.ndarray
    points: np.ndarray
    tool_position: np.ndarray
    tool_rotation: np.ndarray
    revolute: np.ndarray

    def jacobian_columns(self, joints: Sequence[int]) -> np.ndarray:
        """Return columns of the tool's Jacobian, (6, len(joints), K): linear, then angular velocity, in world axes."""
        chosen = list(joints)
        axes = self.axes[:, chosen]
        turns = self.revolute[chosen][:, None]
        lever = self.tool_position[:, None] - self.points[:, chosen]
        return np.concatenate(
            [np.where(turns, cross(axes, lever), axes), np.where(turns, axes, 0.0)]
        )

    def pick(self, joints: Sequence[int], alternatives: int) -> tuple[Screw, ...]:
        """Select joints; vectors are (3, ..., K), with `alternatives` axes of length one before the postures."""
        spread = (slice(None), *[None] * alternatives)
        return tuple(
            Screw(
                self.axes[:, i][spread],
                self.points[:, i][spread],
                bool(self.revolute[i]),
            )
            for i in joints
        )

    def determinant(self, joints: Sequence[int]) -> np.ndarray:
        """Compute det J_nr, (K,), of six joints for a pose, or three for a position; real or complex, and analytic."""
        return determinants(self.jacobian_columns(joints)[: len(joints)])


@dataclass(frozen=True)
class Poses:
    """N poses, or the motions that move the origin to them; components are along the first axis (see `vectors`).

    Attributes
    ----------
    position : (3, ..., N) ndarray
        Positions of the poses, m.
    rotation : (3, 3, ..., N) ndarray
    """

    position: np.ndarray
    rotation: np.ndarray

    @classmethod
    def of_targets(cls, targets: np.ndarray) -> Poses:
        """Return the poses given by task coordinates, (N, 12)."""
        return cls(
            targets[:, :3].T, np.moveaxis(targets[:, 3:].reshape(-1, 3, 3), 0, 2)
        )

    @classmethod
    def of_tool(cls, screws: PosedScrews) -> Poses:
        """Return the placements of the tool in the postures."""
        return cls(screws.tool_position, screws.tool_rotation)

    def targets(self) -> np.ndarray:
        """Return the task coordinates, (N, 12)."""
        rotations = np.moveaxis(self.rotation, 2, 0).reshape(-1, 9)
        return np.concatenate([self.position.T, rotations], axis=1)

    def move(self, point: np.ndarray) -> np.ndarray:
        """Move points, (3, ...), by these poses as motions."""
        return apply(self.rotation, point) + self.position

    def __matmul__(self, moved: Poses) -> Poses:
        """Move other poses by these poses as motions; each side has N poses or 1."""
        rotation = np.einsum("ij...,jk...->ik...", self.rotation, moved.rotation)
        return Poses(self.move(moved.position), rotation)

    def inverse(self) -> Poses:
        """Return the inverse motions."""
        return Poses(
            -apply_inverse(self.rotation, self.position),
            np.swapaxes(self.rotation, 0, 1),
        )


@dataclass(frozen=True, eq=False)
class ChainGeometry(Chain):
    """A serial chain as screw axes at the zero posture, in the world frame; see `brachis.kernel.Chain`.

    Attributes
    ----------
    joint_names : tuple of str
    """

    joint_names: tuple[str, ...] = ()

    @classmethod
    def of(cls, robot: Robot) -> ChainGeometry:
        """Return the geometry of a robot's chain."""
        chain = robot.chain
        arrays = {entry.name: getattr(chain, entry.name) for entry in fields(chain)}
        return cls(**arrays, joint_names=robot.joint_names)

    @cached_property
    def _generators(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """For each axis the two (3, 3) matrices of Rodrigues' formula, for the sine and for 1 - cosine of the angle.

        Rotation matrices, (3, 3, K or 1), are multiplied by them from the left, in one product for all samples.
        """
        skews = [np.cross(axis, np.eye(3)) for axis in self.axes]
        return [(skew, skew @ skew) for skew in skews]

    @cached_property
    def random_screws(self) -> PosedScrews:
        """Screws in random postures, always the same ones. Closed forms use them to see which quantities vary."""
        rng = np.random.default_rng(1)
        return self.screws_at(rng.uniform(-np.pi, np.pi, (256, self.n)))

    def screws_at(self, q: np.ndarray) -> PosedScrews:
        """Return screw axes and tool placement in K postures, by the product of exponentials.

        Parameters
        ----------
        q : (K, n) ndarray
            Postures, real, or complex for complex-step derivatives.
        """
        return self.screws_with(range(self.n), q)

    def screws_with(self, joints: Sequence[int], positions: np.ndarray) -> PosedScrews:
        """Return screw axes and tool placement with some joints at given positions and all others at zero.

        Parameters
        ----------
        joints : sequence of int
            The joints at given positions, ascending.
        positions : (K, h) ndarray
            Positions of these joints, rad or m.
        """
        count = len(positions)
        moving = dict(zip(joints, positions.T, strict=True))
        axes = np.empty((3, self.n, count), dtype=positions.dtype)
        points = np.empty_like(axes)
        rotation = np.eye(3)[:, :, None]
        offset = np.zeros((3, 1))
        for i in range(self.n):
            axes[:, i] = self.axes[i] @ rotation
            points[:, i] = self.points[i] @ rotation + offset
            if i not in moving:
                continue
            q = moving[i]
            if self.revolute[i]:
                first, second = self._generators[i]
                rotation = (
                    rotation
                    + (first @ rotation) * formula.sin(q)
                    + (second @ rotation) * (1.0 - formula.cos(q))
                )
                offset = points[:, i] - self.points[i] @ rotation
            else:
                offset = offset + axes[:, i] * q
        position = self.tool_position @ rotation + offset
        tool = self.tool_rotation.T @ rotation
        return PosedScrews(
            axes,
            points,
            np.broadcast_to(position, (3, count)),
            np.broadcast_to(tool, (3, 3, count)),
            self.revolute,
        )
