"""From the segments of a task to a path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError, UnknownNameError
from brachis.path.pose import POSITIONS, PosePath, rotations
from brachis.path.pose_segment import pose_curve
from brachis.path.rotations import matrix, quaternion_of
from brachis.path.sequence import join_curves
from brachis.path.shapes import curve_of
from brachis.path.site import Site
from brachis.robot.task_map.rows import POSE_COORDINATES, POSE_ROWS, ROWS
from brachis.task import TurnSegment

if TYPE_CHECKING:
    from brachis.path.protocol import Array, Curve, Path
    from brachis.task import Segment

_ROTATION_TOLERANCE = 1e-6


def build_path(segments: Sequence[Segment], start: Sequence[float] | Array, task_space_rows: Sequence[str]) -> Path:
    """Return the path that segments describe.

    Parameters
    ----------
    segments : sequence of Segment
        The segments of a task, at least one.
    start : array_like, shape (m,) or (12,)
        Task coordinates at the start posture, m and rad; of a pose the position and the rotation matrix row by row.
    task_space_rows : sequence of str
        Rows of the task space, out of x, y, z and yaw, where yaw comes last; or x, y, z, rx, ry, rz for poses.

    Returns
    -------
    Path
        The path, three times continuously differentiable in s. For poses `PosePath`, whose samples have the body twist.

    Raises
    ------
    PathError
        A segment does not fit the task space, has zero length or is not defined; or the path has a corner that is not
        blended, or a blend that does not fit. The message names the key.
    UnknownNameError
        There is no such row.

    Examples
    --------
    >>> from brachis.task import LineBy, LineSegment
    >>> path = build_path([LineSegment(line=LineBy(by=(0.0, 2.0)))], [1.0, 0.0], ["x", "y"])
    >>> path.sample([0.5]).target.tolist()
    [[1.0, 1.0]]
    """
    rows = tuple(task_space_rows)
    point = _checked_start(start, rows)
    if not segments:
        problem = "a path needs at least one segment"
        raise PathError(problem, where="path")
    curves: list[Curve] = []
    for i, segment in enumerate(segments):
        curve = pose_curve(segment, i, point) if rows == POSE_ROWS else _row_curve(segment, i, point, rows)
        curves.append(curve)
        point = curve.derivatives(np.array([curve.length]), 0)[0, 0]
    path = join_curves(curves, [segment.blend for segment in segments], rows)
    return PosePath(path) if rows == POSE_ROWS else path


def _row_curve(segment: Segment, index: int, start: Array, rows: tuple[str, ...]) -> Curve:
    """Return the curve of a segment in a task space of rows, where the tool's orientation is not prescribed."""
    found, hint = f"task_space [{', '.join(rows)}]", "Set task_space: pose"
    if isinstance(segment, TurnSegment):
        problem = "a turn is for task spaces of poses"
        if "yaw" in rows:
            hint = "Use line: {by: [0, 0, ...]} to turn yaw"
        raise PathError(problem, found=found, where=f"path[{index}].turn", hint=hint)
    if segment.orientation is not None:
        problem = "an orientation along a segment is for task spaces of poses"
        raise PathError(problem, found=found, where=f"path[{index}].orientation", hint=hint)
    return curve_of(segment.shape, Site(f"path[{index}].{segment.kind}", start, rows))


def _checked_start(start: Sequence[float] | Array, rows: tuple[str, ...]) -> Array:
    point = np.array(start, dtype=float)
    if rows == POSE_ROWS:
        return _checked_pose(point)
    for row in rows:
        if row not in ROWS:
            raise UnknownNameError(kind="row of the task space", name=row, valid=ROWS, where="task_space")
    if point.shape != (len(rows),) or not np.all(np.isfinite(point)):
        problem = "the start of the path needs one finite coordinate for each row of the task space"
        raise PathError(problem, found=point.tolist(), allowed=f"[{', '.join(rows)}]", where="start")
    return point


def _checked_pose(point: Array) -> Array:
    """Return the coordinates of a pose with the rotation matrix freed of rounding."""
    allowed = "the position (3), then a rotation matrix row by row (9)"
    if point.shape != (POSE_COORDINATES,) or not np.all(np.isfinite(point)):
        problem = "the start of a path of poses needs 12 finite coordinates"
        raise PathError(problem, found=point.tolist(), allowed=allowed, where="start")
    rotation = rotations(point)
    nearest = matrix(quaternion_of(rotation))
    if np.abs(rotation - nearest).max() > _ROTATION_TOLERANCE:
        problem = "the start of the path has no rotation matrix"
        raise PathError(problem, found=rotation.tolist(), allowed=allowed, where="start")
    return np.concatenate([point[:POSITIONS], nearest.ravel()])
