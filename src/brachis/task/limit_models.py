"""Joint limits as the task file describes them.

For ``torque``, ``velocity`` and ``position`` there are three cases. If the key is absent, the limit comes from the
URDF. If it is null, the joint has no such limit. Otherwise it has a value. The models represent the absent key by
`FROM_URDF`, which a task file may also spell out, so that absent and null stay different in comparisons and in saved
tasks. A joint that a mapping leaves out keeps the limit of the URDF. A URDF does not state ``acceleration``, ``jerk``
or ``torque_rate``; if such a key is absent, there is no limit.

The module also contains the limits on the motion of the tool.
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
"""The value of a limit whose key is absent: the limit of the URDF applies."""


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
    ByForm("a number > 0, a pair [lower, upper] around zero, or null (no limit)"),
]
PairEntry = Annotated[
    Literal["urdf"] | AnyPositive | NonEmpty[_Entry] | dict[Name, _EntryOrNull] | None,
    ByForm(
        "a number > 0 for all joints; a list or a mapping by joint name, of numbers > 0, pairs [lower, upper] around "
        "zero, or null; null (no limit); or urdf (as in the URDF)"
    ),
]
NumberEntry = Annotated[
    AnyPositive | NonEmpty[AnyPositive] | dict[Name, AnyPositive | None] | None,
    ByForm(
        "a number > 0 for all joints; a list of numbers > 0; "
        "a mapping of joint names to numbers > 0 or null; or null (no limit)"
    ),
]
RangeEntry = Annotated[
    Literal["urdf"] | NonEmpty[Interval] | dict[Name, Interval | None] | None,
    ByForm(
        "a list of pairs [low, high]; a mapping of joint names to [low, high] or null; null (no limit); "
        "or urdf (as in the URDF)"
    ),
]
TorqueCurve = Annotated[
    tuple[tuple[NonNegative, NonNegative], ...], Field(min_length=2)
]
"""Points [speed, torque] of a torque-speed curve."""

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
    """Joint limits. If a key is absent, the limit of the URDF applies; null removes it (see the module's text).

    The limits are checked when a robot is made with them, because only then are its joints known.

    Parameters
    ----------
    torque, velocity : float, sequence, array, mapping or None, optional
        Limits in Nm or N, and in rad/s or m/s: one number for all joints, one for each joint in chain order, or numbers
        by joint name. A pair [lower, upper] around zero can replace the number of a joint. None, also as the value of a
        single joint: no limit. `FROM_URDF`: as in the URDF.
    position : sequence, array, mapping or None, optional
        Pairs [lower, upper], rad or m, in the same forms. None as an end means that the range is open there.
    acceleration, power, rms_torque, jerk, torque_rate : float, sequence, array, mapping or None, optional
        Limits in rad/s^2 or m/s^2; W; Nm or N; rad/s^3 or m/s^3; and Nm/s or N/s: a number, a sequence, a mapping or
        None, as for the torque. Limits on jerk and torque rate need ``spline.degree`` >= 3 and zero acceleration at
        rest.
    total_power : float or None, optional
        Maximum sum of the powers of all joints, W.
    scale : mapping or LimitScale, optional
        Factors on limits, applied last.
    torque_speed : mapping of str to (p, 2) array or sequence of pairs, optional
        Points [speed, torque] of a curve, by joint name.

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
    N), the first at speed 0. Torques never rise. The curve is linear between points, and its last slope continues to
    zero torque. It applies in both directions, to driving and braking."""

    __pydantic_config__ = Model.model_config

    if TYPE_CHECKING:

        def __init__(self, **limits: Unpack[LimitKeywords]) -> None: ...

    def __post_init__(self) -> None:
        """Turn arrays into plain numbers, and a mapping of factors into `LimitScale`."""
        for entry in fields(self):
            value: Any = plain(getattr(self, entry.name), tuple)
            if entry.name == "scale" and isinstance(value, Mapping | None):
                value = LimitScale().model_copy(update=value)
            object.__setattr__(self, entry.name, value)


def without_defaults(limits: LimitSpec) -> dict[str, Any]:
    """Return only the limits that differ from their defaults."""
    usual = vars(LimitSpec())
    return {kind: value for kind, value in vars(limits).items() if value != usual[kind]}


def per_joint_values(
    key: str,
    value: object,
    names: Sequence[str],
    missing: object,
) -> list[object]:
    """Return one value for each joint from a scalar, list or mapping; `missing` for joints that a mapping leaves out.

    Raises
    ------
    InputError
        A list has the wrong length.
    UnknownNameError
        A mapping names a joint that is not in the chain.
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
    """Return the values by joint name, without values equal to `missing`; see `per_joint_values`."""
    values = per_joint_values(key, value, names, missing)
    pairs = zip(names, values, strict=True)
    return {name: joint_value for name, joint_value in pairs if joint_value != missing}


Speed = Annotated[AnyPositive, Field(ge=LEAST, le=LARGEST)]
_PathCoordinates = Annotated[
    tuple[Annotated[Number, Field(ge=0.0, le=1.0)], ...], BeforeValidator(plain)
]


class SpeedTable(CheckedModel):
    """Maximum tool speed along the path, linear between the path coordinates and constant before and after them.

    A step consists of two speeds at the same path coordinate; there the lower of the two applies.
    """

    s: Annotated[_PathCoordinates, Field(min_length=1)]
    """Ascending path coordinates, 0 to 1. A coordinate that occurs twice is a step."""
    speed: Annotated[tuple[Speed, ...], BeforeValidator(plain)]
    """Maximum speed at each path coordinate, m/s."""

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
    """Return a list unchanged, and any other value as a list of one item."""
    value = plain(value)
    return value if isinstance(value, list) else [value]


class ProcessSpeed(Model):
    """A constant speed of the tool over a section of the path, for example for a glue nozzle or a laser."""

    speed: Speed
    """Speed of the origin of the tool frame, m/s."""
    s: Annotated[
        tuple[
            Annotated[Number, Field(ge=0.0, lt=1.0)],
            Annotated[Number, Field(gt=0.0, le=1.0)],
        ],
        must(
            lambda pair: pair[0] < pair[1],
            "the section of the path is empty",
            "[begin, end] with begin < end",
        ),
    ]
    """[begin, end]: path coordinates between which the speed is held. At stops, and at ends of the path that the tool
    does not pass at this speed, a lead shortens the section by the distance travelled in 0.1 s at the higher speed. In
    a lead the tool is no faster than this speed, unless the speed beyond the lead is higher."""
    segment: Count | None = None
    """Index of the segment that states the speed; written by brachis."""
    within: tuple[Number, Number] | None = None
    """[begin, end] of the section in which the tool does not exceed the speed; written by brachis."""
    lead_length: Number = 0.0
    """Length by which leads shorten the section, m; written by brachis."""

    @property
    def leads(self) -> list[SpeedTable]:
        """Tables of the maximum speed in the lead-in and lead-out of the section."""
        if self.within is None:
            return []
        sides = ((self.within[0], self.s[0]), (self.s[1], self.within[1]))
        speeds = (self.speed, self.speed)
        return [SpeedTable(s=side, speed=speeds) for side in sides if side[0] < side[1]]

    @property
    def origin(self) -> str:
        """Segment that states the speed, in words for messages; empty if the speed is not from a segment."""
        return "" if self.segment is None else f" of path[{self.segment}].speed"


class ToolLimits(CheckedModel):
    """Limits on the actual motion of the tool, also where tolerances let the tool leave the path."""

    speed: Annotated[
        Speed | SpeedTable | None,
        ByForm("a number > 0, a table {s: [...], speed: [...]}, or null (no limit)"),
    ] = None
    """Maximum speed, m/s: a number, or a table {s: [...], speed: [...]} along the path."""
    feed: tuple[SpeedTable, ...] = ()
    """Tables of maximum speeds; written by brachis from feed rates."""
    acceleration: Speed | None = None
    """Maximum acceleration, m/s^2."""
    angular_speed: Speed | None = None
    """Maximum angular speed of the tool, without its free roll, rad/s."""
    process_speed: Annotated[
        tuple[ProcessSpeed, ...], BeforeValidator(_as_sequence)
    ] = ()
    """Sections of the path with a constant speed: {speed, s}, or a list of such sections in order, with gaps in which
    the speed changes."""

    def _mistakes(self) -> Iterator[Mistake]:
        for number, (before, section) in enumerate(
            itertools.pairwise(self.process_speed), 1
        ):
            end = before.s[1]
            if section.s[0] <= end:
                yield (
                    f"process_speed[{number}].s",
                    "the sections of the path overlap, meet or are out of order",
                    f"a begin{section.origin} above {end:g}, the end of the section{before.origin} before, with a gap",
                )
        for number, section in enumerate(self.process_speed):
            cap = _least_between(self.speed, section.s)
            if cap is not None and cap < section.speed:
                yield (
                    f"process_speed[{number}].speed",
                    f"the maximum tool speed is below the process speed{section.origin}",
                    f"at most {cap:g} m/s there, or a higher tool_limits.speed",
                )


def _least_between(
    cap: float | SpeedTable | None, interval: Sequence[float]
) -> float | None:
    """Return the lowest value of the maximum speed over a section of the path."""
    if not isinstance(cap, SpeedTable):
        return cap
    inside = [
        speed
        for s, speed in zip(cap.s, cap.speed, strict=True)
        if interval[0] <= s <= interval[1]
    ]
    return float(min([*inside, *np.interp(interval, cap.s, cap.speed)]))
