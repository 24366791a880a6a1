"""Limits on the motion of the tool."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, Tag, field_validator, model_validator

from brachis.errors import write_count
from brachis.task.fields import Model, Number, Positive, Share, by_form, plain, refuse

_LEAST_TOLERANCE = 1e-3
_SPEED = {"ge": 1e-6, "le": 1e12}
_MOST_AT_A_PLACE = 2

Speed = Annotated[Positive, Field(**_SPEED)]
_PathCoordinates = Annotated[tuple[Annotated[Number, Field(ge=0.0, le=1.0)], ...], BeforeValidator(plain)]


class SpeedTable(Model):
    """Largest speed of the tool along the path: linear between places, and as at the nearest one beyond them.

    A step is two speeds at the same place; at the place itself the lower one of them holds.
    """

    s: Annotated[_PathCoordinates, Field(min_length=1)] = Field(
        description="Path coordinates, 0 to 1, ascending; the same one twice in a row is a step."
    )
    speed: Annotated[tuple[Speed, ...], BeforeValidator(plain)] = Field(
        description="Largest speed at each of them, m/s."
    )

    @model_validator(mode="after")
    def _is_a_table(self) -> SpeedTable:
        if len(self.speed) != len(self.s):
            problem = "there is not one speed for every path coordinate"
            raise refuse(problem, key=".speed", found=write_count(len(self.speed), "speed"), allowed=f"{len(self.s)}")
        for row in range(1, len(self.s)):
            if self.s[row] < self.s[row - 1]:
                problem = "the path coordinates do not ascend"
                raise refuse(problem, key=f".s[{row}]", found=self.s[row], allowed=f">= {self.s[row - 1]:g}")
        for place, same in itertools.groupby(self.s):
            if len(list(same)) > _MOST_AT_A_PLACE:
                problem = "a place has more than two speeds"
                raise refuse(problem, key=".s", found=place, allowed="a place at most twice, which is a step")
        return self


def _as_sequence(value: object) -> object:
    """Take one mapping for a list of it."""
    value = plain(value)
    return value if isinstance(value, list) else [value]


def _between(pair: tuple[float, float]) -> tuple[float, float]:
    if not pair[0] < pair[1]:
        raise refuse("the part of the path is empty", found=list(pair), allowed="[begin, end] with begin < end")
    return pair


class ProcessSpeed(Model):
    """A constant speed of the tool over a part of the path: what a glue nozzle or a laser needs."""

    speed: Speed = Field(description="Speed of the tool frame's origin, m/s.")
    s: Annotated[
        tuple[Annotated[Number, Field(ge=0.0, lt=1.0)], Annotated[Number, Field(gt=0.0, le=1.0)]],
        AfterValidator(_between),
    ] = Field(
        description="[begin, end], path coordinates between which it is held; outside, as fast as the limits allow. "
        "A part may begin or end with the path where boundary.start_speed or end_speed is its speed, or the motion is "
        "periodic."
    )
    tolerance: Annotated[Share, Field(ge=_LEAST_TOLERANCE, le=0.5)] = Field(
        default=0.01, description="Largest deviation either way, as a share of the speed: 1 %, or 0.01."
    )


class ToolLimits(Model):
    """Limits on the motion of the tool frame's origin, and on how fast the tool turns."""

    speed: Annotated[
        Annotated[Speed, Tag("<number>")] | Annotated[SpeedTable, Tag("<mapping>")] | Annotated[None, Tag("<null>")],
        by_form("a number > 0, a table {s: [...], speed: [...]}, or null (no limit)"),
    ] = Field(
        default=None,
        description="Largest speed, m/s, for the whole path; or a table over the path, {s: [...], speed: [...]}. "
        "Null: none.",
    )
    feed: tuple[SpeedTable, ...] = Field(
        default=(),
        description="Tables of largest speeds over parts of the path, and none beyond their first and last places; "
        "written by brachis from the feed rates of the path's points.",
    )
    acceleration: Speed | None = Field(default=None, description="Largest acceleration, m/s^2. Null: none.")
    angular_speed: Speed | None = Field(
        default=None,
        description="Largest speed at which the tool turns, rad/s; its free roll does not count. Null: none.",
    )
    process_speed: Annotated[tuple[ProcessSpeed, ...], BeforeValidator(_as_sequence)] = Field(
        default=(),
        description="Parts of the path with a constant speed: {speed, s, tolerance}, or a list of such, in order and "
        "with a gap in between in which the speed may change.",
    )

    @field_validator("process_speed")
    @classmethod
    def _apart(cls, parts: tuple[ProcessSpeed, ...]) -> tuple[ProcessSpeed, ...]:
        for number in range(1, len(parts)):
            if parts[number].s[0] <= parts[number - 1].s[1]:
                problem = "the parts of the path overlap, meet or are out of order"
                allowed = (
                    f"a begin above {parts[number - 1].s[1]:g}; the part before ends there, and speeds change in a gap"
                )
                raise refuse(problem, key=f"[{number}].s", found=list(parts[number].s), allowed=allowed)
        return parts

    @model_validator(mode="after")
    def _speeds_agree(self) -> ToolLimits:
        for number, part in enumerate(self.process_speed):
            cap, slowest = _least_between(self.speed, part.s), part.speed * (1.0 - part.tolerance)
            if cap is not None and cap < slowest:
                problem = "the tool's largest speed is below the process speed"
                allowed = f"at most {cap:g} m/s there, or a higher tool_limits.speed"
                raise refuse(problem, key=f".process_speed[{number}].speed", found=part.speed, allowed=allowed)
        return self


def _least_between(cap: float | SpeedTable | None, part: Sequence[float]) -> float | None:
    """Least of the largest speeds over a part of the path."""
    if not isinstance(cap, SpeedTable):
        return cap
    inside = [speed for s, speed in zip(cap.s, cap.speed, strict=True) if part[0] <= s <= part[1]]
    return min([*inside, *(_at(cap, place) for place in part)])


def _at(table: SpeedTable, place: float) -> float:
    """Largest speed at a place that may lie between two of the table's."""
    rows = list(zip(table.s, table.speed, strict=True))
    if place <= rows[0][0] or place >= rows[-1][0]:
        return rows[0 if place <= rows[0][0] else -1][1]
    for (s, speed), (s_next, next_speed) in itertools.pairwise(rows):
        if s < s_next and s <= place <= s_next:
            return speed + (next_speed - speed) * (place - s) / (s_next - s)
    raise AssertionError
