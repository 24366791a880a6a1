"""What a task adds to the robot of the URDF: a payload, another tool frame, another place of the base."""

from __future__ import annotations

import math
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field, model_validator

from brachis.task.fields import Model, NonNegative, Number, Positive, plain, refuse
from brachis.task.orientation import Vector3


class Placement(Model):
    """Where a frame is in another one."""

    xyz: Vector3 = Field(default=(0.0, 0.0, 0.0), description="Position of the origin, m.")
    rpy_deg: Vector3 = Field(
        default=(0.0, 0.0, 0.0),
        description="Roll, pitch, yaw, degrees, as in a URDF: about the fixed x, then y, then z axis.",
    )

    @model_validator(mode="before")
    @classmethod
    def _of_transform(cls, given: object) -> object:
        """Take a transform such as Pinocchio's SE3 too."""
        matrix = getattr(given, "homogeneous", None)
        if matrix is None:
            return given
        m: Any = plain(matrix)
        yaw = math.atan2(m[1][0], m[0][0])
        pitch = math.atan2(-m[2][0], math.hypot(m[0][0], m[1][0]))
        sine = math.sin(yaw)
        cosine = math.cos(yaw)
        roll = math.atan2(sine * m[0][2] - cosine * m[1][2], cosine * m[1][1] - sine * m[0][1])
        angles = [math.degrees(angle) for angle in (roll, pitch, yaw)]
        return {"xyz": [row[3] for row in m[:3]], "rpy_deg": angles}


class InertiaMatrix(Model):
    """Moments and products of inertia about the centre of mass, in the axes of the tool frame."""

    ixx: NonNegative = Field(description="Moment, kg m^2.")
    iyy: NonNegative = Field(description="Moment, kg m^2.")
    izz: NonNegative = Field(description="Moment, kg m^2.")
    ixy: Number = Field(default=0.0, description="Product, kg m^2, with the sign that URDFs have.")
    ixz: Number = Field(default=0.0, description="Product, kg m^2.")
    iyz: Number = Field(default=0.0, description="Product, kg m^2.")


class Payload(Model):
    """A rigid body that is held to the tool frame."""

    mass: Positive = Field(description="kg.")
    com: Vector3 = Field(default=(0.0, 0.0, 0.0), description="Centre of mass in the tool frame as the URDF has it, m.")
    inertia: InertiaMatrix | None = Field(
        default=None, description="Moments about the centre of mass, axes of the tool frame. Null: a point mass."
    )


_WORDS: Final = {"floor": (0.0, 0.0, 0.0), "wall": (0.0, 90.0, 0.0), "ceiling": (180.0, 0.0, 0.0)}
"""Roll, pitch and yaw of the usual mountings, degrees."""


def _spelled_out(mounting: object) -> object:
    """Read a word as a placement."""
    if not isinstance(mounting, str):
        return mounting
    if mounting not in _WORDS:
        allowed = f"{', '.join(_WORDS)}, or a mapping {{xyz: [x, y, z], rpy_deg: [roll, pitch, yaw]}}"
        raise refuse("no mounting", found=mounting, allowed=allowed)
    return {"rpy_deg": _WORDS[mounting]}


Mounting = Annotated[
    Placement,
    BeforeValidator(_spelled_out, json_schema_input_type=Literal["floor", "wall", "ceiling"] | Placement),
]
