"""The settings of a task: the robot with its friction, payload and mounting, and the planner."""

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
    """The placement of a frame relative to another frame."""

    xyz: Vector3 = (0.0, 0.0, 0.0)
    """Position of the origin, m."""
    rpy_deg: Vector3 = (0.0, 0.0, 0.0)
    """Roll, pitch and yaw about the fixed x, y and z axes, degrees, as in a URDF."""

    @model_validator(mode="before")
    @classmethod
    def _of_transform(cls, content: object) -> object:
        """Accept a transform such as Pinocchio's SE3."""
        if not hasattr(content, "homogeneous"):
            return content
        from pinocchio import rpy

        # Without the noise of products, files show the digits that the user gave.
        matrix = np.array(content.homogeneous)
        angles = np.degrees(rpy.matrixToRpy(matrix[:3, :3])).round(12)
        return {"xyz": matrix[:3, 3].round(12).tolist(), "rpy_deg": angles.tolist()}

    @property
    def transform(self) -> SE3:
        """The placement as a Pinocchio transform."""
        from pinocchio import SE3, rpy

        return SE3(rpy.rpyToMatrix(*np.radians(self.rpy_deg)), np.array(self.xyz))


class FramePlacement(Placement):
    """The placement of a named frame in the world or in another frame."""

    frame: Name | None = None
    """Frame in which it is placed. Null: the world."""


def place_frame(frames: Mapping[str, FramePlacement], name: str | None) -> Placement:
    """Return the placement of a frame in the world, through all frames in which it is placed. None is the world."""
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
    """Refuse frames that are placed in themselves, and names of undefined frames; `uses` contains the names by key.

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
            allowed="a chain of frames that ends in the world",
        ) from None


class InertiaMatrix(Model):
    """Moments and products of inertia about the centre of mass, along the axes of the tool frame."""

    ixx: NonNegative
    """Moment of inertia, kg m^2."""
    iyy: NonNegative
    """Moment of inertia, kg m^2."""
    izz: NonNegative
    """Moment of inertia, kg m^2."""
    ixy: Number = 0.0
    """Product of inertia, kg m^2, signs as in a URDF."""
    ixz: Number = 0.0
    """Product of inertia, kg m^2, signs as in a URDF."""
    iyz: Number = 0.0
    """Product of inertia, kg m^2, signs as in a URDF."""


class Payload(Model):
    """A rigid body fixed to the tool frame."""

    mass: Positive
    """Mass, kg."""
    com: Vector3 = (0.0, 0.0, 0.0)
    """Centre of mass in the tool frame of the URDF, m."""
    inertia: InertiaMatrix | None = None
    """Inertia about the centre of mass, along the axes of the tool frame. Null: a point mass."""


_WORDS: Final = {
    "floor": (0.0, 0.0, 0.0),
    "wall": (0.0, 90.0, 0.0),
    "ceiling": (180.0, 0.0, 0.0),
}
"""Roll, pitch and yaw of each named mounting, degrees."""


def _expand_word(mounting: object) -> object:
    """Return the placement that a word such as ``wall`` stands for."""
    if not isinstance(mounting, str):
        return mounting
    if mounting not in _WORDS:
        raise refuse(
            "this mounting is unknown",
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
        "a number >= 0 for all joints, a list of numbers, or a mapping of joint names to numbers"
    ),
]
PerJointPositive = Annotated[
    Positive | NonEmpty[Positive] | dict[Name, Positive],
    ByForm(
        "a number > 0 for all joints, a list of numbers, or a mapping of joint names to numbers"
    ),
]
UrdfFriction = Annotated[
    Literal["urdf"]
    | AnyNonNegative
    | NonEmpty[AnyNonNegative]
    | dict[Name, AnyNonNegative]
    | None,
    ByForm(
        "a number >= 0 for all joints, a list of numbers, a mapping of joint names to numbers, null (none), "
        "or urdf (as in the URDF)"
    ),
]


class FrictionSettings(Model):
    """Drive inertia and friction at the joints: each a number for all joints, a list, or a mapping by joint name."""

    armature: UrdfFriction = FROM_URDF
    """Inertia of the drive reflected to the joint, kg m^2 (kg). Absent: the value of an MJCF file or Pinocchio
    model."""
    rotor_inertia: PerJoint = 0.0
    """Inertia of the rotor about its axis, kg m^2; armature is then rotor_inertia * gear_ratio^2."""
    gear_ratio: PerJointPositive | None = None
    """Turns of the rotor per turn of the joint (for a prismatic joint, rad per m)."""
    viscous: UrdfFriction = FROM_URDF
    """Viscous friction, N m s/rad (N s/m). Absent: the damping in the URDF."""
    coulomb: UrdfFriction = FROM_URDF
    """Coulomb friction, N m (N). Absent: the friction in the URDF."""
    coulomb_velocity: PerJointPositive = 0.01
    """Speed at which Coulomb friction reaches 76 % (tanh 1) of its full value, rad/s (m/s)."""


class RobotSettings(Model):
    """The robot: its URDF, and settings that the URDF does not contain."""

    urdf: Name | None = None
    """URDF or MJCF file, or name of an included robot. Required in a task file."""
    tool_frame: Name | None = None
    """Frame that follows the path. Null: the only leaf link."""
    tool_offset: Placement = Field(default_factory=Placement)
    """Placement of the frame that follows the path, relative to tool_frame: {xyz: ..., rpy_deg: ...}."""
    base_frame: Name | None = None
    """First frame of the chain. Null: the root of the URDF."""
    workpiece_frame: Name | None = None
    """Link that carries the workpiece, such as a positioner's table, in whose frame paths and their frames are given,
    but not bodies. Null: the world frame."""
    mounting: Mounting = Field(default_factory=Placement)
    """Placement of the root link of the URDF in the world: floor, wall (z along the world's x axis), ceiling (upside
    down, turned about x), or {xyz: ..., rpy_deg: ...}."""
    gravity: tuple[Number, Number, Number] = (0.0, 0.0, -9.81)
    """Gravity [x, y, z] in the world frame, m/s^2."""
    locked_joints: dict[Name, Number] = Field(default={})
    """Positions of joints that do not move, by name, rad (m). Joints that mimic them get the matching positions."""
    payload: Payload | None = None
    """Rigid body fixed to the tool frame: {mass: ..., com: ..., inertia: ...}."""
    limits_file: Name | None = None
    """File of joint limits, such as MoveIt's joint_limits.yaml."""
    limits: LimitSpec = Field(default_factory=LimitSpec)
    """Joint limits."""
    speed_override: Share = Field(default=1.0, gt=0.0, le=1.0)
    """Factor on all velocity limits, in addition to limits.scale; for example 50 % or 0.5. The motion is planned for
    these lower limits, not played more slowly."""
    friction: FrictionSettings = Field(default_factory=FrictionSettings)
    """Drive inertia and friction."""

    @property
    def base_placement(self) -> Placement:
        """Placement of the chain's first link in the frame of the paths: there is none in the workpiece frame."""
        return self.mounting if self.workpiece_frame is None else Placement()

    def without_defaults(self) -> RobotSettings:
        """Return the settings without those that have their default value, so that these can be set later."""
        default = RobotSettings()
        return RobotSettings(
            **{key: value for key, value in self if value != getattr(default, key)}
        )


_VANISHING: Final = {"velocity": 1, "full": 2, "jerk": 3}
Intervals = Annotated[
    Literal["auto"] | Annotated[Count, Field(ge=4, le=10_000)],
    ByForm("auto, or a whole number"),
]


class SplineSettings(CheckedModel):
    """Settings of the B-splines of the path coordinate and the redundant joints."""

    degree: Count = Field(default=3, ge=2, le=7)
    """Degree of the splines: 3 for a continuous torque, 4 for a continuous torque rate."""
    intervals: Intervals = "auto"
    """Number of knot intervals of every phase. auto: fastest timing of the best joint path, with knots where needed;
    with limits on jerk, torque rate or mean values, the intervals that cost most time are halved until two rounds gain
    less than half the tolerance. A number (required by knots: free) makes planning faster and the motion slower.
    """
    tolerance: Share = Field(default=1.0e-3, gt=0.0, le=0.1)
    """With intervals: auto, accepted increase of the end time over that with very many intervals, such as 0.1 % or
    0.001."""
    knots: Literal["uniform", "free"] = "uniform"
    """uniform: intervals of equal length. free: their lengths are optimised."""
    shortest_interval: Share = Field(default=0.1, gt=0.0, lt=1.0)
    """With knots: free, shortest interval relative to the mean interval; never below 5e-5 of the end time."""
    rest: Literal["velocity", "full", "jerk"] = "full"
    """Derivatives that are zero at both ends and at stops. velocity: the velocity. full: also the acceleration. jerk:
    also the jerk and the torque rate; needs degree >= 4."""
    points_per_interval: Count = Field(default=3, ge=1, le=100)
    """Number of collocation points in each knot interval."""

    @property
    def vanishing(self) -> int:
        """Number of derivatives of the joint positions that are zero at both ends and at stops."""
        return _VANISHING[self.rest]

    def _mistakes(self) -> Iterator[Mistake]:
        order = self.vanishing
        if order > 1 and self.degree <= order:
            lower = [word for word, level in _VANISHING.items() if level < self.degree]
            yield (
                "degree",
                f"rest: {self.rest} needs {order} continuous derivatives, zero at the ends; the degree is too low",
                f">= {order + 1}, or rest: {' or '.join(lower)}",
            )
        if self.knots == "free" and self.intervals == "auto":
            yield (
                "intervals",
                "knots: free needs a number of intervals, but the default is auto",
                "a number such as 12, or knots: uniform",
            )


Jobs = Annotated[
    Literal["auto"] | Annotated[Count, Field(ge=1)],
    ByForm("auto, or a whole number"),
]


class SearchSettings(CheckedModel):
    """Settings of the search over redundant joints, branches and initial guesses."""

    effort: Literal["single", "fast", "thorough", "exhaustive"] = "fast"
    """Extent of the search, from few to many guesses: single (one plan from the best guess; like fast if it fails),
    fast, thorough, exhaustive."""
    guesses: Literal["lattice", "numeric"] = "lattice"
    """Source of the initial guesses: lattice (of postures) or numeric (inverse kinematics from the start posture)."""
    jobs: Jobs = 1
    """Number of parallel processes, at most the number of processors. auto: all processors if the remaining work takes
    more than 3 s, or 0.7 s if the processes already run. The result does not depend on the number, unless the time runs
    out.
    """
    time_limit: Positive = Field(default=60.0, le=1e6)
    """Time limit of the plan, s. Then the best verified motion is returned, or up to 2 s later an unverified one."""
    seed: Count = Field(default=0, ge=0)
    """Seed of the random number generator."""
    least_motion: Flag = True
    """Whether to choose the smoothest motion (least joint accelerations) within 1e-4 of the fastest end time. With more
    than 300 variables, which are common with intervals: auto, slower is required."""
    slower: Share = Field(default=0.0, ge=0.0, le=1.0)
    """Fraction by which the smoothest motion may be slower, for example 1 % or 0.01."""

    def _mistakes(self) -> Iterator[Mistake]:
        if self.slower and not self.least_motion:
            yield (
                "slower",
                "a slower motion is possible only with least_motion: true",
                "0, or least_motion: true",
            )


class SolverSettings(Model):
    """Settings of the solver of the optimisation problem."""

    name: Name = "auto"
    """One of auto (tries uno first), uno, uno_interior, and ipopt (only if ipyopt is installed)."""
    max_iterations: Count = Field(default=300, ge=1, le=1_000_000)
    """Maximum number of iterations."""
    time_limit: Positive = Field(default=60.0, le=1e6)
    """Maximum time of one solve, s."""
    tolerance: Positive = 1.0e-6
    """Tolerance of the optimality conditions."""


class RefinementSettings(Model):
    """Settings for adding collocation points until limits are also met between them."""

    tolerance: Share = Field(default=1.0e-4, ge=1.0e-5, le=0.01)
    """Maximum accepted violation of a limit at any time, relative to the limit. For a position: in rad (m), or relative
    to half the range if this is below 1 rad (m). The checks do not resolve less than 1e-5."""
    density: Count = Field(default=10, ge=10, le=1000)
    """Number of points per collocation point at which limits are checked."""
    max_rounds: Count = Field(default=10, ge=0, le=1000)
    """Maximum number of rounds. 0: no refinement."""


def expand_solver_name(solver: object) -> object:
    """Return the mapping for a solver that is given only by name, as in ``solver: ipopt``."""
    return {"name": solver} if isinstance(solver, str) else solver


FREE: Final = "free"
"""Word for a speed that the planner chooses."""
EndSpeed = Annotated[
    Literal["free"] | Annotated[NonNegative, Field(le=1e6)],
    ByForm("free, or a number"),
]


class BoundarySettings(CheckedModel):
    """Speeds at both ends of the path, or an endlessly repeated motion."""

    start_speed: EndSpeed = 0.0
    """Speed along the path at its start, m/s (rad/s if the tool only turns there; for a joint path the norm of the
    joint velocities). If it is not zero, the velocities of redundant joints are free there; with spline.rest: full the
    speed is constant at that instant. free: the best speed, with any acceleration."""
    end_speed: EndSpeed = 0.0
    """Speed along the path at its end, in the same unit, or free."""
    periodic: Flag = False
    """Whether a closed path is repeated without stopping. It then ends with the posture (except for whole turns of
    joints without a range), velocity and acceleration of its start. With spline.degree: 2 the acceleration jumps
    there."""

    def _mistakes(self) -> Iterator[Mistake]:
        for key in ("start_speed", "end_speed"):
            if self.periodic and getattr(self, key):
                yield (
                    key,
                    "a periodic motion has no ends, so a speed at its ends cannot be set",
                    "0, or periodic: false",
                )

    @property
    def in_motion(self) -> bool:
        """Whether the robot is in motion at an end of the path."""
        return self.periodic or any(self.speeds)

    @property
    def speeds(self) -> tuple[float | str, float | str]:
        """Speeds at the start and the end."""
        return self.start_speed, self.end_speed

    @property
    def given_speeds(self) -> tuple[float, float]:
        """Speeds at the start and the end; 0 if the planner chooses them."""
        start, end = (0.0 if speed == FREE else speed for speed in self.speeds)
        return float(start), float(end)
