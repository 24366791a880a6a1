"""From the segments of a task to a path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from brachis.errors import PathError
from brachis.path.assembly import join_curves
from brachis.path.joint_coordinates import JointCoordinates
from brachis.path.pose_coordinates import PoseCoordinates
from brachis.path.row_coordinates import RowCoordinates
from brachis.robot.task_map.rows import POSE_ROWS, joints_of

if TYPE_CHECKING:
    from brachis.path.coordinates import Coordinates
    from brachis.path.frame import PathFrame
    from brachis.path.protocol import Array, Curve, Path
    from brachis.task import Segment


def build_path(
    segments: Sequence[Segment],
    start: Sequence[float] | Array,
    task_space_rows: Sequence[str],
    frame: PathFrame | None = None,
) -> Path:
    """Return the path that segments describe.

    Parameters
    ----------
    segments : sequence of Segment
        The segments of a task, at least one.
    start : array_like, shape (m,) or (12,)
        Task coordinates at the start posture, m and rad; of a pose the position and the rotation matrix row by row.
    task_space_rows : sequence of str
        Rows of the task space, out of x, y, z and yaw, where yaw comes last; x, y, z, rx, ry, rz for poses; or the rows
        of all joints (`brachis.robot.task_map.rows.joint_rows`).
    frame : PathFrame, optional
        Frame in which the segments are given; the world's unless given. The start is in the world either way.

    Returns
    -------
    Path
        The path in the world, three times continuously differentiable in s. For poses `PosePath`, whose samples have
        the body twist.

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
    coordinates = _coordinates(rows)
    point = coordinates.checked(np.array(start, dtype=float))
    if frame is not None:
        point = frame.to_frame(point)
    if not segments:
        problem = "a path needs at least one segment"
        raise PathError(problem, where="path")
    curves: list[Curve] = []
    for i, segment in enumerate(segments):
        curves.append(coordinates.curve(segment, i, point))
        point = curves[-1].derivatives(np.array([curves[-1].length]), 0)[0, 0]
    sequence = join_curves(curves, [segment.blend for segment in segments], coordinates)
    return coordinates.path(replace(sequence, frame=frame))


def _coordinates(rows: tuple[str, ...]) -> Coordinates:
    """Return what the coordinates of a task space with these rows are."""
    if joints_of(rows):
        return JointCoordinates(rows)
    return PoseCoordinates() if rows == POSE_ROWS else RowCoordinates(rows)
