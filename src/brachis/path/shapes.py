"""The curve of the task coordinates, or of a pose's position, for every form of segment."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, NoReturn

from brachis.errors import PathError
from brachis.path.curves import (
    arc_center,
    arc_via,
    circle,
    helix,
    line_by,
    line_heading,
    line_to,
)
from brachis.path.splines import bspline_curve, spline_through
from brachis.task.fields import Model
from brachis.task.point_data import PointFile
from brachis.task.segments import (
    ArcCenter,
    ArcVia,
    BSplineCurve,
    CircleTurns,
    HelixTurns,
    LineBy,
    LineHeading,
    LineTo,
    SplineThrough,
)

if TYPE_CHECKING:
    from brachis.path.protocol import Curve
    from brachis.path.site import Site


def _unread(shape: PointFile, site: Site) -> NoReturn:
    raise PathError(
        "the file has not been read",
        found=shape.file,
        allowed="a curve",
        where=f"{site.key}.file",
        hint="brachis.load_task reads it and makes a curve of it",
    )


BUILDERS: Final[dict[type[Model], Callable[[Any, Site], Curve]]] = {
    LineTo: line_to,
    LineBy: line_by,
    LineHeading: line_heading,
    ArcCenter: arc_center,
    ArcVia: arc_via,
    CircleTurns: circle,
    HelixTurns: helix,
    SplineThrough: spline_through,
    BSplineCurve: bspline_curve,
    PointFile: _unread,
}
"""For every form of segment, the function that makes its curve."""


def curve_of(shape: Model, site: Site) -> Curve:
    """Return the curve of a segment in all rows of the site."""
    return BUILDERS[type(shape)](shape, site)
