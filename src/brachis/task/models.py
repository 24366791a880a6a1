"""The task: what is asked of the planner.

`Task` mirrors the task file key by key. Use `brachis.task.load_task` to make one: it reads files and mappings alike,
and answers mistakes with a `brachis.errors.TaskError` that names the key.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field, JsonValue, Tag, field_validator, model_validator

from brachis.task.boundary import BoundarySettings
from brachis.task.bspline_curve import BSplineCurve
from brachis.task.fields import Count, Flag, Model, Name, Number, Positive, Share, by_form, refuse
from brachis.task.point_data import FitReport
from brachis.task.robot_models import JointValues, RobotSettings
from brachis.task.segments import CsvSegment, Segment, SegmentModel, SplineThrough
from brachis.task.tool_limits import ToolLimits

Row = Literal["x", "y", "z", "yaw"]
_Space = tuple[Row, ...] | Literal["position", "pose", "pose_free_roll", "joints"]
POSITION_ROWS: Final[tuple[Row, ...]] = ("x", "y", "z")
_SPACE_FORMS = "a list of rows out of x, y, z, yaw, or one of position, pose, pose_free_roll, joints"
_VANISHING: Final = {"velocity": 1, "full": 2, "jerk": 3}
_POSE_NUMBERS = 7


def _expand_position(space: _Space) -> _Space:
    """Spell ``position`` out, so that equal task spaces compare equal."""
    return POSITION_ROWS if space == "position" else space


def _check_rows(rows: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(rows)) < len(rows):
        problem = "a row occurs twice in the task space"
        raise refuse(problem, found=list(rows), allowed="each row once")
    if "yaw" in rows and (len(rows) != len(POSITION_ROWS) or rows[-1] != "yaw"):
        problem = "yaw needs exactly two position rows, and comes last"
        raise refuse(problem, found=list(rows), allowed="for example [x, y, yaw]")
    return rows


TaskSpace = Annotated[
    Annotated[Literal["position", "pose", "pose_free_roll", "joints"], Tag("<word>")]
    | Annotated[Annotated[tuple[Row, ...], Field(min_length=1), AfterValidator(_check_rows)], Tag("<list>")],
    by_form(_SPACE_FORMS, "position", "pose", "pose_free_roll", "joints"),
    AfterValidator(_expand_position),
]


class Posture(Model):
    """A configuration of the robot."""

    joints: JointValues = Field(description="Joint positions, rad (m): in the order of the chain, or by joint name.")


FreePosture = Annotated[
    Annotated[Literal["free"], Tag("<word>")] | Annotated[Posture, Tag("<mapping>")],
    by_form("free, or a mapping {joints: [...]}", "free"),
]


def _each_once(joints: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(joints)) < len(joints):
        raise refuse("a joint occurs twice", found=list(joints), allowed="each joint once")
    return joints


RedundantJoints = Annotated[
    Annotated[Literal["auto"], Tag("<word>")]
    | Annotated[Annotated[tuple[Name, ...], AfterValidator(_each_once)], Tag("<list>")],
    by_form("auto, or a list of joint names", "auto"),
]
Intervals = Annotated[
    Annotated[Literal["auto"], Tag("<word>")] | Annotated[Annotated[Count, Field(ge=4, le=10_000)], Tag("<number>")],
    by_form("auto, or a whole number", "auto"),
]


class SplineSettings(Model):
    """The B-splines of the path coordinate and the redundant joints."""

    degree: Count = Field(
        default=3, ge=2, le=7, description="Degree; 3 gives continuous torque, 4 continuous torque rate."
    )
    intervals: Intervals = Field(
        default=20,
        description="Number of knot intervals; auto doubles them where it pays until another doubling gains less than "
        "the tolerance. Free knots need a number.",
    )
    tolerance: Positive = Field(
        default=1.0e-3, le=0.1, description="With intervals: auto, the gain, as a fraction of t_E, that ends it."
    )
    knots: Literal["uniform", "free"] = Field(
        default="uniform", description="Equal intervals, or their lengths as variables of the optimisation."
    )
    shortest_interval: Positive = Field(
        default=0.1,
        lt=1.0,
        description="With knots: free, the least length of an interval, in mean intervals; never less than 5e-5 t_E.",
    )
    rest: Literal["velocity", "full", "jerk"] = Field(
        default="full",
        description="What vanishes at both ends: velocity alone; velocity and acceleration (full); or velocity, "
        "acceleration and jerk, and with them the rates of the torques (jerk; degree 4 at least).",
    )
    points_per_interval: Count = Field(default=3, ge=1, le=100, description="Collocation points per knot interval.")

    @property
    def vanishing(self) -> int:
        """How many derivatives of the joint positions vanish at both ends."""
        return _VANISHING[self.rest]

    @model_validator(mode="after")
    def _rest_needs_degree(self) -> SplineSettings:
        order = self.vanishing
        if order > 1 and self.degree <= order:
            last = {2: "acceleration", 3: "jerk"}[order]
            problem = (
                f"rest: {self.rest} asks for a continuous {last} that is zero at the ends: "
                f"degree {self.degree} cannot give it"
            )
            lower = " or ".join(
                f"rest: {word}" for word, level in _VANISHING.items() if level < min(order, self.degree)
            )
            raise refuse(problem, key=".degree", found=self.degree, allowed=f">= {order + 1}, or {lower}")
        return self

    @model_validator(mode="after")
    def _free_knots_are_counted(self) -> SplineSettings:
        if self.knots == "free" and self.intervals == "auto":
            problem = "free knots move; how many there are must be given"
            raise refuse(problem, key=".intervals", found="auto", allowed="a whole number, or knots: uniform")
        return self


class SearchSettings(Model):
    """The search over redundant joints, branches and initial guesses."""

    effort: Literal["single", "fast", "thorough", "exhaustive"] = Field(
        default="fast",
        description="How far the search goes: single plans once, from the most promising guess, and goes on only if "
        "that fails.",
    )
    guesses: Literal["lattice", "numeric"] = Field(
        default="lattice",
        description="Where initial guesses come from: a lattice of postures, or numeric inverse kinematics "
        "from the start posture.",
    )
    jobs: Count = Field(
        default=1, ge=1, description="Processes that plan at the same time; no more than there are processors are used."
    )
    time_limit: Positive = Field(
        default=60.0,
        le=1e6,
        description="Time after which the best motion so far is returned, s; one that is not verified where none is.",
    )
    seed: Count = Field(default=0, ge=0, description="Seed of what is drawn at random.")
    least_motion: Flag = Field(
        default=True,
        description="Whether, of motions that are as fast as the fastest one to 1e-4, the calmest one is taken: that "
        "with the least joint accelerations.",
    )
    slower: Share = Field(
        default=0.0, description="How much slower the calmest motion may be, for example 1 %, or 0.01."
    )

    @model_validator(mode="after")
    def _slower_is_for_least_motion(self) -> SearchSettings:
        if self.slower and not self.least_motion:
            problem = "a slower motion is of use for least motion alone"
            raise refuse(problem, key=".slower", found=self.slower, allowed="0, or least_motion: true")
        return self


class SolverSettings(Model):
    """The solver of the optimisation problem and its bounds."""

    name: Name = Field(default="auto", description="Solver; auto takes the best one installed.")
    max_iterations: Count = Field(default=300, ge=1, le=1_000_000, description="Largest number of iterations.")
    time_limit: Positive = Field(
        default=20.0, le=1e6, description="Largest time of one solve, s; search.time_limit bounds the whole plan."
    )
    tolerance: Positive = Field(default=1.0e-6, description="Tolerance of the optimality conditions.")


class RefinementSettings(Model):
    """Adding collocation points until the limits hold in between them as well."""

    tolerance: Positive = Field(
        default=1.0e-4,
        ge=1.0e-5,
        le=0.01,
        description="Largest relative violation of a limit, anywhere; of a position, beyond its range, in rad (m), or "
        "in half ranges where these are shorter. What is less than 1e-5 the checks do not show.",
    )
    density: Count = Field(
        default=10, ge=10, le=1000, description="Grid points for checking limits, per collocation point."
    )
    max_rounds: Count = Field(
        default=10, ge=0, le=1000, description="Largest number of rounds; 0 switches refinement off."
    )


class Task(Model):
    """A task: a robot, a path for its tool, and how to plan.

    Constructed directly it raises pydantic's own errors; `brachis.task.load_task` puts them in plain words.

    Examples
    --------
    >>> import brachis
    >>> task = brachis.load_task(brachis.examples.scara_line)
    >>> task.task_space, task.redundant_joints
    (('x', 'y'), ('j3',))
    """

    brachis: Literal[1] = Field(description="Version of the task format.")
    robot: RobotSettings = Field(default_factory=RobotSettings, description="The robot.")
    start: FreePosture = Field(
        description="Configuration at the start of the path: {joints: ...}, or free, which needs path_start."
    )
    path_start: tuple[Number, ...] | None = Field(
        default=None,
        description="Where the path begins: all rows of the task space (m, yaw in rad); of a pose the position and a "
        "quaternion w, x, y, z. Null: where the start posture's tool is; otherwise a start posture whose tool is "
        "elsewhere is refused. With start: free it must be given, unless a file's first row says it.",
    )
    end: FreePosture = Field(
        default="free",
        description="Configuration at the end of the path: free, or {joints: ...}. Where its tool is up to 1e-6 m or "
        "rad off the path's end, the nearest posture on the path is taken; where it is farther off, it is refused.",
    )
    task_space: TaskSpace = Field(
        description="What the path prescribes: rows out of x, y, z, yaw (yaw last, with two others); position (all "
        "of x, y, z); pose; pose_free_roll, a pose that may roll about the tool frame's z axis; or joints: the path is "
        "one of all joints, in the order of the chain (rad, m), and only its timing is planned."
    )
    path: Annotated[tuple[Segment, ...], Field(min_length=1)] = Field(description="Segments of the path, in order.")
    boundary: BoundarySettings = Field(
        default_factory=BoundarySettings, description="Speeds at both ends, or a motion that goes round for ever."
    )
    tool_limits: ToolLimits = Field(default_factory=ToolLimits, description="Limits on the motion of the tool.")
    custom_limits: dict[Name, dict[str, JsonValue]] = Field(
        default={},
        description="Limits of kinds that installed packages add (see docs/own_limit.md): their parameters, by kind.",
    )
    redundant_joints: RedundantJoints = Field(
        default="auto",
        description="Joints that are free along the path; auto tries every choice that has a closed form. With "
        "pose_free_roll the virtual joint tool_roll, which rolls the tool, is one of the robot's; it may be left out.",
    )
    branch: Name = Field(
        default="auto",
        description="Label of the branch of the closed form; auto: the start's, and all of them with start: free.",
    )
    search: SearchSettings = Field(default_factory=SearchSettings, description="Search.")
    spline: SplineSettings = Field(default_factory=SplineSettings, description="B-splines.")
    solver: SolverSettings = Field(default_factory=SolverSettings, description="Solver.")
    refinement: RefinementSettings = Field(default_factory=RefinementSettings, description="Refinement.")

    @field_validator("brachis", mode="before")
    @classmethod
    def _version_is_a_number(cls, version: object) -> object:
        # Python holds true == 1, so that the literal alone would accept `brachis: true`.
        if type(version) is not int:
            problem = "the version of the task format must be a whole number"
            raise refuse(problem, found=version, allowed="1")
        return version

    @field_validator("path", mode="before")
    @classmethod
    def _one_segment_is_a_path(cls, path: object) -> object:
        return (path,) if isinstance(path, SegmentModel) else path

    @field_validator("path")
    @classmethod
    def _no_blend_at_the_end(cls, path: tuple[Segment, ...]) -> tuple[Segment, ...]:
        if path[-1].blend is not None:
            problem = "the last segment has no corner to blend"
            raise refuse(
                problem, key=f"[{len(path) - 1}].blend", found=path[-1].blend, allowed="no blend on the last segment"
            )
        return path

    @model_validator(mode="after")
    def _free_start_needs_a_place(self) -> Task:
        first = self.path[0]
        unread = isinstance(first, CsvSegment) and not first.csv.relative
        if self.start == "free" and self.path_start is None and not unread and self.begins is None:
            problem = "a free start posture leaves open where the path begins"
            pose = isinstance(self.task_space, str)
            rows = (*POSITION_ROWS, "qw", "qx", "qy", "qz") if pose else self.task_space
            allowed = "the joints" if self.task_space == "joints" else f"[{', '.join(rows)}]"
            raise refuse(problem, key="path_start", absent=True, allowed=allowed)
        if self.start == "free" and self.search.guesses == "numeric":
            problem = "numeric inverse kinematics needs a posture to begin with, and start is free"
            raise refuse(problem, key="search.guesses", found="numeric", allowed="lattice")
        return self

    @model_validator(mode="after")
    def _ends_in_motion(self) -> Task:
        if self.boundary.in_motion and self.spline.knots == "free":
            problem = "ends in motion tie control points by the knots, which may not move then"
            raise refuse(problem, key="spline.knots", found="free", allowed="uniform, or a boundary at rest")
        if self.boundary.periodic and self.end != "free":
            problem = "the end posture of a periodic motion is its start posture"
            raise refuse(problem, key="end", found=self.end.model_dump(), allowed="free")
        return self

    @model_validator(mode="after")
    def _a_path_of_joints_leaves_no_choice(self) -> Task:
        if self.task_space == "joints":
            for key, given, default in (
                ("redundant_joints", self.redundant_joints, "auto"),
                ("branch", self.branch, "auto"),
                ("search.guesses", self.search.guesses, "lattice"),
            ):
                if given != default:
                    problem = "a path of joints leaves no choice of postures"
                    raise refuse(problem, key=key, found=given, allowed=f"{default}, with task_space: joints")
        return self

    @property
    def begins(self) -> tuple[float, ...] | None:
        """Where the first segment says that the path begins, as `path_start`; None where it leaves that open."""
        place, poses = self.path[0].begins, isinstance(self.task_space, str) and self.task_space != "joints"
        return None if place is None or (poses and len(place) != _POSE_NUMBERS) else place

    @property
    def fits(self) -> tuple[FitReport, ...]:
        """Where the path comes from points, one for each file or array: what they were, and how near it is to them."""
        shapes = (getattr(segment, segment.kind) for segment in self.path)
        curves = (shape.fit for shape in shapes if isinstance(shape, SplineThrough | BSplineCurve))
        return tuple(fit for fit in curves if fit is not None)

    def to_dict(self) -> dict[str, Any]:
        """Return the task as plain mappings, lists, numbers and strings.

        All defaults are spelled out, so that the result keeps its meaning should a default change.
        ``load_task(task.to_dict()) == task``.
        """
        return self.model_dump(mode="json")
