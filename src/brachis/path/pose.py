"""Paths of poses: curves of their twelve coordinates, and the body twist along them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brachis.path.protocol import PathSample
from brachis.path.rotations import angular_velocity, matrices, product, unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from brachis.path.protocol import Array, Curve, Orientation
    from brachis.path.sequence import SequencePath

POSITIONS = 3
LEAST_QUALITY = 0.5
"""Quality of interpolated quaternions below which the tool turns quite otherwise than its neighbours ask for."""


@dataclass(frozen=True, eq=False)
class PoseCurve:
    """A position and an orientation over the same parameter, as the twelve coordinates of a pose.

    Attributes
    ----------
    position : Curve
        The position, three columns, m.
    orientation : Orientation
        The orientation over the same sigma.
    """

    position: Curve
    orientation: Orientation

    @property
    def length(self) -> float:
        """Range of sigma."""
        return self.position.length

    @property
    def knots(self) -> Array:
        """Values of sigma between which the curve is analytic; the orientation adds none."""
        return self.position.knots

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the curve and its derivatives by sigma, shape (order + 1, K, 12)."""
        return _coordinates(
            self.position.derivatives(sigma, order),
            self.orientation.matrices(sigma, order),
        )


@dataclass(frozen=True, eq=False)
class QuaternionPoseCurve:
    """A position and a quaternion, which need not have unit length, as the twelve coordinates of a pose.

    Divided by its length the quaternion is that of the orientation. This construction does not depend on the choice of
    the world frame or the tool frame: others multiply all quaternions by a unit quaternion, which commutes with it.

    Attributes
    ----------
    columns : Curve
        x, y, z, then the quaternion w, x, y, z: seven columns.
    """

    columns: Curve

    @property
    def length(self) -> float:
        """Range of sigma."""
        return self.columns.length

    @property
    def knots(self) -> Array:
        """Values of sigma between which the curve is analytic."""
        return self.columns.knots

    def derivatives(self, sigma: Array, order: int = 3) -> Array:
        """Return the curve and its derivatives by sigma, shape (order + 1, K, 12)."""
        columns = self.columns.derivatives(sigma, order)
        return _coordinates(
            columns[..., :POSITIONS], matrices(unit(columns[..., POSITIONS:]))
        )

    def quality(self, sigma: Array) -> Array:
        """Return how near to 1 the quaternions' lengths are before they are divided by them, shape (K,).

        It is the length, or where this is greater than 1 its reciprocal.
        """
        lengths: Array = np.linalg.norm(
            self.columns.derivatives(sigma, 0)[0, :, POSITIONS:], axis=1
        )
        return np.minimum(lengths, 1.0 / np.maximum(lengths, 1.0))


@dataclass(frozen=True, eq=False)
class PosePath:
    """A path of poses; see `brachis.path.protocol.PathSample` for what a sample consists of.

    Attributes
    ----------
    coordinates : SequencePath
        The twelve coordinates of the pose along the path.
    """

    coordinates: SequencePath

    @property
    def length(self) -> float:
        """Arc length of the position, m."""
        return self.coordinates.length

    @property
    def breaks(self) -> Array:
        """Values of s where pieces join, from 0 to 1."""
        return self.coordinates.breaks

    def sample(self, s: Sequence[float] | Array) -> PathSample:
        """Return the path at K values of s; beyond [0, 1] as the first or last piece continues.

        Parameters
        ----------
        s : array_like, shape (K,)
            Path coordinates.
        """
        derivatives = self.coordinates.derivatives(s)
        return PathSample(derivatives[0], *twist(derivatives))


def twist(coordinates: Array) -> Array:
    """Return the body twist of a pose and its derivatives, shape (order, K, 6).

    With the position p and the rotation matrix R of the tool in the world frame it consists of the velocity
    ``v = R^T p'`` and the angular velocity w of ``R^T R'``, both along the axes of the tool frame.

    Parameters
    ----------
    coordinates : ndarray, shape (order + 1, K, 12)
        Derivatives of the coordinates of the pose.
    """
    position, rotation = coordinates[..., :POSITIONS], rotations(coordinates)
    velocity = product(np.swapaxes(rotation, -1, -2), position[1:], "...ij,...j->...i")
    return np.concatenate([velocity, angular_velocity(rotation)], axis=-1)


def rotations(coordinates: Array) -> Array:
    """Return the rotation matrices (..., 3, 3) out of the coordinates (..., 12) of poses."""
    return coordinates[..., POSITIONS:].reshape(*coordinates.shape[:-1], 3, 3)


def _coordinates(position: Array, rotation: Array) -> Array:
    return np.concatenate(
        [position, rotation.reshape(*position.shape[:-1], 9)], axis=-1
    )
