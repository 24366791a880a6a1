"""The settings of a task: the robot, with its friction, payload and mounting, and how to plan."""

from __future__ import annotations

import math
from typing import Annotated, Any, Final, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from brachis.task.fields import (
    ByForm,
    Count,
    Flag,
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

    xyz: Vector3 = (0.0, 0.0, 0.0)
    """Position of the origin, m."""
    rpy_deg: Vector3 = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw, degrees, as in a URDF: about the fixed x, then y, then z axis."""

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

    ixx: NonNegative
    """Moment, kg m^2."""
    iyy: NonNegative
    """Moment, kg m^2."""
    izz: NonNegative
    """Moment, kg m^2."""
    ixy: Number = 0.0
    """Product, kg m^2, with the sign that URDFs have."""
    ixz: Number = 0.0
    """Product, kg m^2."""
    iyz: Number = 0.0
    """Product, kg m^2."""


class Payload(Model):
    """A rigid body that is held to the tool frame."""

    mass: Positive
    """kg."""
    com: Vector3 = (0.0, 0.0, 0.0)
    """Centre of mass in the tool frame as the URDF has it, m."""
    inertia: InertiaMatrix | None = None
    """Moments about the centre of mass, axes of the tool frame. Null: a point mass."""


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

    armature: PerJoint = 0.0
    """Inertia of the drive seen at the joint, kg m^2 (kg)."""
    rotor_inertia: PerJoint = 0.0
    """Inertia of the rotor about its own axis, kg m^2. With gear_ratio it takes the place of armature, which is
    rotor_inertia * gear_ratio^2."""
    gear_ratio: PerJointPositive | None = None
    """Turns of the rotor per turn of the joint (prismatic: rad per m). Null: none."""
    viscous: UrdfFriction = FROM_URDF
    """Viscous friction, N m s/rad (N s/m). Absent: URDF's damping. Null: none."""
    coulomb: UrdfFriction = FROM_URDF
    """Coulomb friction, N m (N). Absent: URDF's friction. Null: none."""
    coulomb_velocity: PerJointPositive = 0.01
    """Speed at which Coulomb friction is developed to 76 % (tanh 1), rad/s (m/s)."""


class RobotSettings(Model):
    """The robot: its URDF and what the task adds to it."""

    urdf: Name | None = None
    """URDF file, relative to the task file's folder. Required in a task file."""
    tool_frame: Name | None = None
    """Frame that follows the path. Null: the only leaf link."""
    tool_offset: Placement = Field(default_factory=Placement)
    """Where the frame that follows the path is in the tool frame of the URDF: {xyz: ..., rpy_deg: ...}."""
    base_frame: Name | None = None
    """First frame of the chain. Null: the root of the URDF."""
    mounting: Mounting = Field(default_factory=Placement)
    """Where the URDF's root link is in the world: floor, wall (its z axis along the world's x axis), ceiling (upside
    down, about x), or {xyz: ..., rpy_deg: ...}. Gravity and the path are in the world frame."""
    gravity: tuple[Number, Number, Number] = (0.0, 0.0, -9.81)
    """Gravity [x, y, z], m/s^2, world frame."""
    locked_joints: dict[Name, Number] = Field(default={})
    """Joints that stay at a value, rad (m), by name."""
    payload: Payload | None = None
    """Rigid body held to the tool frame. Null: none."""
    limits_file: Name | None = None
    """File of joint limits, relative to the task file's folder, such as a maker's, or MoveIt's joint_limits.yaml. What
    limits says itself counts, joint by joint where it names joints. Null: none."""
    limits: LimitSpec = Field(default_factory=LimitSpec)
    """Joint limits."""
    speed_override: Annotated[Share, Field(gt=0.0)] = 1.0
    """Factor on all joint velocity limits beside limits.scale, for example 50 %, or 0.5. The motion is planned anew for
    the slower joints, and is not the same motion played more slowly; torque, acceleration and tool limits stay what
    they are."""
    friction: FrictionSettings = Field(default_factory=FrictionSettings)
    """Drive inertia and friction."""


_VANISHING: Final = {"velocity": 1, "full": 2, "jerk": 3}
Intervals = Annotated[
    Literal["auto"] | Annotated[Count, Field(ge=4, le=10_000)],
    ByForm("auto, or a whole number"),
]


class SplineSettings(Model):
    """The B-splines of the path coordinate and the redundant joints."""

    degree: Count = Field(default=3, ge=2, le=7)
    """Degree; 3 gives continuous torque, 4 continuous torque rate."""
    intervals: Intervals = "auto"
    """Number of knot intervals; auto halves those that lose most time until two rounds together gain less than half the
    tolerance. A number plans sooner, and gives a slower motion; knots: free needs one."""
    tolerance: Positive = Field(default=1.0e-3, le=0.1)
    """With intervals: auto, how near, as a fraction of t_E, the end time is to be to that of many."""
    knots: Literal["uniform", "free"] = "uniform"
    """Equal intervals, or their lengths as variables of the optimisation."""
    shortest_interval: Positive = Field(default=0.1, lt=1.0)
    """With knots: free, the least length of an interval, in mean intervals; never less than 5e-5 t_E."""
    rest: Literal["velocity", "full", "jerk"] = "full"
    """What vanishes at both ends: velocity alone; velocity and acceleration (full); or velocity, acceleration and jerk,
    and with them the rates of the torques (jerk; degree 4 at least)."""
    points_per_interval: Count = Field(default=3, ge=1, le=100)
    """Collocation points per knot interval."""

    @property
    def vanishing(self) -> int:
        """How many derivatives of the joint positions vanish at both ends."""
        return _VANISHING[self.rest]

    @model_validator(mode="after")
    def _keys_agree(self) -> Self:
        order = self.vanishing
        last = ("", "speed", "acceleration", "jerk")[order]
        lower = [
            f"rest: {word}"
            for word, level in _VANISHING.items()
            if level < min(order, self.degree)
        ]
        return self.check(
            (
                order > 1 and self.degree <= order,
                "degree",
                f"rest: {self.rest} needs a continuous {last}, zero at the ends: degree {self.degree} is too low",
                f">= {order + 1}, or {' or '.join(lower)}",
            ),
            (
                self.knots == "free" and self.intervals == "auto",
                "intervals",
                "knots: free needs a number of intervals; auto is the default",
                "a number such as 12, or knots: uniform",
            ),
        )


class SearchSettings(Model):
    """The search over redundant joints, branches and initial guesses."""

    effort: Literal["single", "fast", "thorough", "exhaustive"] = "fast"
    """How far the search goes: single plans once, from the most promising guess, and goes on only if that fails."""
    guesses: Literal["lattice", "numeric"] = "lattice"
    """Where initial guesses come from: a lattice of postures, or numeric inverse kinematics from the start posture."""
    jobs: Count = Field(default=1, ge=1)
    """Processes that plan at the same time; no more than there are processors are used."""
    time_limit: Positive = Field(default=60.0, le=1e6)
    """Time from the call after which the best motion so far is returned, s; one that is not verified where none is, a
    second later perhaps."""
    seed: Count = Field(default=0, ge=0)
    """Seed of what is drawn at random."""
    least_motion: Flag = True
    """Whether, of motions that are as fast as the fastest one to 1e-4, the calmest one is taken: that with the least
    joint accelerations."""
    slower: Share = 0.0
    """How much slower the calmest motion may be, for example 1 %, or 0.01."""

    @model_validator(mode="after")
    def _slower_is_for_least_motion(self) -> Self:
        return self.check(
            (
                self.slower and not self.least_motion,
                "slower",
                "a slower motion is possible only with least_motion: true",
                "0, or least_motion: true",
            )
        )


class SolverSettings(Model):
    """The solver of the optimisation problem and its bounds."""

    name: Name = "auto"
    """Solver; auto takes the best one installed."""
    max_iterations: Count = Field(default=300, ge=1, le=1_000_000)
    """Largest number of iterations."""
    time_limit: Positive = Field(default=20.0, le=1e6)
    """Largest time of one solve, s; search.time_limit bounds the whole plan."""
    tolerance: Positive = 1.0e-6
    """Tolerance of the optimality conditions."""


class RefinementSettings(Model):
    """Adding collocation points until the limits hold in between them as well."""

    tolerance: Positive = Field(default=1.0e-4, ge=1.0e-5, le=0.01)
    """Largest relative violation of a limit, anywhere; of a position, beyond its range, in rad (m), or in half ranges
    where these are shorter. What is less than 1e-5 the checks do not show."""
    density: Count = Field(default=10, ge=10, le=1000)
    """Grid points for checking limits, per collocation point."""
    max_rounds: Count = Field(default=10, ge=0, le=1000)
    """Largest number of rounds; 0 switches refinement off."""


def expand_solver_name(solver: object) -> object:
    """Read ``solver: ipopt`` as the solver's name."""
    return {"name": solver} if isinstance(solver, str) else solver


class BoundarySettings(Model):
    """Speeds at both ends of the path, or a motion that goes round for ever."""

    start_speed: NonNegative = Field(default=0.0, le=1e6)
    """Speed along the path at its start, m/s (rad/s where the position stands still; along a path of joints the norm of
    their velocities). At an end in motion the redundant joints' velocities are free, and spline.rest: full says that
    the speed begins, or ends, constant."""
    end_speed: NonNegative = Field(default=0.0, le=1e6)
    """As start_speed, at the path's end."""
    periodic: Flag = False
    """Whether a closed path is gone round for ever: posture, velocity and acceleration at its end are those at its
    start (with spline.degree: 2 the acceleration jumps)."""

    @model_validator(mode="after")
    def _periodic_has_no_ends(self) -> Self:
        return self.check(
            *(
                (
                    self.periodic and getattr(self, key),
                    key,
                    "a periodic motion has no ends, so its speed there cannot be set",
                    "0, or periodic: false",
                )
                for key in ("start_speed", "end_speed")
            )
        )

    @property
    def in_motion(self) -> bool:
        """Whether an end is passed in motion."""
        return self.periodic or self.start_speed > 0.0 or self.end_speed > 0.0
