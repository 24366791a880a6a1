"""Curves that a task file gives as B-splines."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from brachis.task.fields import Count, Flag, Model, Name, Number, Vector, refuse

JointOrder = Annotated[
    tuple[Name, ...] | None,
    Field(description="With task_space: joints, the joint of each coordinate; null: in the order of the chain."),
]
_SMOOTH = 3
"""Derivatives that a path must have."""


class BSplineCurve(Model):
    """A clamped B-spline, three times continuously differentiable; `brachis.bspline_segment` makes one of a curve."""

    degree: Count = Field(ge=4, le=15, description="Degree.")
    knots: Annotated[tuple[Number, ...], Field(min_length=2)] = Field(
        description="Knots, ascending: the first and the last one degree + 1 times, others up to degree - 3 times."
    )
    control_points: Annotated[tuple[Vector, ...], Field(min_length=2)] = Field(
        description="Control points: all rows of the task space each (m, yaw in rad); the first one is the segment's "
        "start."
    )
    relative: Flag = Field(default=False, description="Whether the curve is moved to the segment's start.")
    joints: JointOrder = None

    @model_validator(mode="after")
    def _knots_fit(self) -> BSplineCurve:
        knots, outer = self.knots, self.degree + 1
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
