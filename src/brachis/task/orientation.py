"""The orientation of the tool along a segment, as the task file states it, for task spaces of poses.

The key ``orientation`` of a segment is ``fixed``, ``tangent``, ``{rotate: ...}``, ``{to: ...}`` or ``{tangent: ...}``.
An orientation is that of the tool frame in the frame of the path, by default the world. It is written in one of the
conventions of `brachis.task.points.units`. Angles are in degrees if the key ends with ``_deg``, otherwise in radians.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol

import numpy as np
from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    JsonValue,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from brachis.task.fields import ByForm, ByKey, Model, Number, must, refuse
from brachis.task.points.units import CONVENTIONS, choices, rotation_by

if TYPE_CHECKING:
    from scipy.spatial import transform

Vector3 = tuple[Number, Number, Number]


Direction = Annotated[
    Vector3,
    must(
        lambda vector: math.hypot(*vector) >= 1e-9,
        "a direction cannot have zero length",
        "any other vector, whatever its length",
    ),
]
Profile = Annotated[
    Literal["uniform", "smooth"],
    Field(
        description="Turning rate along the segment. uniform: constant. smooth: zero at both ends."
    ),
]


def _unit_length(quaternion: tuple[float, ...]) -> tuple[float, ...]:
    length = math.hypot(*quaternion)
    if abs(length - 1.0) > 0.01:
        raise refuse(
            f"the quaternion's length is {length:.6g}",
            found=quaternion,
            allowed="a quaternion of length 1 to within 1 %",
        )
    return quaternion


_Quaternion = Annotated[
    tuple[Number, Number, Number, Number], AfterValidator(_unit_length)
]
_DEGREES = "_deg"


def _about(name: str) -> Any:
    """Return the field for a convention, with the meaning of the convention as its description."""
    convention = CONVENTIONS[name]
    unit = ", rad" if name == "rotation_vector" else " (length 1 to within 1 %)"
    if convention.euler:
        unit = ", degrees"
    meaning = convention.meaning[0].upper() + convention.meaning[1:]
    return Field(default=None, description=f"{meaning}{unit}: {convention.makers}.")


class Attitude(Model):
    """An orientation, written in exactly one of these conventions."""

    model_config = ConfigDict(
        json_schema_extra=lambda schema: schema.update(oneOf=_ONE_OF)
    )

    quaternion_wxyz: _Quaternion | None = _about("quaternion_wxyz")
    quaternion_xyzw: _Quaternion | None = _about("quaternion_xyzw")
    rotation_vector: Vector3 | None = _about("rotation_vector")
    rpy_deg: Vector3 | None = _about("rpy")
    kuka_abc_deg: Vector3 | None = _about("kuka_abc")
    staubli_xyz_deg: Vector3 | None = _about("staubli_xyz")
    fanuc_wpr_deg: Vector3 | None = _about("fanuc_wpr")
    euler_zyz_deg: Vector3 | None = _about("euler_zyz")

    @model_validator(mode="before")
    @classmethod
    def _one_convention(cls, value: object) -> object:
        keys = value if isinstance(value, Mapping) else {}
        stated = [key for key in Attitude.model_fields if keys.get(key) is not None]
        if not isinstance(value, Attitude) and len(stated) != 1:
            raise refuse(
                "an orientation needs exactly one convention",
                found=value,
                allowed=choices(suffix=_DEGREES),
            )
        return value

    @model_serializer(mode="wrap")
    def _without_the_others(
        self, dump: SerializerFunctionWrapHandler
    ) -> dict[str, Any]:
        return {key: value for key, value in dump(self).items() if value is not None}

    @property
    def rotation(self) -> transform.Rotation:
        """The orientation as a SciPy rotation."""
        stated = self.model_dump(include=set(Attitude.model_fields))
        ((key, values),) = stated.items()
        if key.endswith(_DEGREES):
            values = np.radians(values)
        return rotation_by(key.removesuffix(_DEGREES), np.asarray(values))


_ONE_OF: list[JsonValue] = [{"required": [key]} for key in Attitude.model_fields]


class Target(Attitude):
    """The orientation at which a turn ends."""

    profile: Profile = "uniform"


class ToolPose(Attitude):
    """A pose of the tool: its position, and its orientation in exactly one of these conventions."""

    position: Vector3
    """Position x, y, z, m."""

    @model_validator(mode="before")
    @classmethod
    def _of_transform(cls, content: object) -> object:
        """Accept a transform such as Pinocchio's SE3."""
        if not hasattr(content, "homogeneous"):
            return content
        ((position, turn),) = poses_of([content], "transform")
        return {"position": position, **turn}


StartPlace = tuple[Number, ...] | ToolPose | None
"""Start of a path: task coordinates or a pose; None if the task does not state it."""


def poses_of(
    transforms: Any, source: str, orientations: Any = None
) -> list[tuple[list[float], dict[str, Any]]]:
    """Return the positions, m, and the orientations in task-file form; `source` names the transforms in messages."""
    from brachis.task.point_data import FileUnits
    from brachis.task.points.points import points_from

    points = points_from(transforms, orientations, None, FileUnits(), source, least=1)
    turns = [{"quaternion_wxyz": turn} for turn in points.turning.tolist()]
    return list(zip(points.position.tolist(), turns, strict=True))


class Transform(Protocol):
    """An object that represents a pose, such as Pinocchio's ``SE3``."""

    @property
    def homogeneous(self) -> Any:
        """Return the homogeneous matrix of the pose, (4, 4)."""


class Rotation(Model):
    """A rotation about an axis."""

    axis: Direction
    """Axis of rotation (right-hand rule), of any length."""
    angle_deg: Number
    """Angle of rotation, degrees. It may be negative or exceed 360."""
    frame: Literal["path", "tool"] = "path"
    """Frame in which the axis is given: path (the world or path_frame) or tool."""
    profile: Profile = "uniform"


class Tangent(Model):
    """Turning of the tool with the tangent of the path."""

    up: Direction | None = None
    """Direction, in the frame of the path, that stays up for the tool. Null: the axis of an arc or circle, otherwise
    z."""


class Rotate(Model):
    """The tool turns about a fixed axis."""

    rotate: Rotation
    """The rotation."""


class TurnTo(Model):
    """The tool turns the shortest way to an orientation."""

    to: Target
    """Orientation at the end of the segment."""


class AlongTangent(Model):
    """The tool turns with the tangent of the path."""

    tangent: Tangent
    """Direction that stays up while the tool turns."""


Turning = Annotated[
    Rotate | TurnTo,
    ByKey("a turn needs exactly one of its forms"),
]
OrientationMode = Annotated[
    Literal["fixed", "tangent"]
    | Annotated[
        Rotate | TurnTo | AlongTangent,
        ByKey("an orientation along a segment needs exactly one of its forms"),
    ]
    | None,
    ByForm("fixed | tangent | {rotate: ...} | {to: ...} | {tangent: ...}"),
]
