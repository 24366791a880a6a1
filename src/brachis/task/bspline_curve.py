"""Curves that a task gives as B-splines; fits to points become such curves."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

from pydantic import Field, model_validator

from brachis.task.fields import Count, Flag, Model, Number, Positive, Vector, refuse
from brachis.task.point_data import FitReport

_SMOOTH = 4


class BSplineCurve(Model):
    """A B-spline curve, given by its knots and control points."""

    degree: Annotated[Count, Field(ge=_SMOOTH, le=15)] = Field(default=5, description="Degree.")
    knots: Vector = Field(
        description="Knots, ascending, the first and the last one degree + 1 times; in m along the curve, where blends "
        "and speeds are to be so. Inner ones "
        "leave three continuous derivatives: degree 5 allows each twice."
    )
    control_points: Annotated[tuple[Vector, ...], Field(min_length=_SMOOTH + 1)] = Field(
        description="Control points: all rows of the task space (m, yaw in rad); in task spaces of poses x, y, z, or "
        "x, y, z, qw, qx, qy, qz, whose orientation is that of the quaternion divided by its length."
    )
    relative: Flag = Field(
        default=False, description="Whether the curve is moved to the segment's start, wherever that is; as for csv."
    )
    speeds: tuple[tuple[tuple[Number, Positive], ...], ...] = Field(
        default=(),
        description="Tables of the speed of the tool that is prescribed along the curve: [m along it, m/s], linear in "
        "between; where there is none, none is prescribed.",
    )
    fit: FitReport | None = Field(default=None, description="What the curve was fitted to; written by brachis.")

    @model_validator(mode="after")
    def _fits_together(self) -> BSplineCurve:
        count, degree, knots = len(self.control_points), self.degree, self.knots
        if len(knots) != count + degree + 1:
            problem = "wrong number of knots for these control points"
            raise refuse(problem, key=".knots", found=len(knots), allowed=f"{count + degree + 1}")
        if len({len(point) for point in self.control_points}) > 1:
            raise refuse("control points differ in their number of coordinates", key=".control_points", allowed="one")
        ascending = all(one <= other for one, other in pairwise(knots))
        inner = knots[degree + 1 : -degree - 1]
        clamped = len({*knots[: degree + 1]}) == len({*knots[-degree - 1 :]}) == 1
        smooth = all(inner.count(knot) <= degree - 3 for knot in set(inner)) and not {knots[0], knots[-1]} & {*inner}
        if not (ascending and clamped and smooth and knots[0] < knots[-1]):
            allowed = f"ascending, the ends {degree + 1} times, inner ones at most {degree - 3} times"
            raise refuse("the knots give no curve with three continuous derivatives", key=".knots", allowed=allowed)
        return self
