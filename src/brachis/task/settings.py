"""The settings of a task: the robot, with its friction, payload and mounting, and how to plan."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING, Annotated, Final, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from brachis.task.fields import (
    AnyNonNegative,
    ByForm,
    CheckedModel,
    Count,
    Flag,
    Mistake,
    Model,
    Name,
    NonEmpty,
    NonNegative,
    Number,
    Positive,
    Share,
    check_defined,
    refuse,
)
from brachis.task.limit_models import FROM_URDF, LimitSpec
from brachis.task.orientation import Vector3

if TYPE_CHECKING:
    from pinocchio import SE3


class Placement(Model):
    """Where a frame is in another one."""

    xyz: Vector3 = (0.0, 0.0, 0.0)
    """Position of the origin, m."""
    rpy_deg: Vector3 = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw, degrees, as in a URDF: about the fixed x, then y, then z axis."""

    @model_validator(mode="before")
    @classmethod
    def _of_transform(cls, content: object) -> object:
        """Take a transform such as Pinocchio's SE3 too."""
        if not hasattr(content, "homogeneous"):
            return content
        from pinocchio import rpy

        matrix = np.array(content.homogeneous)
        angles = np.degrees(rpy.matrixToRpy(matrix[:3, :3]))
        return {"xyz": matrix[:3, 3].tolist(), "rpy_deg": angles.tolist()}

    @property
    def transform(self) -> SE3:
        """The placement as Pinocchio's transform."""
        from pinocchio import SE3, rpy

        return SE3(rpy.rpyToMatrix(*np.radians(self.rpy_deg)), np.array(self.xyz))


class FramePlacement(Placement):
    """Where a frame is in the world, or in another frame."""

    frame: Name | None = None
    """Name of the frame in which it is placed. Null: the world."""


def place_frame(frames: Mapping[str, FramePlacement], name: str | None) -> Placement:
    """Return where a frame is in the world, through all frames in which it is placed; None is the world."""
    if name is None:
        return Placement()
    placed = frames[name]
    if placed.frame is None:
        return placed
    transform = placed.transform
    while placed.frame is not None:
        placed = frames[placed.frame]
        transform = placed.transform * transform
    return Placement.model_validate(transform)


def check_frames(
    frames: Mapping[str, FramePlacement], uses: Mapping[str, str | None]
) -> None:
    """Refuse names of frames, by the keys that use them, that are not defined, and frames that are in themselves.

    Raises
    ------
    PydanticCustomError
    """
    inner = {f"frames.{name}.frame": frame.frame for name, frame in frames.items()}
    check_defined("frame", {**uses, **inner}, frames)
    outer = {name: [frame.frame] for name, frame in frames.items()}
    try:
        TopologicalSorter(outer).prepare()
    except CycleError as error:
        cycle = error.args[1][::-1]
        raise refuse(
            "the frame is placed in itself",
            key=f"frames.{cycle[0]}.frame",
            found=" in ".join(cycle[:4]),
            allowed="frames that lead to the world",
        ) from None


class InertiaMatrix(Model):
    """Moments and products of inertia about the centre of mass, in the axes of the tool frame."""

    ixx: NonNegative
    """Moment of inertia, kg m^2."""
    iyy: NonNegative
    """Moment of inertia, kg m^2."""
    izz: NonNegative
    """Moment of inertia, kg m^2."""
    ixy: Number = 0.0
    """Product of inertia, kg m^2, with the sign as in a URDF."""
    ixz: Number = 0.0
    """Product of inertia, kg m^2."""
    iyz: Number = 0.0
    """Product of inertia, kg m^2."""


class Payload(Model):
    """A rigid body that is held to the tool frame."""

    mass: Positive
    """Mass, kg."""
    com: Vector3 = (0.0, 0.0, 0.0)
    """Centre of mass in the tool frame of the URDF, m."""
    inertia: InertiaMatrix | None = None
    """Inertia about the centre of mass, in the axes of the tool frame. Null: a point mass."""


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
    AnyNonNegative | NonEmpty[AnyNonNegative] | dict[Name, AnyNonNegative],
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
    | AnyNonNegative
    | NonEmpty[AnyNonNegative]
    | dict[Name, AnyNonNegative]
    | None,
    ByForm(
        "a number >= 0 for all joints, a list of numbers, a mapping of joint name to number, null (none), "
        "urdf (as in the URDF)"
    ),
]


class FrictionSettings(Model):
    """Drive inertia and friction at the joints: each a number for all joints, a list, or a mapping by joint name."""

    armature: UrdfFriction = FROM_URDF
    """Inertia of the drive as seen at the joint, kg m^2 (kg). Absent: armature of an MJCF file or Pinocchio model; a
    URDF has none. Null: none."""
    rotor_inertia: PerJoint = 0.0
    """Inertia of the rotor about its own axis, kg m^2. With gear_ratio it replaces armature: armature = rotor_inertia *
    gear_ratio^2."""
    gear_ratio: PerJointPositive | None = None
    """Turns of the rotor per turn of the joint (prismatic joints: rad per m). Null: none."""
    viscous: UrdfFriction = FROM_URDF
    """Viscous friction, N m s/rad (N s/m). Absent: damping of the URDF. Null: none."""
    coulomb: UrdfFriction = FROM_URDF
    """Coulomb friction, N m (N). Absent: friction of the URDF. Null: none."""
    coulomb_velocity: PerJointPositive = 0.01
    """Speed at which Coulomb friction reaches 76 % (tanh 1) of its value, rad/s (m/s)."""


class RobotSettings(Model):
    """The robot: its URDF and what the task adds to it."""

    urdf: Name | None = None
    """URDF file, relative to the task file's folder, or the name of an included robot. Required in a task file."""
    tool_frame: Name | None = None
    """Frame that follows the path. Null: the only leaf link."""
    tool_offset: Placement = Field(default_factory=Placement)
    """Place of the frame that follows the path, in the tool frame of the URDF: {xyz: ..., rpy_deg: ...}."""
    base_frame: Name | None = None
    """First frame of the chain. Null: the root of the URDF."""
    mounting: Mounting = Field(default_factory=Placement)
    """Place of the URDF's root link in the world: floor, wall (its z axis along the world's x axis), ceiling (turned
    upside down about x), or {xyz: ..., rpy_deg: ...}. Gravity and the path are in the world frame."""
    gravity: tuple[Number, Number, Number] = (0.0, 0.0, -9.81)
    """Gravity [x, y, z] in the world frame, m/s^2."""
    locked_joints: dict[Name, Number] = Field(default={})
    """Joints that do not move: their positions by name, rad (m). A joint that mimics one of them follows it."""
    payload: Payload | None = None
    """Rigid body fixed to the tool frame. Null: none."""
    limits_file: Name | None = None
    """File of joint limits, relative to the task file's folder, for example MoveIt's joint_limits.yaml. Values in
    limits come first, for each joint named there. Null: none."""
    limits: LimitSpec = Field(default_factory=LimitSpec)
    """Joint limits."""
    speed_override: Share = Field(default=1.0, gt=0.0, le=1.0)
    """Factor on all joint velocity limits, in addition to limits.scale; for example 50 % or 0.5. The motion is planned
    for these lower limits, not played more slowly. Other limits do not change."""
    friction: FrictionSettings = Field(default_factory=FrictionSettings)
    """Drive inertia and friction."""


_VANISHING: Final = {"velocity": 1, "full": 2, "jerk": 3}
Intervals = Annotated[
    Literal["auto"] | Annotated[Count, Field(ge=4, le=10_000)],
    ByForm("auto, or a whole number"),
]


class SplineSettings(CheckedModel):
    """The B-splines of the path coordinate and the redundant joints."""

    degree: Count = Field(default=3, ge=2, le=7)
    """Degree of the splines; 3 gives continuous torque, 4 continuous torque rate."""
    intervals: Intervals = "auto"
    """Number of knot intervals of every phase. auto gives the fastest timing of the best joint path, with knots where
    it needs them; with limits on jerk, torque rate or means it halves the intervals that lose most time, until two
    rounds together gain less than half the tolerance. A number makes planning faster and the motion slower. knots:
    free needs a number."""
    tolerance: Share = Field(default=1.0e-3, gt=0.0, le=0.1)
    """With intervals: auto, the accepted loss against very many intervals, relative to the end time t_E: 0.1 % or
    0.001, for example."""
    knots: Literal["uniform", "free"] = "uniform"
    """uniform: intervals of equal length; free: their lengths are variables of the optimisation."""
    shortest_interval: Share = Field(default=0.1, gt=0.0, lt=1.0)
    """With knots: free, the shortest interval as a fraction of the mean one; never less than 5e-5 t_E."""
    rest: Literal["velocity", "full", "jerk"] = "full"
    """What is zero at both ends and at stops. velocity: the velocity. full: velocity and acceleration. jerk: velocity,
    acceleration, jerk, and with them the torque rates; needs degree >= 4."""
    points_per_interval: Count = Field(default=3, ge=1, le=100)
    """Collocation points per knot interval."""

    @property
    def vanishing(self) -> int:
        """How many derivatives of the joint positions vanish at both ends and at stops."""
        return _VANISHING[self.rest]

    def _mistakes(self) -> Iterator[Mistake]:
        order = self.vanishing
        if order > 1 and self.degree <= order:
            lower = [word for word, level in _VANISHING.items() if level < self.degree]
            yield (
                "degree",
                f"rest: {self.rest} needs {order} continuous derivatives, zero at the ends: the degree is too low",
                f">= {order + 1}, or rest: {' or '.join(lower)}",
            )
        if self.knots == "free" and self.intervals == "auto":
            yield (
                "intervals",
                "knots: free needs a number of intervals; auto is the default",
                "a number such as 12, or knots: uniform",
            )


Jobs = Annotated[
    Literal["auto"] | Annotated[Count, Field(ge=1)],
    ByForm("auto, or a whole number"),
]


class SearchSettings(CheckedModel):
    """The search over redundant joints, branches and initial guesses."""

    effort: Literal["single", "fast", "thorough", "exhaustive"] = "fast"
    """How far the search goes: single, fast, thorough or exhaustive. single plans once, from the best guess, and
    continues like fast only if that fails. The last two use more guesses."""
    guesses: Literal["lattice", "numeric"] = "lattice"
    """Source of the initial guesses: lattice (a lattice of postures) or numeric (inverse kinematics from the start
    posture)."""
    jobs: Jobs = 1
    """Number of processes that plan at the same time, limited to the number of processors. auto: all processors, if the
    remaining work takes longer than 3 s, or 0.7 s if an earlier plan has started them. The answer does not depend on it
    unless the time runs out."""
    time_limit: Positive = Field(default=60.0, le=1e6)
    """Time limit of the whole plan, s. The best verified motion found by then is returned; if there is none, an
    unverified one, up to two seconds later."""
    seed: Count = Field(default=0, ge=0)
    """Seed of the random numbers."""
    least_motion: Flag = True
    """Whether the smoothest motion is chosen: least joint accelerations, with an end time within 1e-4 (relative) of the
    fastest. With more than 200 variables, as intervals: auto often has, it is looked for only with `slower`."""
    slower: Share = Field(default=0.0, ge=0.0, le=1.0)
    """How much slower the smoothest motion may be, for example 1 % or 0.01."""

    def _mistakes(self) -> Iterator[Mistake]:
        if self.slower and not self.least_motion:
            yield (
                "slower",
                "a slower motion is possible only with least_motion: true",
                "0, or least_motion: true",
            )


class SolverSettings(Model):
    """The solver of the optimisation problem and its bounds."""

    name: Name = "auto"
    """Name of the solver: auto, uno, ipopt (if ipyopt is installed) or uno_interior. auto begins with uno."""
    max_iterations: Count = Field(default=300, ge=1, le=1_000_000)
    """Maximum number of iterations."""
    time_limit: Positive = Field(default=60.0, le=1e6)
    """Maximum time of one solve, s."""
    tolerance: Positive = 1.0e-6
    """Tolerance of the optimality conditions."""


class RefinementSettings(Model):
    """Adding collocation points until the limits hold in between them as well."""

    tolerance: Share = Field(default=1.0e-4, ge=1.0e-5, le=0.01)
    """Largest accepted violation of a limit at any time, relative to the limit. For a position: in rad (m), or relative
    to half its range if that is less than 1 rad (m). The checks do not resolve less than 1e-5."""
    density: Count = Field(default=10, ge=10, le=1000)
    """Number of points per collocation point at which limits are checked."""
    max_rounds: Count = Field(default=10, ge=0, le=1000)
    """Maximum number of rounds; 0 switches refinement off."""


def expand_solver_name(solver: object) -> object:
    """Read ``solver: ipopt`` as the solver's name."""
    return {"name": solver} if isinstance(solver, str) else solver


class BoundarySettings(CheckedModel):
    """Speeds at both ends of the path, or a motion that goes round for ever."""

    start_speed: NonNegative = Field(default=0.0, le=1e6)
    """Speed along the path at its start, m/s. It is in rad/s if the tool only turns there; along a path of joints it is
    the norm of the joint velocities. If it is not zero, velocities of redundant joints are free there, and with
    spline.rest: full the speed does not change at that instant."""
    end_speed: NonNegative = Field(default=0.0, le=1e6)
    """The same at the path's end."""
    periodic: Flag = False
    """Whether a closed path is repeated without stopping: posture, velocity and acceleration at its end equal those at
    its start; a joint without a range may have made whole turns. With spline.degree: 2 the acceleration jumps there."""

    def _mistakes(self) -> Iterator[Mistake]:
        for key in ("start_speed", "end_speed"):
            if self.periodic and getattr(self, key):
                yield (
                    key,
                    "a periodic motion has no ends, so its speed there cannot be set",
                    "0, or periodic: false",
                )

    @property
    def in_motion(self) -> bool:
        """Whether an end is passed in motion."""
        return self.periodic or self.start_speed > 0.0 or self.end_speed > 0.0
