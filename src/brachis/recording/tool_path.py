"""The path that a motion follows: by forward kinematics, dense samples, and a smooth curve within a tolerance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brachis.arrays import freeze, with_like_signs
from brachis.cam.points import Points
from brachis.errors import PathError, TaskError
from brachis.path import Path, build_path
from brachis.robot import TaskMap
from brachis.robot.task_map import JointSpace, Pose
from brachis.task import FitTolerance, Segment
from brachis.task.fitted import Wanted, segments_along

_POINTS = 2000
_SHARE = 0.5
"""Of the tolerance, for the curve; the rest is for the path coordinate over time, and for what lies between points."""
_STEPS = 4


@dataclass(frozen=True, eq=False)
class Followed:
    """A path, and where on it a motion is.

    Attributes
    ----------
    segments : tuple of Segment
        For a task.
    path : Path
    s : (K,) ndarray
        Path coordinate at the times of the motion's postures.
    miss : float
        Largest distance of the postures' tool from the path, m or rad.
    """

    segments: tuple[Segment, ...]
    path: Path
    s: np.ndarray
    miss: float

    def __post_init__(self) -> None:
        """Take copies that nobody can write to."""
        freeze(self, "s")


def path_followed(task_map: TaskMap, q: np.ndarray, qdot: np.ndarray, t: np.ndarray, tolerance: float) -> Followed:
    """Recover the path that a motion prescribes in a task space.

    Parameters
    ----------
    task_map : TaskMap
    q, qdot : (K, n) ndarray
        The motion, densely.
    t : (K,) ndarray
        s.
    tolerance : float
        m and rad.

    Raises
    ------
    PathError
        The tool does not move, or follows no smooth path within the tolerance: it stops and turns off, for example.
    """
    speed = _speed(task_map, q, qdot)
    length = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))])
    if length[-1] < tolerance:
        hint = "A task space of joints takes any motion"
        raise PathError("the tool does not move along a path", found=f"{length[-1]:.3g} m", where="path", hint=hint)
    values = task_map.values(q)
    chosen = _evenly(length)
    try:
        segments = segments_along(_points(task_map, values[chosen], chosen), _wanted(tolerance))
    except TaskError as error:
        raise PathError(
            "the motion follows no smooth path within the tolerance",
            found=str(error),
            allowed=f"{tolerance:g} m and rad",
            where="path",
            hint="Where the tool stops and turns off, divide the file there; where positions are measured, say their "
            "noise, or raise the tolerance",
        ) from error
    path = build_path(segments, values[0], task_map.rows)
    s = _nearest(task_map, path, values, length / length[-1])
    miss = np.max(task_map.norms(task_map.difference(values, path.sample(s).target)))
    return Followed(tuple(segments), path, s, float(miss))


def _speed(task_map: TaskMap, q: np.ndarray, qdot: np.ndarray) -> np.ndarray:
    """Return the speed of what the path's length is made of, (K,): the position, or all joints."""
    if isinstance(task_map, JointSpace):
        return np.asarray(np.linalg.norm(qdot, axis=1))
    rates = np.einsum("kmn,kn->km", task_map.jacobian(task_map.twists(q)), qdot)
    return task_map.norms(rates)[0]


def _evenly(length: np.ndarray) -> np.ndarray:
    """Choose indices at about equal distances, the first and the last one among them."""
    places = np.searchsorted(length, np.linspace(0.0, length[-1], _POINTS)).clip(max=len(length) - 1)
    chosen = np.unique(np.concatenate([[0], places, [len(length) - 1]]))
    apart = np.diff(length[chosen]) > 1e-3 * length[-1] / _POINTS
    return chosen[np.concatenate([[True], apart[:-1], [True]])]


def _points(task_map: TaskMap, values: np.ndarray, chosen: np.ndarray) -> Points:
    """Make points of task coordinates, (K, c)."""
    turning = values[:, len(task_map.axes) or values.shape[1] :]
    if isinstance(task_map, Pose):
        from scipy.spatial.transform import Rotation  # noqa: PLC0415  (imports in 0.2 s)

        rotations = Rotation.from_matrix(turning.reshape(-1, 3, 3))
        turning = with_like_signs(np.roll(rotations.as_quat(), 1, axis=1))
    else:
        turning = np.unwrap(turning, axis=0)
    position = values[:, : len(task_map.axes) or values.shape[1]]
    return Points(position, turning, None, chosen, "the tool's path", "sample")


def _wanted(tolerance: float) -> Wanted:
    share = _SHARE * tolerance
    allowed = FitTolerance(position=share, orientation=share, corner=None)
    source = "the recorded motion"
    return Wanted(source, "path", allowed, "refuse", relative=False, orientation=None)


def _nearest(task_map: TaskMap, path: Path, values: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Return the path coordinates nearest to task coordinates, (K, c), from first guesses on; ascending."""
    s = s.copy()
    for _ in range(_STEPS):
        sample = path.sample(s)
        miss = task_map.difference(values, sample.target)
        s += np.sum(miss * sample.xi, axis=1) / np.sum(sample.xi**2, axis=1)
        np.clip(s, 0.0, 1.0, out=s)
    s[[0, -1]] = 0.0, 1.0
    return np.asarray(np.maximum.accumulate(s))
