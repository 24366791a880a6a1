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
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Final, Literal, Protocol, TypedDict, Unpack

import numpy as np
from pydantic import (
    BeforeValidator,
    Field,
    field_validator,
    model_validator,
)

from brachis.errors import UnknownNameError, write_count
from brachis.task.fields import (
    ByForm,
    Model,
    Name,
    NonEmpty,
    NonNegative,
    Number,
    Positive,
    Share,
    must,
    plain,
    refuse,
)

FROM_URDF: Final = "urdf"
"""The value of a limit whose key is absent: the URDF supplies it."""


class Array(Protocol):
    """What a NumPy array or scalar is to this stage, which does not import NumPy."""

    def tolist(self) -> Any:
        """Return plain numbers."""


Interval = Annotated[
    tuple[Number | None, Number | None],
    must(
        lambda pair: None in pair or pair[0] < pair[1],
        "the lower limit must be below the upper one",
        "[low, high] with low < high",
    ),
]
_Pair = Annotated[
    tuple[Number, Number],
    must(
        lambda pair: pair[0] < 0.0 < pair[1],
        "a pair of limits lies around zero",
        "[lower, upper] with lower < 0 < upper",
    ),
]
_Entry = Annotated[
    Positive | _Pair, ByForm("a number > 0, or a pair [lower, upper] around zero")
]
_EntryOrNull = Annotated[
    Positive | _Pair | None,
    ByForm("a number > 0, a pair [lower, upper] around zero, null (no limit)"),
]
UrdfLimit = Annotated[
    Literal["urdf"] | Positive | NonEmpty[_Entry] | dict[Name, _EntryOrNull] | None,
    ByForm(
        "a number > 0 for all joints; a list, or a mapping of joint name to a number > 0, a pair [lower, upper] around "
        "zero or null; null (no limit), urdf (as in the URDF)"
    ),
]
OwnLimit = Annotated[
    Positive | NonEmpty[Positive] | dict[Name, Positive | None] | None,
    ByForm(
        "a number > 0 for all joints, a list of numbers > 0, "
        "a mapping of joint name to number > 0 or null, null (no limit)"
    ),
]
PositionLimit = Annotated[
    Literal["urdf"] | NonEmpty[Interval] | dict[Name, Interval | None] | None,
    ByForm(
        "a list of [low, high], a mapping of joint name to [low, high] or null, null (no limit), "
        "urdf (as in the URDF)"
    ),
]
TorqueCurve = Annotated[
    tuple[tuple[NonNegative, NonNegative], ...], Field(min_length=2)
]
"""Points [speed, torque]."""

# What a program may give: NumPy arrays stand for lists and numbers too.
_StatedPair = Array | Sequence[float | None] | None
StatedLimit = (
    float
    | Array
    | Sequence[float | _StatedPair]
    | Mapping[str, float | _StatedPair]
    | str
    | None
)
StatedCurves = Mapping[str, Array | Sequence[_StatedPair] | None] | None
StatedRange = Array | Sequence[_StatedPair] | Mapping[str, _StatedPair] | str | None


class LimitKeywords(TypedDict, total=False):
    """Arguments of `LimitSpec`."""

    torque: StatedLimit
    velocity: StatedLimit
    acceleration: StatedLimit
    position: StatedRange
    scale: Mapping[str, float] | LimitScale | None
    power: StatedLimit
    total_power: float | None
    rms_torque: StatedLimit
    torque_speed: StatedCurves
    jerk: StatedLimit
    torque_rate: StatedLimit


class LimitScale(Model):
    """Factors on the limits, to keep a distance from them."""

    torque: Positive = 1.0
    """Factor on all torque and force limits, curves too."""
    velocity: Positive = 1.0
    """Factor on all velocity limits."""
    acceleration: Positive = 1.0
    """Factor on all acceleration limits."""
    power: Positive = 1.0
    """Factor on all power limits, the total one too."""
    rms_torque: Positive = 1.0
    """Factor on all limits of root-mean-square torques."""
    jerk: Positive = 1.0
    """Factor on all jerk limits."""
    torque_rate: Positive = 1.0
    """Factor on all limits of torque rates."""


@dataclass(frozen=True, init=False)
class LimitSpec:
    """Joint limits: an absent key takes the URDF's, null removes the limit (see the module's documentation).

    Examples
    --------
    >>> import brachis
    >>> brachis.LimitSpec(torque={"j1": 12.0}, velocity=2.0).velocity
    2.0
    """

    torque: UrdfLimit = FROM_URDF
    """Largest torque, N m (force, N), or [lower, upper] by joint. Absent: URDF. Null: none."""
    velocity: UrdfLimit = FROM_URDF
    """Largest speed, rad/s (m/s), or [lower, upper] by joint. Absent: URDF. Null: none."""
    acceleration: OwnLimit = None
    """Largest acceleration, rad/s^2 (m/s^2). Absent or null: none."""
    position: PositionLimit = FROM_URDF
    """[low, high], rad (m); null for an open end. Absent: URDF. Null: none."""
    scale: LimitScale = field(default_factory=LimitScale)
    """Factors on the limits."""
    power: OwnLimit = None
    """Largest mechanical power, torque x speed either way, W. Absent or null: none."""
    total_power: Positive | None = None
    """Largest sum of the joints' powers, drawn or returned, W. Absent or null: none."""
    rms_torque: OwnLimit = None
    """Largest root mean square of the torque over the whole motion, N m (force, N): what heats a motor. Absent or null:
    none."""
    torque_speed: dict[Name, TorqueCurve | None] | None = None
    """Torque limits that fall with speed, by joint name: points [speed, torque] from speed 0 on, rad/s and N m at the
    joint (m/s, N), joined by a line that never rises; the last slope goes on to zero torque. The same both ways,
    driving and braking. Absent or null: none."""
    jerk: OwnLimit = None
    """Largest jerk, rad/s^3 (m/s^3). Absent or null: none."""
    torque_rate: OwnLimit = None
    """Largest rate of change of the torque, N m/s (force, N/s). Absent or null: none."""

    __pydantic_config__ = Model.model_config

    def __init__(self, **stated: Unpack[LimitKeywords]) -> None:
        """Take limits from a program; they are checked when a robot is made with them, where its joints are known.

        Parameters
        ----------
        torque, velocity, acceleration : float, sequence, array, mapping or None, optional
            Nm or N; rad/s or m/s; rad/s^2 or m/s^2. One number for all joints, one for each in chain order, or numbers
            by joint name; for torque and velocity a pair [lower, upper] around zero in the place of a joint's number;
            None, also for a single joint: not limited; `FROM_URDF`: as in the URDF.
        position : sequence, array, mapping or None, optional
            Pairs [lower, upper], rad or m, likewise; an end that is None is open.
        scale : mapping or LimitScale, optional
            Factors on limits, applied after all else.
        power, rms_torque : float, sequence, array, mapping or None, optional
            W; Nm or N. As `acceleration`.
        total_power : float or None, optional
            W.
        torque_speed : mapping of str to (p, 2) array or sequence of pairs, optional
            Points [speed, torque] by joint name.
        jerk, torque_rate : float, sequence, array, mapping or None, optional
            rad/s^3 or m/s^3; Nm/s or N/s. As `acceleration`. They need ``spline.degree`` >= 3 and acceleration at rest.
        """
        given: dict[str, Any] = {"scale": None, **stated}
        if not isinstance(given["scale"], LimitScale):
            factors = plain(given["scale"] or {})
            given["scale"] = LimitScale().model_copy(update=factors)  # type: ignore[arg-type]
        for each in fields(self):
            value = plain(given.pop(each.name, each.default), tuple)
            object.__setattr__(self, each.name, value)
        if given:
            raise UnknownNameError(
                "limit",
                next(iter(given)),
                LimitKeywords.__annotations__,
                where="LimitSpec",
            )


_SPEED = {"ge": 1e-6, "le": 1e12}

Speed = Annotated[Positive, Field(**_SPEED)]
_PathCoordinates = Annotated[
    tuple[Annotated[Number, Field(ge=0.0, le=1.0)], ...], BeforeValidator(plain)
]


class SpeedTable(Model):
    """Largest speed of the tool along the path: linear between places, and as at the nearest one beyond them.

    A step is two speeds at the same place; at the place itself the lower one of them holds.
    """

    s: Annotated[_PathCoordinates, Field(min_length=1)]
    """Path coordinates, 0 to 1, ascending; the same one twice in a row is a step."""
    speed: Annotated[tuple[Speed, ...], BeforeValidator(plain)]
    """Largest speed at each of them, m/s."""

    @model_validator(mode="after")
    def _is_a_table(self) -> SpeedTable:
        if len(self.speed) != len(self.s):
            raise refuse(
                "there is not one speed for every path coordinate",
                key="speed",
                found=write_count(len(self.speed), "speed"),
                allowed=f"{len(self.s)}",
            )
        for row, (before, place) in enumerate(itertools.pairwise(self.s), 1):
            if place < before:
                raise refuse(
                    "the path coordinates do not ascend",
                    key=f"s[{row}]",
                    found=place,
                    allowed=f">= {before:g}",
                )
        for place, times in Counter(self.s).items():
            if times > 2:
                raise refuse(
                    "a place has more than two speeds",
                    key="s",
                    found=place,
                    allowed="a place at most twice, which is a step",
                )
        return self


def _as_sequence(value: object) -> object:
    """Take one mapping for a list of it."""
    value = plain(value)
    return value if isinstance(value, list) else [value]


class ProcessSpeed(Model):
    """A constant speed of the tool over a part of the path: what a glue nozzle or a laser needs."""

    speed: Speed
    """Speed of the tool frame's origin, m/s."""
    s: Annotated[
        tuple[
            Annotated[Number, Field(ge=0.0, lt=1.0)],
            Annotated[Number, Field(gt=0.0, le=1.0)],
        ],
        must(
            lambda pair: pair[0] < pair[1],
            "the part of the path is empty",
            "[begin, end] with begin < end",
        ),
    ]
    """[begin, end], path coordinates between which it is held; outside, as fast as the limits allow. A part may begin
    or end with the path where boundary.start_speed or end_speed is its speed, or the motion is periodic."""
    tolerance: Annotated[Share, Field(ge=1e-3, le=0.5)] = 0.01
    """Largest deviation either way, as a share of the speed: 1 %, or 0.01."""


class ToolLimits(Model):
    """Limits on the motion of the tool frame's origin, and on how fast the tool turns."""

    speed: Annotated[
        Speed | SpeedTable | None,
        ByForm("a number > 0, a table {s: [...], speed: [...]}, or null (no limit)"),
    ] = None
    """Largest speed, m/s, for the whole path; or a table over the path, {s: [...], speed: [...]}. Null: none."""
    feed: tuple[SpeedTable, ...] = ()
    """Tables of largest speeds over parts of the path, and none beyond their first and last places; written by brachis
    from the feed rates of the path's points."""
    acceleration: Speed | None = None
    """Largest acceleration, m/s^2. Null: none."""
    angular_speed: Speed | None = None
    """Largest speed at which the tool turns, rad/s; its free roll does not count. Null: none."""
    process_speed: Annotated[
        tuple[ProcessSpeed, ...], BeforeValidator(_as_sequence)
    ] = ()
    """Parts of the path with a constant speed: {speed, s, tolerance}, or a list of such, in order and with a gap in
    between in which the speed may change."""

    @field_validator("process_speed")
    @classmethod
    def _apart(cls, parts: tuple[ProcessSpeed, ...]) -> tuple[ProcessSpeed, ...]:
        for number, (before, part) in enumerate(itertools.pairwise(parts), 1):
            end = before.s[1]
            if part.s[0] <= end:
                raise refuse(
                    "the parts of the path overlap, meet or are out of order",
                    key=f"[{number}].s",
                    found=part.s,
                    allowed=f"a begin above {end:g}; the part before ends there, and speeds change in a gap",
                )
        return parts

    @model_validator(mode="after")
    def _speeds_agree(self) -> ToolLimits:
        for number, part in enumerate(self.process_speed):
            cap = _least_between(self.speed, part.s)
            slowest = part.speed * (1.0 - part.tolerance)
            if cap is not None and cap < slowest:
                raise refuse(
                    "the tool's largest speed is below the process speed",
                    key=f"process_speed[{number}].speed",
                    found=part.speed,
                    allowed=f"at most {cap:g} m/s there, or a higher tool_limits.speed",
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
    return float(min([*inside, *np.interp(part, cap.s, cap.speed)]))
