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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, make_dataclass
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Unpack

import numpy as np
from pydantic import BeforeValidator, Field

from brachis.common.words import write_count
from brachis.errors import InputError, check_names
from brachis.task.fields import (
    LARGEST,
    LEAST,
    AnyPositive,
    ByForm,
    CheckedModel,
    Count,
    Mistake,
    Model,
    Name,
    NonEmpty,
    NonNegative,
    Number,
    must,
    plain,
)
from brachis.task.limit_kinds import (
    LIMIT_KINDS,
    ROBOT_LIMITS,
    LimitKeywords,
    LimitScale,
)

FROM_URDF: Final = "urdf"
"""The value of a limit whose key is absent: the URDF supplies it."""


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
        "a pair of limits must lie around zero",
        "[lower, upper] with lower < 0 < upper",
    ),
]
_Entry = Annotated[
    AnyPositive | _Pair, ByForm("a number > 0, or a pair [lower, upper] around zero")
]
_EntryOrNull = Annotated[
    AnyPositive | _Pair | None,
    ByForm("a number > 0, a pair [lower, upper] around zero, null (no limit)"),
]
PairEntry = Annotated[
    Literal["urdf"] | AnyPositive | NonEmpty[_Entry] | dict[Name, _EntryOrNull] | None,
    ByForm(
        "a number > 0 for all joints; a list, or a mapping of joint name to a number > 0, a pair [lower, upper] around "
        "zero or null; null (no limit), urdf (as in the URDF)"
    ),
]
NumberEntry = Annotated[
    AnyPositive | NonEmpty[AnyPositive] | dict[Name, AnyPositive | None] | None,
    ByForm(
        "a number > 0 for all joints, a list of numbers > 0, "
        "a mapping of joint name to number > 0 or null, null (no limit)"
    ),
]
RangeEntry = Annotated[
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

_FORMS = {"number": NumberEntry, "pair": PairEntry, "range": RangeEntry}
_TabledLimits: Any = make_dataclass(
    "_TabledLimits",
    [
        (
            row.name,
            Annotated[_FORMS[row.form], Field(description=row.description)],
            None if row.form == "number" else FROM_URDF,
        )
        for row in LIMIT_KINDS.values()
    ]
    + [
        (
            name,
            Annotated[AnyPositive | None, Field(description=row.description)],
            None,
        )
        for name, row in ROBOT_LIMITS.items()
    ],
    frozen=True,
)


@dataclass(frozen=True)
class LimitSpec(_TabledLimits):  # type: ignore[misc]
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
    total_power : float or None, optional
        W.
    scale : mapping or LimitScale, optional
        Factors on limits, applied after all else.
    torque_speed : mapping of str to (p, 2) array or sequence of pairs, optional
        Points [speed, torque] by joint name.

    Examples
    --------
    >>> import brachis
    >>> brachis.LimitSpec(torque={"j1": 12.0}, velocity=2.0).velocity
    2.0
    """

    scale: LimitScale = field(default_factory=LimitScale)
    """Factors on the limits."""
    torque_speed: dict[Name, TorqueCurve | None] | None = None
    """Torque limits that fall with speed, by joint name: points [speed, torque] at the joint, rad/s and N m (m/s and
    N), the first at speed 0, torques never rising. Linear in between; the last slope continues to zero torque. It
    holds in both directions, for driving and braking."""

    __pydantic_config__ = Model.model_config

    if TYPE_CHECKING:

        def __init__(self, **limits: Unpack[LimitKeywords]) -> None: ...

    def __post_init__(self) -> None:
        """Take arrays for plain numbers, and a mapping for the scale."""
        for entry in fields(self):
            value: Any = plain(getattr(self, entry.name), tuple)
            if entry.name == "scale" and isinstance(value, Mapping | None):
                value = LimitScale().model_copy(update=value)
            object.__setattr__(self, entry.name, value)


def without_defaults(limits: LimitSpec) -> dict[str, Any]:
    """Return what differs from the defaults."""
    usual = vars(LimitSpec())
    return {kind: value for kind, value in vars(limits).items() if value != usual[kind]}


def per_joint_values(
    key: str,
    value: object,
    names: Sequence[str],
    missing: object,
) -> list[object]:
    """Spread a scalar, list or mapping over the joints; `missing` where a mapping leaves a joint out.

    Raises
    ------
    InputError
        A list has the wrong length.
    UnknownNameError
        A mapping names a joint that is not of the chain.
    """
    if isinstance(value, Mapping):
        check_names("joint", value, names, key)
        return [value.get(name, missing) for name in names]
    if isinstance(value, Sequence | np.ndarray) and not isinstance(value, str):
        if len(value) != len(names):
            raise InputError(
                "the list has the wrong number of values",
                where=key,
                found=len(value),
                allowed=f"{len(names)}, one for each of {', '.join(names)}",
            )
        return list(value)
    return [value] * len(names)


def map_by_joint(
    key: str,
    value: object,
    names: Sequence[str],
    missing: object,
) -> dict[str, object]:
    """Return the values of the joints by name, without those that are `missing`; see `per_joint_values`."""
    values = per_joint_values(key, value, names, missing)
    pairs = zip(names, values, strict=True)
    return {name: joint_value for name, joint_value in pairs if joint_value != missing}


Speed = Annotated[AnyPositive, Field(ge=LEAST, le=LARGEST)]
_PathCoordinates = Annotated[
    tuple[Annotated[Number, Field(ge=0.0, le=1.0)], ...], BeforeValidator(plain)
]


class SpeedTable(CheckedModel):
    """Largest speed of the tool along the path: linear between places, and as at the nearest one beyond them.

    A step is two speeds at the same place; at the place itself the lower one of them holds.
    """

    s: Annotated[_PathCoordinates, Field(min_length=1)]
    """Ascending path coordinates, 0 to 1. A value given twice is a step."""
    speed: Annotated[tuple[Speed, ...], BeforeValidator(plain)]
    """Largest speed at each path coordinate, m/s."""

    def _mistakes(self) -> Iterator[Mistake]:
        for row, (before, place) in enumerate(itertools.pairwise(self.s), 1):
            if place < before:
                yield (
                    f"s[{row}]",
                    "the path coordinates do not increase",
                    f">= {before:g}",
                )
        if len(self.speed) != len(self.s):
            yield (
                "speed",
                "the numbers of path coordinates and speeds differ",
                write_count(len(self.s), "speed"),
            )
        for place, after in zip(self.s, self.s[2:], strict=False):
            if place == after:
                yield (
                    "s",
                    f"there are more than two speeds at s = {place:g}",
                    "each path coordinate once, or twice for a step",
                )


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
    """[begin, end]: path coordinates between which the speed is held. At stops, and at ends of the path that are not
    passed at this speed, the part is shorter by what the tool moves in 0.1 s at the higher speed. There the tool does
    not exceed this speed, unless it comes from or goes on at a higher one."""
    segment: Count | None = None
    """Index of the speed's segment; written by brachis."""
    within: tuple[Number, Number] | None = None
    """[begin, end] between which the tool does not exceed the speed; written by brachis."""

    @property
    def leads(self) -> list[SpeedTable]:
        """Largest speeds in the leads before and behind the part."""
        if self.within is None:
            return []
        sides = ((self.within[0], self.s[0]), (self.s[1], self.within[1]))
        speeds = (self.speed, self.speed)
        return [SpeedTable(s=side, speed=speeds) for side in sides if side[0] < side[1]]

    @property
    def origin(self) -> str:
        """Words for messages: of which segment it is, if of any."""
        return "" if self.segment is None else f" of path[{self.segment}].speed"


class ToolLimits(CheckedModel):
    """Limits on the motion of the tool itself, also where tolerances let it leave its path."""

    speed: Annotated[
        Speed | SpeedTable | None,
        ByForm("a number > 0, a table {s: [...], speed: [...]}, or null (no limit)"),
    ] = None
    """Largest speed, m/s: a number, or a table over the path {s: [...], speed: [...]}."""
    feed: tuple[SpeedTable, ...] = ()
    """Tables of largest speeds over parts of the path; written by brachis from feed rates."""
    acceleration: Speed | None = None
    """Largest acceleration, m/s^2."""
    angular_speed: Speed | None = None
    """Largest angular speed of the tool, rad/s, without its free roll."""
    process_speed: Annotated[
        tuple[ProcessSpeed, ...], BeforeValidator(_as_sequence)
    ] = ()
    """Parts of the path with a constant speed: {speed, s}, or a list of these in order, with gaps in which the speed
    can change."""

    def _mistakes(self) -> Iterator[Mistake]:
        for number, (before, section) in enumerate(
            itertools.pairwise(self.process_speed), 1
        ):
            end = before.s[1]
            if section.s[0] <= end:
                yield (
                    f"process_speed[{number}].s",
                    "the parts of the path overlap, meet or are out of order",
                    f"a begin{section.origin} above {end:g}, the end of the part{before.origin} before it, with a gap",
                )
        for number, section in enumerate(self.process_speed):
            cap = _least_between(self.speed, section.s)
            if cap is not None and cap < section.speed:
                yield (
                    f"process_speed[{number}].speed",
                    f"the tool's largest speed is below the process speed{section.origin}",
                    f"at most {cap:g} m/s there, or a higher tool_limits.speed",
                )


def _least_between(
    cap: float | SpeedTable | None, interval: Sequence[float]
) -> float | None:
    """Least of the largest speeds over a part of the path."""
    if not isinstance(cap, SpeedTable):
        return cap
    inside = [
        speed
        for s, speed in zip(cap.s, cap.speed, strict=True)
        if interval[0] <= s <= interval[1]
    ]
    return float(min([*inside, *np.interp(interval, cap.s, cap.speed)]))
