"""Joint limits as the task file describes them.

For ``torque``, ``velocity`` and ``position`` three cases differ: the key is absent, and the limit comes from the URDF;
the key is null, and there is no limit; the key has a value. The models write the absent key as the word `FROM_URDF`,
which a task file may also spell out. Thus absent and null stay distinguishable in comparisons and in saved tasks. A
joint that a mapping leaves out keeps the limit of the URDF. A URDF has no ``acceleration``, ``jerk`` or
``torque_rate``: absent means none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Final, Literal, Protocol, TypedDict

from pydantic import AfterValidator, Field, Tag

from brachis.task.fields import Model, Name, NonNegative, Number, Positive, by_form, plain, refuse

FROM_URDF: Final = "urdf"
"""The value of a limit whose key is absent: the URDF supplies it."""


class Array(Protocol):
    """What a NumPy array or scalar is to this stage, which does not import NumPy."""

    def tolist(self) -> Any:  # noqa: ANN401
        """Return plain numbers."""


_LIMIT_FORMS = (
    "a number > 0 for all joints, a list of numbers > 0, a mapping of joint name to number > 0 or null, null (no limit)"
)


def _increasing(pair: tuple[float | None, float | None]) -> tuple[float | None, float | None]:
    if None not in pair and not pair[0] < pair[1]:  # type: ignore[operator]
        problem = "the lower limit must be below the upper one"
        raise refuse(problem, found=list(pair), allowed="[low, high] with low < high")
    return pair


Interval = Annotated[tuple[Number | None, Number | None], AfterValidator(_increasing)]


def _around_zero(pair: tuple[float, float]) -> tuple[float, float]:
    if not pair[0] < 0.0 < pair[1]:
        problem = "a pair of limits lies around zero"
        raise refuse(problem, found=list(pair), allowed="[lower, upper] with lower < 0 < upper")
    return pair


OneNumber = Annotated[Positive, Tag("<number>")]
_Pair = Annotated[Annotated[tuple[Number, Number], AfterValidator(_around_zero)], Tag("<list>")]
_Entry = Annotated[OneNumber | _Pair, by_form("a number > 0, or a pair [lower, upper] around zero")]
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
TorqueCurve = Annotated[tuple[tuple[NonNegative, NonNegative], ...], Field(min_length=2)]
"""Points [speed, torque]."""

# What a program may give: NumPy arrays stand for lists and numbers too.
_StatedPair = Array | Sequence[float | None] | None
StatedLimit = float | Array | Sequence[float | _StatedPair] | Mapping[str, float | _StatedPair] | str | None
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

    torque: Positive = Field(default=1.0, description="Factor on all torque and force limits, curves too.")
    velocity: Positive = Field(default=1.0, description="Factor on all velocity limits.")
    acceleration: Positive = Field(default=1.0, description="Factor on all acceleration limits.")
    power: Positive = Field(default=1.0, description="Factor on all power limits, the total one too.")
    rms_torque: Positive = Field(default=1.0, description="Factor on all limits of root-mean-square torques.")
    jerk: Positive = Field(default=1.0, description="Factor on all jerk limits.")
    torque_rate: Positive = Field(default=1.0, description="Factor on all limits of torque rates.")


@dataclass(frozen=True, init=False)
class LimitSpec:
    """Joint limits: an absent key takes the URDF's, null removes the limit (see the module's documentation).

    Examples
    --------
    >>> import brachis
    >>> brachis.LimitSpec(torque={"j1": 12.0}, velocity=2.0).velocity
    2.0
    """

    torque: Annotated[
        UrdfLimit,
        Field(description="Largest torque, N m (force, N), or [lower, upper] by joint. Absent: URDF. Null: none."),
    ] = FROM_URDF
    velocity: Annotated[
        UrdfLimit,
        Field(description="Largest speed, rad/s (m/s), or [lower, upper] by joint. Absent: URDF. Null: none."),
    ] = FROM_URDF
    acceleration: Annotated[
        OwnLimit, Field(description="Largest acceleration, rad/s^2 (m/s^2). Absent or null: none.")
    ] = None
    position: Annotated[
        PositionLimit, Field(description="[low, high], rad (m); null for an open end. Absent: URDF. Null: none.")
    ] = FROM_URDF
    scale: Annotated[LimitScale, Field(description="Factors on the limits.")] = field(default_factory=LimitScale)
    power: Annotated[
        OwnLimit, Field(description="Largest mechanical power, torque x speed either way, W. Absent or null: none.")
    ] = None
    total_power: Annotated[
        Positive | None,
        Field(description="Largest sum of the joints' powers, drawn or returned, W. Absent or null: none."),
    ] = None
    rms_torque: Annotated[
        OwnLimit,
        Field(
            description="Largest root mean square of the torque over the whole motion, N m (force, N): what heats a "
            "motor. Absent or null: none."
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
    jerk: Annotated[OwnLimit, Field(description="Largest jerk, rad/s^3 (m/s^3). Absent or null: none.")] = None
    torque_rate: Annotated[
        OwnLimit, Field(description="Largest rate of change of the torque, N m/s (force, N/s). Absent or null: none.")
    ] = None

    __pydantic_config__ = Model.model_config

    def __init__(
        self,
        torque: StatedLimit = FROM_URDF,
        velocity: StatedLimit = FROM_URDF,
        acceleration: StatedLimit = None,
        position: StatedRange = FROM_URDF,
        scale: Mapping[str, float] | LimitScale | None = None,
        power: StatedLimit = None,
        total_power: float | None = None,
        rms_torque: StatedLimit = None,
        torque_speed: StatedCurves = None,
        jerk: StatedLimit = None,
        torque_rate: StatedLimit = None,
    ) -> None:
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
        if not isinstance(scale, LimitScale):
            scale = LimitScale().model_copy(update={kind: plain(factor) for kind, factor in (scale or {}).items()})
        stated = (torque, velocity, acceleration, position, scale)
        further = (power, total_power, rms_torque, torque_speed, jerk, torque_rate)
        for each, value in zip(fields(self), (*stated, *further), strict=True):
            object.__setattr__(self, each.name, plain(value, tuple))
