"""From the segments of a task to a path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from brachis.errors import PathError, UnknownNameError
from brachis.path.arc import arc_center, arc_via, circle
from brachis.path.line import line_by, line_heading, line_to
from brachis.path.sequence import join_curves
from brachis.path.site import Site
from brachis.path.spline import spline_through
from brachis.task import ArcCenter, ArcVia, Circle, LineBy, LineHeading, LineTo, SplineThrough

if TYPE_CHECKING:
    from brachis.path.protocol import Array, Curve, Path
    from brachis.task import Segment, Shape

ROWS: Final = ("x", "y", "z", "yaw")

BUILDERS: Final[dict[type[Shape], Callable[[Any, Site], Curve]]] = {
    LineTo: line_to,
    LineBy: line_by,
    LineHeading: line_heading,
    ArcCenter: arc_center,
    ArcVia: arc_via,
    Circle: circle,
    SplineThrough: spline_through,
}
"""For every form of segment, the function that makes its curve."""


def build_path(segments: Sequence[Segment], start: Sequence[float] | Array, task_space_rows: Sequence[str]) -> Path:
    """Return the path that segments describe.

    Parameters
    ----------
    segments : sequence of Segment
        The segments of a task, at least one.
    start : array_like, shape (m,)
        Task coordinates at the start posture, m and rad.
    task_space_rows : sequence of str
        Rows of the task space, out of x, y, z and yaw; yaw comes last.

    Returns
    -------
    Path
        The path, three times continuously differentiable in s.

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
        shape = segment.shape
        curve = BUILDERS[type(shape)](shape, Site(f"path[{i}].{segment.kind}", point, rows))
        curves.append(curve)
        point = curve.derivatives(np.array([curve.length]), 0)[0, 0]
    return join_curves(curves, [segment.blend for segment in segments], rows)


def _checked_start(start: Sequence[float] | Array, rows: tuple[str, ...]) -> Array:
    for row in rows:
        if row not in ROWS:
            raise UnknownNameError(kind="row of the task space", name=row, valid=ROWS, where="task_space")
    point = np.array(start, dtype=float)
    if point.shape != (len(rows),) or not np.all(np.isfinite(point)):
        problem = "the start of the path needs one finite coordinate for each row of the task space"
        raise PathError(problem, found=point.tolist(), allowed=f"[{', '.join(rows)}]", where="start")
    return point
