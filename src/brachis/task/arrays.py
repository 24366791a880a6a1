"""Paths from arrays of positions and poses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypeVar

from pydantic import ValidationError

from brachis.task.fields import Model, plain
from brachis.task.fitted import Wanted, segments_along
from brachis.task.messages import task_error
from brachis.task.orientation import OrientationMode
from brachis.task.point_data import FileUnits, FitTolerance
from brachis.task.segments import BSplineSegment, SplineSegment

_SOURCE = "points"
_M = TypeVar("_M", bound=Model)


def fit_path(
    points: Any,  # noqa: ANN401  (arrays, lists, transforms of several libraries)
    *,
    tolerance: Mapping[str, float | str] | FitTolerance | None = None,
    orientations: Any = None,  # noqa: ANN401
    speed: Any = None,  # noqa: ANN401
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
        Points are wrong, or there is no smooth curve within the tolerance; the message names the row, from 0 on.

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
    from brachis.cam.arrays import points_from  # noqa: PLC0415  (NumPy, for those who need it)
    from brachis.cam.units import Units  # noqa: PLC0415

    stated = _checked(FileUnits, units or {}, "units")
    given = points_from(points, orientations, speed, Units(**stated.model_dump()), _SOURCE)
    allowed = None if tolerance is None else _checked(FitTolerance, tolerance, "tolerance")
    return tuple(segments_along(given, Wanted(_SOURCE, _SOURCE, allowed, corner, relative, orientation)))


def _checked(model: type[_M], value: object, key: str) -> _M:
    try:
        return model.model_validate(plain(value))
    except ValidationError as error:
        raise task_error(error, key, model) from None
