"""The robot as the task file describes it: where its URDF is, its limits, its friction and what it carries.

Friction is written as limits are (see `brachis.task.limit_models`): absent, it is what the URDF's ``<dynamics>`` says.

What a task adds to the robot of the URDF: a payload, another tool frame, another place of the base.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field, model_validator

from brachis.task.fields import (
    ByForm,
    Model,
    Name,
    NonEmpty,
    NonNegative,
    Number,
    Positive,
    Share,
    plain,
    refuse,
)
from brachis.task.limit_models import FROM_URDF, LimitSpec
from brachis.task.orientation import Vector3


class Placement(Model):
    """Where a frame is in another one."""

    xyz: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="Position of the origin, m."
    )
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
        roll = math.atan2(
            sine * m[0][2] - cosine * m[1][2], cosine * m[1][1] - sine * m[0][1]
        )
        angles = [math.degrees(angle) for angle in (roll, pitch, yaw)]
        return {"xyz": [row[3] for row in m[:3]], "rpy_deg": angles}


class InertiaMatrix(Model):
    """Moments and products of inertia about the centre of mass, in the axes of the tool frame."""

    ixx: NonNegative = Field(description="Moment, kg m^2.")
    iyy: NonNegative = Field(description="Moment, kg m^2.")
    izz: NonNegative = Field(description="Moment, kg m^2.")
    ixy: Number = Field(
        default=0.0, description="Product, kg m^2, with the sign that URDFs have."
    )
    ixz: Number = Field(default=0.0, description="Product, kg m^2.")
    iyz: Number = Field(default=0.0, description="Product, kg m^2.")


class Payload(Model):
    """A rigid body that is held to the tool frame."""

    mass: Positive = Field(description="kg.")
    com: Vector3 = Field(
        default=(0.0, 0.0, 0.0),
        description="Centre of mass in the tool frame as the URDF has it, m.",
    )
    inertia: InertiaMatrix | None = Field(
        default=None,
        description="Moments about the centre of mass, axes of the tool frame. Null: a point mass.",
    )


_WORDS: Final = {
    "floor": (0.0, 0.0, 0.0),
    "wall": (0.0, 90.0, 0.0),
    "ceiling": (180.0, 0.0, 0.0),
}
"""Roll, pitch and yaw of the usual mountings, degrees."""


def _expand_word(mounting: object) -> object:
    """Read a word as a placement."""
    if not isinstance(mounting, str):
        return mounting
    if mounting not in _WORDS:
        raise refuse(
            "no mounting",
            found=mounting,
            allowed=f"{', '.join(_WORDS)}, or a mapping {{xyz: [x, y, z], rpy_deg: [roll, pitch, yaw]}}",
        )
    return {"rpy_deg": _WORDS[mounting]}


Mounting = Annotated[
    Placement,
    BeforeValidator(
        _expand_word,
        json_schema_input_type=Literal["floor", "wall", "ceiling"] | Placement,
    ),
]


PerJoint = Annotated[
    NonNegative | NonEmpty[NonNegative] | dict[Name, NonNegative],
    ByForm(
        "a number >= 0 for all joints, a list of numbers, a mapping of joint name to number"
    ),
]
PerJointPositive = Annotated[
    Positive | NonEmpty[Positive] | dict[Name, Positive],
    ByForm(
        "a number > 0 for all joints, a list of numbers, a mapping of joint name to number"
    ),
]
UrdfFriction = Annotated[
    Literal["urdf"]
    | NonNegative
    | NonEmpty[NonNegative]
    | dict[Name, NonNegative]
    | None,
    ByForm(
        "a number >= 0 for all joints, a list of numbers, a mapping of joint name to number, null (none), "
        "urdf (as in the URDF)"
    ),
]


class FrictionSettings(Model):
    """Drive inertia and friction at the joints: each a number for all joints, a list, or a mapping by joint name."""

    armature: PerJoint = Field(
        default=0.0, description="Inertia of the drive seen at the joint, kg m^2 (kg)."
    )
    rotor_inertia: PerJoint = Field(
        default=0.0,
        description="Inertia of the rotor about its own axis, kg m^2. With gear_ratio it takes the place of armature, "
        "which is rotor_inertia * gear_ratio^2.",
    )
    gear_ratio: PerJointPositive | None = Field(
        default=None,
        description="Turns of the rotor per turn of the joint (prismatic: rad per m). Null: none.",
    )
    viscous: UrdfFriction = Field(
        default=FROM_URDF,
        description="Viscous friction, N m s/rad (N s/m). Absent: URDF's damping. Null: none.",
    )
    coulomb: UrdfFriction = Field(
        default=FROM_URDF,
        description="Coulomb friction, N m (N). Absent: URDF's friction. Null: none.",
    )
    coulomb_velocity: PerJointPositive = Field(
        default=0.01,
        description="Speed at which Coulomb friction is developed to 76 % (tanh 1), rad/s (m/s).",
    )


class RobotSettings(Model):
    """The robot: its URDF and what the task adds to it."""

    urdf: Name | None = Field(
        default=None,
        description="URDF file, relative to the task file's folder. Required in a task file.",
    )
    tool_frame: Name | None = Field(
        default=None,
        description="Frame that follows the path. Null: the only leaf link.",
    )
    tool_offset: Placement = Field(
        default_factory=Placement,
        description="Where the frame that follows the path is in the tool frame of the URDF: {xyz: ..., rpy_deg: ...}.",
    )
    base_frame: Name | None = Field(
        default=None,
        description="First frame of the chain. Null: the root of the URDF.",
    )
    mounting: Mounting = Field(
        default_factory=Placement,
        description="Where the URDF's root link is in the world: floor, wall (its z axis along the world's x axis), "
        "ceiling (upside down, about x), or {xyz: ..., rpy_deg: ...}. Gravity and the path are in the world frame.",
    )
    gravity: tuple[Number, Number, Number] = Field(
        default=(0.0, 0.0, -9.81), description="Gravity [x, y, z], m/s^2, world frame."
    )
    locked_joints: dict[Name, Number] = Field(
        default={}, description="Joints that stay at a value, rad (m), by name."
    )
    payload: Payload | None = Field(
        default=None, description="Rigid body held to the tool frame. Null: none."
    )
    limits_file: Name | None = Field(
        default=None,
        description="File of joint limits, relative to the task file's folder, such as a maker's, or MoveIt's "
        "joint_limits.yaml. What limits says itself counts, joint by joint where it names joints. Null: none.",
    )
    limits: LimitSpec = Field(default_factory=LimitSpec, description="Joint limits.")
    speed_override: Annotated[Share, Field(gt=0.0)] = Field(
        default=1.0,
        description="Factor on all joint velocity limits beside limits.scale, for example 50 %, or 0.5. The motion is "
        "planned anew for the slower joints, and is not the same motion played more slowly; torque, acceleration and "
        "tool limits stay what they are.",
    )
    friction: FrictionSettings = Field(
        default_factory=FrictionSettings, description="Drive inertia and friction."
    )
