"""Paths of poses, or of orientations with some position rows: curves of their coordinates, and twists."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from brachis.common.arrays import spread
from brachis.kernel import body_twists, rotation_derivatives
from brachis.path.protocol import Array, Curve, MappedCurve, Orientation, PathSample
from brachis.path.rotations import angular_rates
from brachis.path.sequence import Path

LEAST_QUALITY = 0.5
"""Quality of interpolated quaternions below which the tool turns very differently from the given orientations."""


class PosePath(Path):
    """A path of poses whose samples have the body twist; see `brachis.path.protocol.PathSample`."""

    def sample(self, s: Sequence[float] | Array) -> PathSample:
        """Return the path at K values of s; outside the ends of the path, the first or last piece is continued.

        Parameters
        ----------
        s : array_like, shape (K,)
            Path coordinates at which to sample.
        """
        derivatives = self.derivatives(s)
        return PathSample(derivatives[0], *body_twists(derivatives))


class OrientedPath(Path):
    """A path of rows of the position and the orientation whose samples have angular velocities in the world frame."""

    def sample(self, s: Sequence[float] | Array) -> PathSample:
        """Return the path at K values of s, shape (K,); outside its ends, the first or last piece is continued.

        The angular velocity w along the tool's axes is R w in the world. The derivatives of R w are R w' and R (w'' + w
        x w').
        """
        derivatives = self.derivatives(s)
        velocity, rate, bend = angular_rates(derivatives)
        bend = bend + np.cross(velocity, rate)
        rates = np.array([velocity, rate, bend])
        turning = np.einsum("kij,okj->oki", rotations(derivatives[0]), rates)
        moving = derivatives[1:, :, : self.positions]
        return PathSample(derivatives[0], *np.concatenate([moving, turning], axis=-1))


def pose_curve(position: Curve, orientation: Orientation) -> MappedCurve:
    """Return the coordinates of a position, m, and an orientation over the same parameter."""
    return MappedCurve(position, partial(_with_orientation, orientation))


def _with_orientation(orientation: Orientation, sigma: Array, position: Array) -> Array:
    return _coordinates(position, orientation(sigma, len(position) - 1))


def quaternion_curve(columns: Curve) -> MappedCurve:
    """Return the coordinates of a position and a quaternion; the quaternion need not have unit length.

    The quaternion divided by its length gives the orientation. The result does not depend on the choice of the world
    frame or the tool frame: a different frame multiplies all quaternions by a unit quaternion, and this commutes with
    the division.

    Parameters
    ----------
    columns : Curve
        Rows of the position, then the quaternion w, x, y, z.
    """
    return MappedCurve(columns, _from_quaternions)


def _from_quaternions(_sigma: Array, columns: Array) -> Array:
    rotation = rotation_derivatives(columns[..., -4:])
    return _coordinates(columns[..., :-4], rotation)


def least_quality(columns: Curve) -> tuple[float, float]:
    """Return the sigma at which the quaternions, the last four columns, have the lowest quality, and this quality.

    The quality of a quaternion is its length, or the reciprocal of its length if the length is greater than 1.
    """

    def quality(sigma: Array) -> Array:
        """Return the quality of the quaternions, (K,); it is 1 at unit length."""
        quaternions = columns.derivatives(sigma, 0)[0, :, -4:]
        lengths = np.linalg.norm(quaternions, axis=1)
        return np.minimum(lengths, 1.0 / np.maximum(lengths, 1.0))

    return smallest(quality, columns.knots)


def smallest(function: Callable[[Array], Array], knots: Array) -> tuple[float, float]:
    """Return the sigma at which a continuous function is smallest, and its value there.

    Parameters
    ----------
    function : callable
        Function with values of shape (K,) at K values of sigma. The function is evaluated at 64 points between every
        two knots, then at as many points around the smallest value.
    knots : ndarray, shape (n,)
        Values of sigma between which the function is smooth.
    """
    count = 64
    grid = spread(knots, count)
    near = np.argmin(function(grid))
    before, after = np.clip([near - 1, near + 1], 0, len(grid) - 1)
    fine = np.linspace(grid[before], grid[after], 2 * count + 1)
    values = function(fine)
    best = np.argmin(values)
    return float(fine[best]), float(values[best])


def rotations(coordinates: Array) -> Array:
    """Return the rotation matrices, (..., 3, 3), in the last nine of the coordinates, (..., c)."""
    return coordinates[..., -9:].reshape(*coordinates.shape[:-1], 3, 3)


def _coordinates(position: Array, rotation: Array) -> Array:
    return np.concatenate(
        [position, rotation.reshape(*position.shape[:-1], 9)], axis=-1
    )
