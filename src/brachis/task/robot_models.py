"""The robot as the task file describes it: where its URDF is, its limits, its friction and what it carries.

Friction is written as limits are (see `brachis.task.limit_models`): absent, it is what the URDF's ``<dynamics>`` says.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Tag

from brachis.task.fields import Model, Name, NonNegative, Number, Positive, Share, by_form
from brachis.task.limit_models import FROM_URDF, LimitSpec, Null, Numbers, OneNumber, UrdfWord
from brachis.task.mounting_models import Mounting, Payload, Placement

PerJoint = Annotated[
    Annotated[NonNegative, Tag("<number>")]
    | Annotated[Annotated[tuple[NonNegative, ...], Field(min_length=1)], Tag("<list>")]
    | Annotated[dict[Name, NonNegative], Tag("<mapping>")],
    by_form("a number >= 0 for all joints, a list of numbers, a mapping of joint name to number"),
]
PerJointPositive = Annotated[
    OneNumber | Numbers | Annotated[dict[Name, Positive], Tag("<mapping>")],
    by_form("a number > 0 for all joints, a list of numbers, a mapping of joint name to number"),
]
UrdfFriction = Annotated[
    UrdfWord
    | Annotated[NonNegative, Tag("<number>")]
    | Annotated[Annotated[tuple[NonNegative, ...], Field(min_length=1)], Tag("<list>")]
    | Annotated[dict[Name, NonNegative], Tag("<mapping>")]
    | Null,
    by_form(
        "a number >= 0 for all joints, a list of numbers, a mapping of joint name to number, null (none), "
        "urdf (as in the URDF)",
        FROM_URDF,
    ),
]


class FrictionSettings(Model):
    """Drive inertia and friction at the joints: each a number for all joints, a list, or a mapping by joint name."""

    armature: PerJoint = Field(default=0.0, description="Inertia of the drive seen at the joint, kg m^2 (kg).")
    rotor_inertia: PerJoint = Field(
        default=0.0,
        description="Inertia of the rotor about its own axis, kg m^2. With gear_ratio it takes the place of armature, "
        "which is rotor_inertia * gear_ratio^2.",
    )
    gear_ratio: PerJointPositive | None = Field(
        default=None, description="Turns of the rotor per turn of the joint (prismatic: rad per m). Null: none."
    )
    viscous: UrdfFriction = Field(
        default=FROM_URDF, description="Viscous friction, N m s/rad (N s/m). Absent: URDF's damping. Null: none."
    )
    coulomb: UrdfFriction = Field(
        default=FROM_URDF, description="Coulomb friction, N m (N). Absent: URDF's friction. Null: none."
    )
    coulomb_velocity: PerJointPositive = Field(
        default=0.01, description="Speed at which Coulomb friction is developed to 76 % (tanh 1), rad/s (m/s)."
    )


class RobotSettings(Model):
    """The robot: its URDF and what the task adds to it."""

    urdf: Name | None = Field(
        default=None, description="URDF file, relative to the task file's folder. Required in a task file."
    )
    tool_frame: Name | None = Field(default=None, description="Frame that follows the path. Null: the only leaf link.")
    tool_offset: Placement = Field(
        default_factory=Placement,
        description="Where the frame that follows the path is in the tool frame of the URDF: {xyz: ..., rpy_deg: ...}.",
    )
    base_frame: Name | None = Field(default=None, description="First frame of the chain. Null: the root of the URDF.")
    mounting: Mounting = Field(
        default_factory=Placement,
        description="Where the URDF's root link is in the world: floor, wall (its z axis along the world's x axis), "
        "ceiling (upside down, about x), or {xyz: ..., rpy_deg: ...}. Gravity and the path are in the world frame.",
    )
    gravity: tuple[Number, Number, Number] = Field(
        default=(0.0, 0.0, -9.81), description="Gravity [x, y, z], m/s^2, world frame."
    )
    locked_joints: dict[Name, Number] = Field(default={}, description="Joints that stay at a value, rad (m), by name.")
    payload: Payload | None = Field(default=None, description="Rigid body held to the tool frame. Null: none.")
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
    friction: FrictionSettings = Field(default_factory=FrictionSettings, description="Drive inertia and friction.")
