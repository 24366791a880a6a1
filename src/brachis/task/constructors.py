"""Segments as a program makes them: the models that a task file fills, from numbers, arrays and transforms.

Every function returns one segment; ``+`` joins segments to a path.

Paths from arrays of positions and poses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Protocol, TypeVar

from pydantic import ValidationError

from brachis.common.arguments import check_keywords
from brachis.task.fields import Model, plain
from brachis.task.fitted import Wanted, segments_along
from brachis.task.limit_kinds import Array
from brachis.task.messages import task_error
from brachis.task.orientation import OrientationMode
from brachis.task.point_data import FileUnits, FitTolerance
from brachis.task.segments import (
    ArcSegment,
    BSplineSegment,
    CircleSegment,
    HelixSegment,
    LineSegment,
    MovingSegment,
    SplineSegment,
)

_S = TypeVar("_S", bound=MovingSegment)


class Transform(Protocol):
    """A pose such as Pinocchio's ``SE3``."""

    @property
    def homogeneous(self) -> Any:
        """Return the homogeneous matrix, (4, 4)."""


Point = float | Array | Sequence[float]
Orientation = OrientationMode | dict[str, Any]


@check_keywords
def Line(  # noqa: N802
    *,
    to: Point | Transform | None = None,
    by: Point | None = None,
    length: float | None = None,
    angle_deg: float | None = None,
    blend: float | None = None,
    orientation: Orientation = None,
) -> LineSegment:
    """Make a straight line: `to` a point, `by` a displacement, or of a `length` in a direction.

    Parameters
    ----------
    to : float, (m,) array_like or SE3, optional
        End point, all rows of the task space: m, yaw in rad. A transform says how the tool is oriented there too.
    by : float or (m,) array_like, optional
        Displacement likewise.
    length : float, optional
        m; in the plane of two position rows.
    angle_deg : float, optional
        Direction, degrees, from the first towards the second position row; beside `length`.
    blend : float, optional
        Rounds the corner at the end: m taken from this segment and from the next one.
    orientation : str or mapping, optional
        How the tool turns along it, as in a task file.

    Raises
    ------
    TaskError
        None or several of the three are given, or a value is wrong.

    Examples
    --------
    >>> import brachis
    >>> path = brachis.Line(by=[0.1, 0.0], blend=0.02) + brachis.Line(by=[0.0, 0.2])
    >>> [segment.kind for segment in path]
    ['line', 'line']
    """
    if hasattr(to, "homogeneous"):
        ((place, turn),) = poses_of([to], "Line.to")
        to = place
        orientation = orientation or {"to": turn}
    return _segment(
        LineSegment,
        "line",
        blend,
        orientation,
        to=to,
        by=by,
        length=length,
        angle_deg=angle_deg,
    )


@check_keywords
def Arc(  # noqa: N802
    *,
    center: Point | None = None,
    angle_deg: float | None = None,
    normal: Point | None = None,
    via: Point | None = None,
    to: Point | None = None,
    yaw: Literal["fixed", "tangent"] | None = None,
    blend: float | None = None,
    orientation: Orientation = None,
) -> ArcSegment:
    """Make a circular arc: about a `center` by an angle, or `via` a point `to` another one.

    Parameters
    ----------
    center : (p,) array_like, optional
        m; the position rows.
    angle_deg : float, optional
        Swept angle, degrees, signed; beside `center`.
    normal : (3,) array_like, optional
        Axis of rotation, for three position rows; beside `center`.
    via, to : (p,) array_like, optional
        m; the position rows.
    yaw : {"fixed", "tangent"}, optional
        In task spaces with yaw.
    blend, orientation : optional
        As of `Line`.

    Raises
    ------
    TaskError
        See `Line`.

    Examples
    --------
    >>> import brachis
    >>> brachis.Arc(center=[0.5, 0.0], angle_deg=90)
    Arc(center=[0.5, 0], angle_deg=90)
    """
    shape = {
        "center": center,
        "angle_deg": angle_deg,
        "normal": normal,
        "via": via,
        "to": to,
        "yaw": yaw,
    }
    return _segment(ArcSegment, "arc", blend, orientation, **shape)


@check_keywords
def Circle(  # noqa: N802
    center: Point,
    *,
    turns: float = 1.0,
    normal: Point | None = None,
    yaw: Literal["fixed", "tangent"] | None = None,
    blend: float | None = None,
    orientation: Orientation = None,
) -> CircleSegment:
    """Make whole or fractional turns about a centre.

    Parameters
    ----------
    center : (p,) array_like
        m; the position rows.
    turns : float, optional
        Signed as an arc's angle; not zero.
    normal, yaw, blend, orientation : optional
        As of `Arc`.

    Raises
    ------
    TaskError
        A value is wrong.

    Examples
    --------
    >>> import brachis
    >>> brachis.Circle([0.5, 0.0], turns=2)
    Circle(center=[0.5, 0], turns=2)
    """
    return _segment(
        CircleSegment,
        "circle",
        blend,
        orientation,
        center=center,
        turns=turns,
        normal=normal,
        yaw=yaw,
    )


@check_keywords
def Helix(  # noqa: N802
    center: Point,
    *,
    pitch: float,
    normal: Point = (0.0, 0.0, 1.0),
    turns: float = 1.0,
    blend: float | None = None,
    orientation: Orientation = None,
) -> HelixSegment:
    """Make turns about an axis that climb along it, in three position rows.

    Parameters
    ----------
    center : (3,) array_like
        m; of the first turn, in the plane through the segment's start that is perpendicular to the axis.
    pitch : float
        Climb of each turn along the normal, m.
    normal : (3,) array_like, optional
        The axis; upwards unless given.
    turns : float, optional
        Signed about the normal; not zero.
    blend, orientation : optional
        As of `Line`.

    Raises
    ------
    TaskError
        A value is wrong.

    Examples
    --------
    >>> import brachis
    >>> brachis.Helix([0.5, 0.0, 0.3], pitch=0.02, turns=3)
    Helix(center=[0.5, 0, 0.3], turns=3, pitch=0.02, normal=[0, 0, 1])
    """
    return _segment(
        HelixSegment,
        "helix",
        blend,
        orientation,
        center=center,
        pitch=pitch,
        normal=normal,
        turns=turns,
    )


@check_keywords
def Spline(  # noqa: N802
    through: Array | Sequence[Point | Transform],
    *,
    orientations: Array | Sequence[Any] | None = None,
    relative: bool = False,
    blend: float | None = None,
    orientation: Orientation = None,
) -> SplineSegment:
    """Make a smooth curve through waypoints, from the end of the segment before it or the path's start.

    `fit_path` takes points within a tolerance, and the first one as the path's beginning.

    Parameters
    ----------
    through : (n, m) or (n, 4, 4) array_like, or sequence of SE3
        All rows of the task space each, m, yaw in rad; or poses. The segment's start may be the first of them.
    orientations : SciPy's Rotation or (n, 3, 3) array_like, optional
        Of the tool, beside positions; ``Rotation.from_quat(q)`` takes quaternions x, y, z, w.
    relative : bool, optional
        Whether the waypoints are relative to the segment's start.
    blend, orientation : optional
        As of `Line`.

    Raises
    ------
    TaskError
        A value is wrong; the message names the row, from 0 on.

    Examples
    --------
    >>> import brachis
    >>> import numpy as np
    >>> x = np.linspace(0.1, 0.5, 500)
    >>> wave = brachis.Spline(through=np.column_stack([x, np.sin(x)]), relative=True)
    >>> len(wave.spline.through)
    500
    """
    if orientations is None and _are_positions(through):
        points = [_vector(point) for point in through]  # type: ignore[union-attr]
        return _segment(
            SplineSegment,
            "spline",
            blend,
            orientation,
            through=points,
            relative=relative,
        )
    poses = poses_of(through, "Spline.through", orientations)
    shape = {
        "through": [place for place, _ in poses],
        "orientations": [turn for _, turn in poses],
    }
    return _segment(
        SplineSegment, "spline", blend, orientation, relative=relative, **shape
    )


def _are_positions(through: object) -> bool:
    """Tell rows of numbers from transforms."""
    rows = plain(through)
    first = rows[0] if isinstance(rows, list) and rows else None
    return isinstance(first, int | float) or (
        isinstance(first, list) and not any(isinstance(c, list) for c in first)
    )


def poses_of(
    transforms: Any, source: str, orientations: Any = None
) -> list[tuple[list[float], dict[str, Any]]]:
    """Positions, m, and orientations as a task file writes them."""
    from brachis.task.points.points import points_from

    points = points_from(transforms, orientations, None, FileUnits(), source, least=1)
    turns = [{"quaternion_wxyz": turn} for turn in points.turning.tolist()]
    return list(zip(points.position.tolist(), turns, strict=True))


def _vector(value: object) -> object:
    """Return a number as the one coordinate that it is."""
    value = plain(value)
    return [value] if isinstance(value, int | float) else value


def _segment(
    model: type[_S],
    kind: str,
    blend: float | None,
    orientation: Orientation,
    **shape: object,
) -> _S:
    """Validate what is given of a segment."""
    given = {
        key: _vector(value) if key in {"to", "by"} else value
        for key, value in shape.items()
        if value is not None
    }
    content = {kind: given, "blend": blend, "orientation": orientation}
    try:
        return model.model_validate(
            plain({key: value for key, value in content.items() if value is not None})
        )
    except ValidationError as error:
        raise task_error(error, kind.capitalize(), model) from None


_SOURCE = "points"
_M = TypeVar("_M", bound=Model)


def fit_path(
    points: Any,
    *,
    tolerance: Mapping[str, float | str] | FitTolerance | None = None,
    orientations: Any = None,
    speed: Any = None,
    units: Mapping[str, str] | FileUnits | None = None,
    corner: Literal["blend", "refuse"] = "blend",
    orientation: OrientationMode = None,
    relative: bool = False,
) -> tuple[SplineSegment | BSplineSegment, ...]:
    """Return the segments of a path along points, the first one included; for the ``path`` of a task.

    Parameters
    ----------
    points : array_like, (n, p) or (n, 4, 4), or sequence of transforms
        Positions in the rows of the task space; or homogeneous matrices; or objects with such a matrix: Pinocchio's
        ``SE3``, or SciPy's ``RigidTransform``.
    tolerance : mapping or FitTolerance, optional
        ``{"position": "0.05 mm", "orientation": "0.1 deg"}`` as in a task file; without it the path passes all points.
    orientations : Rotation, or array_like, (n, 3, 3) or (n,), optional
        Of the tool, beside positions: SciPy's rotations (``Rotation.from_quat(q)`` takes quaternions x, y, z, w);
        rotation matrices; yaw.
    speed : array_like, (n,), optional
        Speed of the tool on the way to each point; NaN where none is prescribed. With a tolerance only.
    units : mapping or FileUnits, optional
        ``{"length": "mm", "angle": "deg", "speed": "mm/min"}``; m, rad (of yaw) and m/s unless given.
    corner : {"blend", "refuse"}, optional
        As in a task file.
    orientation : optional
        How the tool turns along the path where no orientations are given, as in a task file.
    relative : bool, optional
        Whether the path may start anywhere, as in a task file.

    Returns
    -------
    tuple of SplineSegment or BSplineSegment
        One, or as many as there are stretches between corners.

    Raises
    ------
    TaskError
        Points are wrong, or no smooth curve lies within the tolerance; the message names the row, from 0 on.

    Examples
    --------
    >>> import numpy as np
    >>> angle = np.linspace(0.0, 1.5, 500)
    >>> circle = np.column_stack([200.0 * np.cos(angle), 200.0 * np.sin(angle)])
    >>> from brachis import fit_path
    >>> path = fit_path(circle, tolerance={"position": "0.01 mm"}, units={"length": "mm"})
    >>> path[0].bspline.fit.intervals < 5
    True
    """
    from brachis.task.points.points import points_from

    stated = _validate(FileUnits, units or {}, "units")
    given = points_from(points, orientations, speed, stated, _SOURCE)
    allowed = (
        None if tolerance is None else _validate(FitTolerance, tolerance, "tolerance")
    )
    return tuple(
        segments_along(
            given, Wanted(_SOURCE, _SOURCE, allowed, corner, relative, orientation)
        )
    )


def _validate(model: type[_M], value: object, key: str) -> _M:
    try:
        return model.model_validate(plain(value))
    except ValidationError as error:
        raise task_error(error, key, model) from None
