"""Joint limits as the task file describes them.

For ``torque``, ``velocity`` and ``position`` three cases differ: the key is absent, and the limit comes from the URDF;
the key is null, and nothing limits the joint; the key has a value. The models write the absent key as `FROM_URDF`,
which a task file may also spell out. Thus absent and null stay distinguishable in comparisons and in saved tasks. A
joint that a mapping leaves out keeps the limit of the URDF. A URDF has no ``acceleration``, ``jerk`` or
``torque_rate``: absent means none.

Limits on the motion of the tool.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, make_dataclass
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Unpack

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    Tag,
    field_validator,
    model_validator,
)

from brachis.errors import write_count
from brachis.task.fields import (
    Model,
    Name,
    NonNegative,
    Number,
    Positive,
    Share,
    by_form,
    plain,
    refuse,
)
from brachis.task.limit_kinds import LIMIT_KINDS, LimitKeywords, LimitScale

FROM_URDF: Final = "urdf"
"""The value of a limit whose key is absent: the URDF supplies it."""


_LIMIT_FORMS = (
    "a number > 0 for all joints, a list of numbers > 0, "
    "a mapping of joint name to number > 0 or null, null (no limit)"
)


def _increasing(
    pair: tuple[float | None, float | None],
) -> tuple[float | None, float | None]:
    if None not in pair and not pair[0] < pair[1]:  # type: ignore[operator]
        problem = "the lower limit must be below the upper one"
        raise refuse(problem, found=list(pair), allowed="[low, high] with low < high")
    return pair


Interval = Annotated[tuple[Number | None, Number | None], AfterValidator(_increasing)]


def _around_zero(pair: tuple[float, float]) -> tuple[float, float]:
    if not pair[0] < 0.0 < pair[1]:
        problem = "a pair of limits lies around zero"
        raise refuse(
            problem, found=list(pair), allowed="[lower, upper] with lower < 0 < upper"
        )
    return pair


OneNumber = Annotated[Positive, Tag("<number>")]
_Pair = Annotated[
    Annotated[tuple[Number, Number], AfterValidator(_around_zero)], Tag("<list>")
]
_Entry = Annotated[
    OneNumber | _Pair, by_form("a number > 0, or a pair [lower, upper] around zero")
]
_EntryOrNull = Annotated[
    OneNumber | _Pair | Annotated[None, Tag("<null>")],
    by_form("a number > 0, a pair [lower, upper] around zero, null (no limit)"),
]
Numbers = Annotated[Annotated[tuple[Positive, ...], Field(min_length=1)], Tag("<list>")]
_Mapping = Annotated[dict[Name, Positive | None], Tag("<mapping>")]
Null = Annotated[None, Tag("<null>")]
UrdfWord = Annotated[Literal["urdf"], Tag("<word>")]

UrdfLimit = Annotated[
    UrdfWord
    | OneNumber
    | Annotated[Annotated[tuple[_Entry, ...], Field(min_length=1)], Tag("<list>")]
    | Annotated[dict[Name, _EntryOrNull], Tag("<mapping>")]
    | Null,
    by_form(
        "a number > 0 for all joints; a list, or a mapping of joint name to a number > 0, a pair [lower, upper] around "
        "zero or null; null (no limit), urdf (as in the URDF)",
        FROM_URDF,
    ),
]
OwnLimit = Annotated[OneNumber | Numbers | _Mapping | Null, by_form(_LIMIT_FORMS)]
PositionLimit = Annotated[
    UrdfWord
    | Annotated[Annotated[tuple[Interval, ...], Field(min_length=1)], Tag("<list>")]
    | Annotated[dict[Name, Interval | None], Tag("<mapping>")]
    | Null,
    by_form(
        "a list of [low, high], a mapping of joint name to [low, high] or null, null (no limit), urdf (as in the URDF)",
        FROM_URDF,
    ),
]
TorqueCurve = Annotated[
    tuple[tuple[NonNegative, NonNegative], ...], Field(min_length=2)
]
"""Points [speed, torque]."""

_FORMS = {"number": OwnLimit, "pair": UrdfLimit, "range": PositionLimit}
_JointLimits: Any = make_dataclass(
    "_JointLimits",
    [
        (
            row.name,
            Annotated[_FORMS[row.form], Field(description=row.description)],
            None if row.form == "number" else FROM_URDF,
        )
        for row in LIMIT_KINDS.values()
    ],
    frozen=True,
)


@dataclass(frozen=True)
class LimitSpec(_JointLimits):  # type: ignore[misc]
    """Joint limits: an absent key takes the URDF's, null removes the limit (see the module's documentation).

    They are checked when a robot is made with them, whose joints are known.

    Parameters
    ----------
    torque, velocity : float, sequence, array, mapping or None, optional
        Nm or N; rad/s or m/s. One number for all joints, one for each in chain order, or numbers by joint name; a pair
        [lower, upper] around zero in the place of a joint's number; None, also for a single joint: not limited;
        `FROM_URDF`: as in the URDF.
    position : sequence, array, mapping or None, optional
        Pairs [lower, upper], rad or m, likewise; an end that is None is open.
    acceleration, power, rms_torque, jerk, torque_rate : float, sequence, array, mapping or None, optional
        rad/s^2 or m/s^2; W; Nm or N; rad/s^3 or m/s^3; Nm/s or N/s. One number, numbers or None as for the torque. The
        last two need ``spline.degree`` >= 3 and acceleration at rest.
    scale : mapping or LimitScale, optional
        Factors on limits, applied after all else.
    total_power : float or None, optional
        W.
    torque_speed : mapping of str to (p, 2) array or sequence of pairs, optional
        Points [speed, torque] by joint name.

    Examples
    --------
    >>> import brachis
    >>> brachis.LimitSpec(torque={"j1": 12.0}, velocity=2.0).velocity
    2.0
    """

    scale: Annotated[LimitScale, Field(description="Factors on the limits.")] = field(
        default_factory=LimitScale
    )
    total_power: Annotated[
        Positive | None,
        Field(
            description="Largest sum of the joints' powers, drawn or returned, W. Absent or null: none."
        ),
    ] = None
    torque_speed: Annotated[
        dict[Name, TorqueCurve | None] | None,
        Field(
            description="Torque limits that fall with speed, by joint name: points [speed, torque] from speed 0 on, "
            "rad/s and N m at the joint (m/s, N), joined by a line that never rises; the last slope goes on to zero "
            "torque. The same both ways, driving and braking. Absent or null: none."
        ),
    ] = None

    __pydantic_config__ = Model.model_config

    if TYPE_CHECKING:

        def __init__(self, **limits: Unpack[LimitKeywords]) -> None: ...

    def __post_init__(self) -> None:
        """Take arrays for plain numbers, and a mapping for the scale."""
        if not isinstance(self.scale, LimitScale):
            given = self.scale or {}
            factors = {kind: plain(factor) for kind, factor in given.items()}
            scale = LimitScale().model_copy(update=factors)
            object.__setattr__(self, "scale", scale)
        for each in fields(self):
            value = plain(getattr(self, each.name), tuple)
            object.__setattr__(self, each.name, value)


_SPEED = {"ge": 1e-6, "le": 1e12}

Speed = Annotated[Positive, Field(**_SPEED)]
_PathCoordinates = Annotated[
    tuple[Annotated[Number, Field(ge=0.0, le=1.0)], ...], BeforeValidator(plain)
]


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
            raise refuse(
                problem,
                key=".speed",
                found=write_count(len(self.speed), "speed"),
                allowed=f"{len(self.s)}",
            )
        for row in range(1, len(self.s)):
            if self.s[row] < self.s[row - 1]:
                problem = "the path coordinates do not ascend"
                raise refuse(
                    problem,
                    key=f".s[{row}]",
                    found=self.s[row],
                    allowed=f">= {self.s[row - 1]:g}",
                )
        for place, same in itertools.groupby(self.s):
            if len(list(same)) > 2:
                problem = "a place has more than two speeds"
                raise refuse(
                    problem,
                    key=".s",
                    found=place,
                    allowed="a place at most twice, which is a step",
                )
        return self


def _as_sequence(value: object) -> object:
    """Take one mapping for a list of it."""
    value = plain(value)
    return value if isinstance(value, list) else [value]


def _between(pair: tuple[float, float]) -> tuple[float, float]:
    if not pair[0] < pair[1]:
        raise refuse(
            "the part of the path is empty",
            found=list(pair),
            allowed="[begin, end] with begin < end",
        )
    return pair


class ProcessSpeed(Model):
    """A constant speed of the tool over a part of the path: what a glue nozzle or a laser needs."""

    speed: Speed = Field(description="Speed of the tool frame's origin, m/s.")
    s: Annotated[
        tuple[
            Annotated[Number, Field(ge=0.0, lt=1.0)],
            Annotated[Number, Field(gt=0.0, le=1.0)],
        ],
        AfterValidator(_between),
    ] = Field(
        description="[begin, end], path coordinates between which it is held; outside, as fast as the limits allow. "
        "A part may begin or end with the path where boundary.start_speed or end_speed is its speed, or the motion is "
        "periodic."
    )
    tolerance: Annotated[Share, Field(ge=1e-3, le=0.5)] = Field(
        default=0.01,
        description="Largest deviation either way, as a share of the speed: 1 %, or 0.01.",
    )


class ToolLimits(Model):
    """Limits on the motion of the tool frame's origin, and on how fast the tool turns."""

    speed: Annotated[
        Annotated[Speed, Tag("<number>")]
        | Annotated[SpeedTable, Tag("<mapping>")]
        | Annotated[None, Tag("<null>")],
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
    acceleration: Speed | None = Field(
        default=None, description="Largest acceleration, m/s^2. Null: none."
    )
    angular_speed: Speed | None = Field(
        default=None,
        description="Largest speed at which the tool turns, rad/s; its free roll does not count. Null: none.",
    )
    process_speed: Annotated[
        tuple[ProcessSpeed, ...], BeforeValidator(_as_sequence)
    ] = Field(
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
                end = parts[number - 1].s[1]
                allowed = f"a begin above {end:g}; the part before ends there, and speeds change in a gap"
                raise refuse(
                    problem,
                    key=f"[{number}].s",
                    found=list(parts[number].s),
                    allowed=allowed,
                )
        return parts

    @model_validator(mode="after")
    def _speeds_agree(self) -> ToolLimits:
        for number, part in enumerate(self.process_speed):
            cap = _least_between(self.speed, part.s)
            slowest = part.speed * (1.0 - part.tolerance)
            if cap is not None and cap < slowest:
                problem = "the tool's largest speed is below the process speed"
                allowed = f"at most {cap:g} m/s there, or a higher tool_limits.speed"
                raise refuse(
                    problem,
                    key=f".process_speed[{number}].speed",
                    found=part.speed,
                    allowed=allowed,
                )
        return self


def _least_between(
    cap: float | SpeedTable | None, part: Sequence[float]
) -> float | None:
    """Least of the largest speeds over a part of the path."""
    if not isinstance(cap, SpeedTable):
        return cap
    inside = [
        speed
        for s, speed in zip(cap.s, cap.speed, strict=True)
        if part[0] <= s <= part[1]
    ]
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
