"""Rows that a path prescribes, tolerances within which the tool may leave the path, and margins of the arm."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from brachis.task.fields import (
    POSITION,
    ByForm,
    CheckedModel,
    Mistake,
    Model,
    NonEmpty,
    Number,
    Positive,
    must,
    refuse,
)

Row = Literal["x", "y", "z", "roll", "pitch", "yaw", "axis"]
_SPACE_FORMS = (
    "a list of some of x, y, z, then at most one of roll, pitch, yaw, axis; "
    "or one of the words position, pose, pose_free_roll, axis, joints, free"
)

EACH_ONCE = must(
    lambda names: len(set(names)) == len(names),
    "a name occurs twice",
    "each name once",
)
_ANGLE_LAST = must(
    lambda rows: {*rows[:-1]} <= {*POSITION},
    "only one row of rotation is possible, and it must be the last",
    "for example [x, y, z, yaw] or [x, y, axis]",
)


def _name_space(space: str | tuple[str, ...]) -> str | tuple[str, ...]:
    """Return the standard name of a task space, so that equal task spaces compare equal."""
    if space == (*POSITION, "axis"):
        return "pose_free_roll"
    return {"position": POSITION, "axis": ("axis",)}.get(str(space), space)


TaskSpace = Annotated[
    Literal["position", "pose", "pose_free_roll", "axis", "joints", "free"]
    | Annotated[NonEmpty[Row], EACH_ONCE, _ANGLE_LAST],
    ByForm(_SPACE_FORMS),
    AfterValidator(_name_space),
]


_Given = float | tuple[float, float] | Literal["free"] | None
_FORMS = "a number > 0, or [low, high] with low < high"
_FARTHEST = 10.0
"""Maximum tolerance of the position, m."""


def _range_within(largest: float) -> AfterValidator:
    """Return a validator that reads a number a as [-a, a], and refuses empty ranges and ends too far from zero."""

    def read(value: _Given) -> _Given:
        """Return a range as a pair [low, high]."""
        if value is None or value == "free":
            return value
        low, high = value if isinstance(value, tuple) else (-value, value)
        if not -largest <= low < high <= largest:
            raise refuse(
                "this is not a valid range",
                found=value,
                allowed=f"{_FORMS}, all within {largest:g} of zero",
            )
        return low, high

    return AfterValidator(read)


_Ends = Annotated[Positive | tuple[Number, Number] | None, ByForm(_FORMS)]
_EndsOrFree = Annotated[
    Literal["free"] | Positive | tuple[Number, Number] | None,
    ByForm(f"{_FORMS}, or free"),
]
_Lean = Annotated[_Ends, _range_within(80.0)]
_Roll = Annotated[_EndsOrFree, _range_within(180.0)]
_Distance = Annotated[_Ends, _range_within(_FARTHEST)]


def _ranges_outside(
    model: Model, largest: str, ranges: Iterable[str]
) -> Iterator[Mistake]:
    """Yield the ranges that lie entirely outside the cone or sphere of the same model."""
    reach = getattr(model, largest)
    for key in ranges:
        ends = getattr(model, key)
        if reach is not None and ends is not None and min(-ends[0], ends[1]) <= -reach:
            yield (
                key,
                f"the range lies outside {largest}: {reach:g}",
                f"a range that reaches to within {reach:g} of zero",
            )


class OrientationTolerance(CheckedModel):
    """Ranges within which the tool may turn, about the axes of its frame, away from the path's orientation."""

    tilt: Annotated[Positive, Field(le=80.0)] | None = None
    """Maximum angle between the tool's z axis and that of the path, degrees: a cone. Null: only lead and side apply."""
    lead: _Lean = None
    """Angle by which the z axis leans towards the x axis of the path's orientation, degrees: a number for both sides,
    or [low, high]. If x points along the path and z out of the torch, positive angles are lead and negative angles lag.
    """
    side: _Lean = None
    """Angle by which the z axis leans towards the y axis of the path's orientation, degrees."""
    roll: _Roll = None
    """Angle by which the tool turns about its own z axis, degrees: a number, [low, high], or free."""

    def _mistakes(self) -> Iterator[Mistake]:
        return _ranges_outside(self, "tilt", ("lead", "side"))


class PositionTolerance(CheckedModel):
    """Ranges within which the tool may leave the position of the path."""

    sphere: Annotated[Positive, Field(le=_FARTHEST)] | None = None
    """Maximum distance from the position of the path, m."""
    x: _Distance = None
    """Displacement along x, m: a number for both sides, or [low, high]. With task_space: position, the path has no
    orientation; the axes are then those of the tool itself."""
    y: _Distance = None
    """Displacement along y, m."""
    z: _Distance = None
    """Displacement along z, m."""
    axes: Literal["tool", "world"] = "tool"
    """Axes of x, y and z: those of the path's orientation (tool) or of the world."""

    def _mistakes(self) -> Iterator[Mistake]:
        axes = [axis for axis in POSITION if getattr(self, axis) is not None]
        yield from _ranges_outside(self, "sphere", axes)
        if self.axes == "world" and len(axes) < len(POSITION):
            yield (
                "axes",
                "a box along the world's axes needs all three ranges",
                f"x, y and z together (given: {' and '.join(axes) or 'none'}), or axes: tool",
            )


class Tolerances(Model):
    """Tolerances within which the tool may leave the path."""

    orientation: OrientationTolerance = Field(default_factory=OrientationTolerance)
    """Tolerances of the orientation: {tilt: 15}, in degrees."""
    position: PositionTolerance = Field(default_factory=PositionTolerance)
    """Tolerances of the position: {sphere: 0.002}, in m."""


class Margins(Model):
    """Margins that the motion must keep. The smallest margins of a motion are reported even if none are set."""

    singularity: Positive | None = None
    """Minimum allowed singular value of the Jacobian of the rows of the task space with respect to the arm's own joints
    (m and rad per rad and m), without tolerances and free roll. Null: none."""
    joint_ends: Annotated[Positive, Field(lt=0.5)] | None = None
    """Fraction of each joint's range to keep free at each end, such as 0.05. Null: none."""
