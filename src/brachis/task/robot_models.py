"""The robot as the task file describes it: where its URDF is, its limits and its friction.

Limits
------
For ``torque``, ``velocity`` and ``position`` three cases differ: the key is absent, and the limit comes from the URDF;
the key is null, and there is no limit; the key has a value. The models write the absent key as the word `FROM_URDF`,
which a task file may also spell out. Thus absent and null stay distinguishable in comparisons and in saved tasks. A
joint that a mapping leaves out keeps the limit of the URDF. A URDF has no ``acceleration``, ``jerk`` or
``torque_rate``: absent means none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Final, Literal, Protocol

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

_Number = Annotated[Positive, Tag("<number>")]
_List = Annotated[Annotated[tuple[Positive, ...], Field(min_length=1)], Tag("<list>")]
_Mapping = Annotated[dict[Name, Positive | None], Tag("<mapping>")]
_Null = Annotated[None, Tag("<null>")]
_Word = Annotated[Literal["urdf"], Tag("<word>")]

UrdfLimit = Annotated[
    _Word | _Number | _List | _Mapping | _Null, by_form(_LIMIT_FORMS + ", urdf (as in the URDF)", FROM_URDF)
]
OwnLimit = Annotated[_Number | _List | _Mapping | _Null, by_form(_LIMIT_FORMS)]
PositionLimit = Annotated[
    _Word
    | Annotated[Annotated[tuple[Interval, ...], Field(min_length=1)], Tag("<list>")]
    | Annotated[dict[Name, Interval | None], Tag("<mapping>")]
    | _Null,
    by_form(
        "a list of [low, high], a mapping of joint name to [low, high] or null, null (no limit), urdf (as in the URDF)",
        FROM_URDF,
    ),
]
PerJoint = Annotated[
    Annotated[NonNegative, Tag("<number>")]
    | Annotated[Annotated[tuple[NonNegative, ...], Field(min_length=1)], Tag("<list>")]
    | Annotated[dict[Name, NonNegative], Tag("<mapping>")],
    by_form("a number >= 0 for all joints, a list of numbers, a mapping of joint name to number"),
]
PerJointPositive = Annotated[
    _Number | _List | Annotated[dict[Name, Positive], Tag("<mapping>")],
    by_form("a number > 0 for all joints, a list of numbers, a mapping of joint name to number"),
]
JointValues = Annotated[
    Annotated[Annotated[tuple[Number, ...], Field(min_length=1)], Tag("<list>")]
    | Annotated[Annotated[dict[Name, Number], Field(min_length=1)], Tag("<mapping>")],
    by_form("a list of numbers in the order of the chain, or a mapping of joint name to number"),
]

# What a program may give: NumPy arrays stand for lists and numbers too.
StatedLimit = float | Array | Sequence[float | None] | Mapping[str, float | None] | str | None
_StatedPair = Array | Sequence[float | None] | None
StatedRange = Array | Sequence[_StatedPair] | Mapping[str, _StatedPair] | str | None


class LimitScale(Model):
    """Factors on the limits, to keep a distance from them."""

    torque: Positive = Field(default=1.0, description="Factor on all torque and force limits.")
    velocity: Positive = Field(default=1.0, description="Factor on all velocity limits.")
    acceleration: Positive = Field(default=1.0, description="Factor on all acceleration limits.")
    jerk: Positive = Field(default=1.0, description="Factor on all jerk limits.")
    torque_rate: Positive = Field(default=1.0, description="Factor on all limits of torque rates.")


@dataclass(frozen=True, init=False)
class LimitSpec:
    """Joint limits: an absent key takes the URDF's, null removes the limit (see the module's documentation)."""

    torque: Annotated[UrdfLimit, Field(description="Largest torque, N m (force, N). Absent: URDF. Null: none.")] = (
        FROM_URDF
    )
    velocity: Annotated[UrdfLimit, Field(description="Largest speed, rad/s (m/s). Absent: URDF. Null: none.")] = (
        FROM_URDF
    )
    acceleration: Annotated[
        OwnLimit, Field(description="Largest acceleration, rad/s^2 (m/s^2). Absent or null: none.")
    ] = None
    position: Annotated[
        PositionLimit, Field(description="[low, high], rad (m); null for an open end. Absent: URDF. Null: none.")
    ] = FROM_URDF
    scale: Annotated[LimitScale, Field(description="Factors on the limits.")] = field(default_factory=LimitScale)
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
        jerk: StatedLimit = None,
        torque_rate: StatedLimit = None,
    ) -> None:
        """Take limits from a program; they are checked when a robot is made with them, where its joints are known.

        Parameters
        ----------
        torque, velocity, acceleration : float, sequence, array, mapping or None, optional
            Nm or N; rad/s or m/s; rad/s^2 or m/s^2. One number for all joints, one for each in chain order, or numbers
            by joint name; None, also for a single joint: not limited; `FROM_URDF`: as in the URDF.
        position : sequence, array, mapping or None, optional
            Pairs [lower, upper], rad or m, likewise; an end that is None is open.
        scale : mapping or LimitScale, optional
            Factors on torque, velocity, acceleration, jerk and torque rate limits, applied after all else.
        jerk, torque_rate : float, sequence, array, mapping or None, optional
            rad/s^3 or m/s^3; Nm/s or N/s; likewise. They need ``spline.degree`` >= 3 and acceleration at rest.
        """
        if not isinstance(scale, LimitScale):
            scale = LimitScale().model_copy(update={kind: plain(factor) for kind, factor in (scale or {}).items()})
        stated = (torque, velocity, acceleration, position, scale, jerk, torque_rate)
        for each, value in zip(fields(self), stated, strict=True):
            object.__setattr__(self, each.name, plain(value, tuple))


class FrictionSettings(Model):
    """Drive inertia and friction at the joints: each a number for all joints, a list, or a mapping by joint name."""

    armature: PerJoint = Field(default=0.0, description="Inertia of the drive seen at the joint, kg m^2 (kg).")
    viscous: PerJoint = Field(default=0.0, description="Viscous friction, N m s/rad (N s/m).")
    coulomb: PerJoint = Field(default=0.0, description="Coulomb friction, N m (N).")
    coulomb_velocity: PerJointPositive = Field(
        default=0.01, description="Speed at which Coulomb friction is developed to 76 % (tanh 1), rad/s (m/s)."
    )


class RobotSettings(Model):
    """The robot: its URDF and what the task adds to it."""

    urdf: Name | None = Field(
        default=None, description="URDF file, relative to the task file's folder. Required in a task file."
    )
    tool_frame: Name | None = Field(default=None, description="Frame that follows the path. Null: the only leaf link.")
    base_frame: Name | None = Field(default=None, description="First frame of the chain. Null: the root of the URDF.")
    gravity: tuple[Number, Number, Number] = Field(
        default=(0.0, 0.0, -9.81), description="Gravity, m/s^2, world frame."
    )
    locked_joints: dict[Name, Number] = Field(default={}, description="Joints that stay at a value, rad (m), by name.")
    limits: LimitSpec = Field(default_factory=LimitSpec, description="Joint limits.")
    friction: FrictionSettings = Field(default_factory=FrictionSettings, description="Drive inertia and friction.")
