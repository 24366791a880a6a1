"""Points of a path in SI units, made from arrays and transforms, with names of their rows for messages."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from brachis.common import tolerances
from brachis.common.arrays import with_like_signs
from brachis.errors import Details, TaskError
from brachis.task.point_data import FileUnits
from brachis.task.points.units import ANGLES, LENGTHS, SPEEDS, quaternions_of

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

Rows = tuple[str, ...] | str
"""Rows of the task space, or its name if it is a task space of poses."""
QUATERNION = 4


@dataclass(frozen=True, eq=False)
class Points:
    """Points in the order in which the tool passes them.

    Attributes
    ----------
    position : (n, p) ndarray
        Positions, m.
    turning : (n, q) ndarray
        Unit quaternions w, x, y, z, with signs chosen so that neighbours are close (q = 4); yaw, rad (q = 1); or
        nothing (q = 0).
    speed : (n,) ndarray or None
        Speed of the tool on the way to each point, m/s; NaN where it is not prescribed.
    rows : (n,) int ndarray
        Line of each point in a file, or its index in an array.
    source : str
        File or argument that contains the points, for messages.
    row : str
        Word for an entry of `rows`: ``line`` or ``row``.
    notes : tuple of str
        Findings about the points.
    """

    position: Array
    turning: Array
    speed: Array | None
    rows: Indices
    source: str
    row: str = "line"
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of points, n."""
        return len(self.position)

    @property
    def dimension(self) -> int:
        """Number of coordinates of a position, p."""
        return self.position.shape[1]

    @property
    def has_quaternions(self) -> bool:
        """Whether the points are poses."""
        return self.turning.shape[1] == QUATERNION

    @property
    def columns(self) -> Array:
        """Position and turning as columns of one array, (n, p + q)."""
        return np.hstack([self.position, self.turning])

    @property
    def steps(self) -> Array:
        """Distances between successive points, (n - 1,), m."""
        return steps_of(self.position)

    def only(self, chosen: Any) -> Points:
        """Return only the chosen points."""
        return replace(
            self,
            position=self.position[chosen],
            turning=self.turning[chosen],
            speed=None if self.speed is None else self.speed[chosen],
            rows=self.rows[chosen],
        )

    def name_row(self, i: int) -> str:
        """Return the name of a point's row."""
        return f"{self.row} {self.rows[i]}"

    def describe(self, i: int) -> str:
        """Return the row and the position of a point as text."""
        place = ", ".join(f"{value:.6g}" for value in self.position[i])
        return f"{self.name_row(i)}, [{place}] m"

    def wrong(self, i: int, problem: str, **details: Unpack[Details]) -> TaskError:
        """Return the error for a mistake at a point; `found` is by default its row and position."""
        details.setdefault("found", self.describe(i))
        details["where"] = f"{self.source}: {self.name_row(i)}"
        return TaskError(problem, **details)


def steps_of(position: Array) -> Array:
    """Return the distances, (n - 1,), between successive positions, (n, p)."""
    return np.linalg.norm(np.diff(position, axis=0), axis=1)


def is_repeated(
    steps: Array, largest: float = tolerances.WRITTEN
) -> npt.NDArray[np.bool_]:
    """Return which of the n - 1 steps, m or rad, count as repetitions of a point.

    Such a step is shorter than rounding errors, or shorter than both `largest` and a hundredth of the steps before and
    after. A curve through both points would turn into the direction of this step, which is meaningless.
    """
    around = np.pad(steps, 1, mode="reflect")
    shorter = np.minimum(around[:-2], around[2:])
    is_short = steps < np.minimum(largest, 0.01 * shorter)
    return is_short | (steps < tolerances.LENGTH)


def sum_up(steps: npt.ArrayLike) -> Array:
    """Return the cumulative sums of n - 1 steps, (n,), starting with 0."""
    return np.append(0.0, np.cumsum(steps))


def project_on_sides(points: Array, begin: Array, side: Array) -> tuple[Array, Array]:
    """Return the places nearest to points, (n, p), on the sides that start at `begin`, and the distances to them, (n,).

    Places are given as fractions of the sides, (n,).
    """
    away = points - begin
    lengths = np.maximum(np.sum(side**2, axis=1), 1e-300)
    shares = np.clip(np.sum(away * side, axis=1) / lengths, 0.0, 1.0)
    return shares, np.linalg.norm(away - shares[:, None] * side, axis=1)


def angles_between(first: Array, second: Array) -> Array:
    """Return the angles, (n,), rad, between orientations (n, q) as in `Points.turning`; zero if there are none."""
    if first.shape[1] != QUATERNION:
        return np.abs(first - second).sum(axis=1)
    unit = first / np.linalg.norm(first, axis=1)[:, None]
    apart = np.minimum(
        np.linalg.norm(unit - second, axis=1), np.linalg.norm(unit + second, axis=1)
    )
    return 4.0 * np.arcsin(np.minimum(apart / 2.0, 1.0))


def points_from(
    points: Any,
    orientations: Any,
    speed: Any,
    units: FileUnits,
    source: str,
    *,
    least: int = 2,
) -> Points:
    """Return points from arrays or transforms that a program passes.

    Parameters
    ----------
    points : array_like, (n, p) or (n, 4, 4), or sequence of transforms
        Positions, homogeneous matrices, or objects that have such a matrix.
    orientations : Rotation, array_like, (n, 3, 3) or (n,), or None
        SciPy rotations, rotation matrices, or yaw angles.
    speed : array_like, (n,), or None
        Speeds; NaN where none is prescribed.
    units : FileUnits
        Units of the numbers; m, rad and m/s if not stated.
    source : str
        Name of the points in messages.
    least : int, optional
        Minimum number of points.

    Raises
    ------
    TaskError
        An array has the wrong shape or numbers that are not finite, or a matrix is not a rotation; the message names
        the row.
    """
    values = _array(_matrices(points), source, source)
    if values.ndim == 3 and values.shape[1:] == (4, 4) and orientations is None:
        orientations = values[:, :3, :3]
        values = values[:, :3, 3]
    if values.ndim != 2 or not 1 <= values.shape[1] <= 3 or len(values) < least:
        raise TaskError(
            "the points have the wrong shape",
            found=values.shape,
            allowed=f"positions (n, 1), (n, 2) or (n, 3), or matrices (n, 4, 4), with n >= {least}",
            where=source,
        )
    turning = np.empty((len(values), 0))
    if orientations is not None:
        turning = _turning(orientations, units, source)
    speeds = None if speed is None else _speeds(speed, units, source)
    for name, column in (("orientations", turning), ("speed", speeds)):
        if column is not None and len(column) != len(values):
            raise TaskError(
                f"the numbers of points and of rows of {name} differ",
                found=len(column),
                allowed=len(values),
            )
    rows = np.arange(len(values))
    position = values * LENGTHS[units.length or "m"]
    return Points(position, turning, speeds, rows, source, "row")


def _matrices(points: Any) -> Any:
    """Return the homogeneous matrices of transforms, or any other values unchanged."""
    if isinstance(points, list | tuple) and points:
        if all(hasattr(transform, "homogeneous") for transform in points):
            return [transform.homogeneous for transform in points]
        if hasattr(points[0], "as_matrix"):
            return [transform.as_matrix() for transform in points]
    return points.as_matrix() if hasattr(points, "as_matrix") else points


def _turning(orientations: Any, units: FileUnits, source: str) -> Array:
    """Return the orientations as quaternions, (n, 4), or yaw, (n, 1)."""
    from scipy.spatial.transform import Rotation

    where = f"{source}: orientations"
    if isinstance(orientations, Rotation):
        return with_like_signs(quaternions_of(orientations))
    values = _array(orientations, where, source)
    if values.ndim == 1:
        return values[:, None] * ANGLES[units.angle or "rad"]
    if values.shape[1:] == (3, 3):
        off = np.abs(values @ np.swapaxes(values, 1, 2) - np.eye(3)).max(axis=(1, 2))
        bad = (off > 1e-4) | (np.linalg.det(values) < 0.0)
        _refuse_first(bad, "not a rotation matrix", values, source)
        return with_like_signs(quaternions_of(Rotation.from_matrix(values)))
    problem = "the orientations have the wrong shape"
    if values.shape[1:] == (QUATERNION,):
        problem = "an array of quaternions does not say whether w is first or last"
    raise TaskError(
        problem,
        found=values.shape,
        allowed="SciPy's Rotation (Rotation.from_quat(q) takes x, y, z, w), (n, 3, 3) matrices, or (n,) yaw",
        where=where,
    )


def _speeds(speed: Any, units: FileUnits, source: str) -> Array:
    """Return the speeds, (n,), in m/s."""
    where = f"{source}: speed"
    speeds = _numbers(speed, where) * SPEEDS[units.speed or "m/s"]
    if speeds.ndim != 1:
        raise TaskError(
            "the speeds have the wrong shape",
            found=speeds.shape,
            allowed="(n,)",
            where=where,
        )
    problem = "a speed must be positive and finite, or NaN if no speed is prescribed"
    _refuse_first((speeds <= 0.0) | np.isinf(speeds), problem, speeds, source)
    return speeds


def _array(values: Any, where: str, source: str) -> Array:
    array = _numbers(values, where)
    _refuse_first(~np.isfinite(np.atleast_1d(array)), "not finite", array, source)
    return array


def _numbers(values: Any, where: str) -> Array:
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise TaskError(
            "this is not an array of numbers", found=str(error), where=where
        ) from None


def _refuse_first(bad: np.ndarray, problem: str, values: Array, source: str) -> None:
    """Refuse values that have bad rows; the error names the first bad row."""
    rows = np.flatnonzero(bad.any(axis=tuple(range(1, bad.ndim))))
    if rows.size:
        raise TaskError(
            problem,
            found=np.atleast_1d(values)[rows[0]].tolist(),
            where=f"{source}: row {rows[0]}",
        )
