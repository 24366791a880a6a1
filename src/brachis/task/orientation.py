"""How the tool is oriented along a segment, as the task file writes it; for task spaces of poses.

``orientation: fixed`` stands beside the segment's kind, or ``{rotate: ...}``, ``{to: ...}``, ``tangent``. A given
orientation is that of the tool frame in the world frame, in one of three forms: a quaternion, a rotation vector, or
roll, pitch and yaw as in a URDF. Angles are in degrees where the key ends with ``_deg``, otherwise in radians.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, Tag, field_validator

from brachis.task.fields import Model, Number, by_form, by_key, refuse

_UNIT = 0.01

Vector3 = tuple[Number, Number, Number]


_LEAST_LENGTH = 1e-9


def _check_direction(vector: Vector3) -> Vector3:
    if math.hypot(*vector) < _LEAST_LENGTH:
        problem = "a direction cannot have zero length"
        raise refuse(problem, found=list(vector), allowed="any other vector; its length is of no importance")
    return vector


Direction = Annotated[Vector3, AfterValidator(_check_direction)]
Profile = Annotated[
    Literal["uniform", "smooth"],
    Field(
        description="How the angle grows along the segment: at a constant rate, or from rate zero to rate zero, so "
        "that it joins segments that keep their orientation."
    ),
]


class Quaternion(Model):
    """An orientation as a unit quaternion."""

    quaternion: tuple[Number, Number, Number, Number] = Field(
        description="[w, x, y, z], the scalar first, of length 1 (to 1 %, the rest is rounding); q and -q are the same."
    )

    @field_validator("quaternion")
    @classmethod
    def _has_unit_length(cls, quaternion: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
        length = math.hypot(*quaternion)
        if abs(length - 1.0) > _UNIT:
            problem = f"the quaternion's length is {length:.6g}"
            raise refuse(problem, found=list(quaternion), allowed="[w, x, y, z] of length 1")
        return quaternion


class RotationVector(Model):
    """An orientation as a rotation vector."""

    rotation_vector: Vector3 = Field(description="Axis of the rotation times its angle, rad.")


class RollPitchYaw(Model):
    """An orientation as roll, pitch and yaw."""

    rpy_deg: Vector3 = Field(
        description="Roll, pitch, yaw, degrees, as in a URDF: about the fixed x, then y, then z axis."
    )


_FORMS = "an orientation needs exactly one of its forms"

Attitude = Annotated[
    Annotated[Quaternion, Tag("<Quaternion>")]
    | Annotated[RotationVector, Tag("<RotationVector>")]
    | Annotated[RollPitchYaw, Tag("<RollPitchYaw>")],
    by_key(
        _FORMS,
        {"Quaternion": ("quaternion",), "RotationVector": ("rotation_vector",), "RollPitchYaw": ("rpy_deg",)},
    ),
]


class ToQuaternion(Quaternion):
    """A turn to a unit quaternion."""

    profile: Profile = "uniform"


class ToRotationVector(RotationVector):
    """A turn to a rotation vector."""

    profile: Profile = "uniform"


class ToRollPitchYaw(RollPitchYaw):
    """A turn to roll, pitch and yaw."""

    profile: Profile = "uniform"


Target = Annotated[
    Annotated[ToQuaternion, Tag("<ToQuaternion>")]
    | Annotated[ToRotationVector, Tag("<ToRotationVector>")]
    | Annotated[ToRollPitchYaw, Tag("<ToRollPitchYaw>")],
    by_key(
        _FORMS,
        {"ToQuaternion": ("quaternion",), "ToRotationVector": ("rotation_vector",), "ToRollPitchYaw": ("rpy_deg",)},
    ),
]


class Rotation(Model):
    """A rotation about an axis."""

    axis: Direction = Field(description="Axis of the rotation, right-hand rule; any length but zero.")
    angle_deg: Number = Field(description="Angle of the rotation, degrees, signed; it may exceed a turn.")
    frame: Literal["world", "tool"] = Field(default="world", description="Frame in which the axis is given.")
    profile: Profile = "uniform"


class Tangent(Model):
    """Turning with the tangent."""

    up: Direction | None = Field(
        default=None,
        description="World direction that the tool keeps its attitude to; not along the tangent. Null: the axis of an "
        "arc or circle, z for other segments.",
    )


class Rotate(Model):
    """The tool turns about an axis that stands still."""

    rotate: Rotation = Field(description="The rotation.")


class TurnTo(Model):
    """The tool turns to an orientation, the shortest way."""

    to: Target = Field(description="Orientation at the segment's end, world frame.")


class AlongTangent(Model):
    """The tool turns with the tangent."""

    tangent: Tangent = Field(description="What the tool keeps its attitude to.")


Turning = Annotated[
    Annotated[Rotate, Tag("<Rotate>")] | Annotated[TurnTo, Tag("<TurnTo>")],
    by_key("a turn needs exactly one of its forms", {"Rotate": ("rotate",), "TurnTo": ("to",)}),
]
OrientationMode = Annotated[
    Annotated[Literal["fixed", "tangent"], Tag("<word>")]
    | Annotated[None, Tag("<null>")]
    | Annotated[
        Annotated[
            Annotated[Rotate, Tag("<Rotate>")]
            | Annotated[TurnTo, Tag("<TurnTo>")]
            | Annotated[AlongTangent, Tag("<AlongTangent>")],
            by_key(
                "an orientation along a segment needs exactly one of its forms",
                {"Rotate": ("rotate",), "TurnTo": ("to",), "AlongTangent": ("tangent",)},
            ),
        ],
        Tag("<mapping>"),
    ],
    by_form("fixed | tangent | {rotate: ...} | {to: ...} | {tangent: ...}", "fixed", "tangent"),
]
