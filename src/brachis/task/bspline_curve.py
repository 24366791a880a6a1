"""Curves that a task gives as B-splines; fits to points become such curves."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from brachis.task.fields import Count, Flag, Model, Name, Number, Positive, Vector, refuse
from brachis.task.point_data import FitReport

JointOrder = Annotated[
    tuple[Name, ...] | None,
    Field(description="With task_space: joints, the joint of each coordinate; null: in the order of the chain."),
]
_SMOOTH = 3
"""Derivatives that a path must have."""


class BSplineCurve(Model):
    """A clamped B-spline, three times continuously differentiable; `brachis.bspline_segment` makes one of a curve."""

    degree: Annotated[Count, Field(ge=_SMOOTH + 1, le=15)] = Field(default=5, description="Degree.")
    knots: Vector = Field(
        description="Knots, ascending: the first and the last one degree + 1 times, others up to degree - 3 times; "
        "in m along the curve, where blends and speeds are to be so."
    )
    control_points: Annotated[tuple[Vector, ...], Field(min_length=_SMOOTH + 2)] = Field(
        description="Control points: all rows of the task space (m, yaw in rad); in task spaces of poses x, y, z, or "
        "x, y, z, qw, qx, qy, qz, whose orientation is that of the quaternion divided by its length."
    )
    relative: Flag = Field(
        default=False, description="Whether the curve is moved to the segment's start, wherever that is; as for csv."
    )
    joints: JointOrder = None
    speeds: tuple[tuple[tuple[Number, Positive], ...], ...] = Field(
        default=(),
        description="Tables of the speed of the tool that is prescribed along the curve: [m along it, m/s], linear in "
        "between; where there is none, none is prescribed.",
    )
    fit: FitReport | None = Field(default=None, description="What the curve was fitted to; written by brachis.")

    @model_validator(mode="after")
    def _knots_fit(self) -> BSplineCurve:
        knots, outer = self.knots, self.degree + 1
        if len({len(point) for point in self.control_points}) > 1:
            raise refuse("control points differ in their number of coordinates", key=".control_points", allowed="one")
        if len(knots) != len(self.control_points) + outer:
            allowed = f"{len(self.control_points) + outer}: control points + degree + 1"
            raise refuse("wrong number of knots", key=".knots", found=len(knots), allowed=allowed)
        ends = set(knots[:outer]), set(knots[-outer:])
        inner = knots[outer:-outer]
        most = max((inner.count(knot) for knot in inner), default=0)
        if list(knots) != sorted(knots) or any(len(end) > 1 for end in ends) or ends[0] == ends[1]:
            allowed = "ascending knots, the first and the last one degree + 1 times"
            raise refuse("the B-spline is not clamped", key=".knots", found=list(knots), allowed=allowed)
        if most > self.degree - _SMOOTH or {*inner} & (ends[0] | ends[1]):
            problem = "a knot occurs so often that a derivative up to the third jumps"
            raise refuse(problem, key=".knots", found=most, allowed=f"{self.degree - _SMOOTH} times at most")
        return self
