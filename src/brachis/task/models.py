"""The task: what is asked of the planner.

`Task` mirrors the task file key by key. Use `brachis.task.load_task` to make one: it reads files and mappings alike,
and answers mistakes with a `brachis.errors.TaskError` that names the key.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field, JsonValue, Tag, field_validator, model_validator

from brachis.task.boundary import BoundarySettings
from brachis.task.bspline_curve import BSplineCurve
from brachis.task.fields import Model, Name, Number, by_form, plain, refuse
from brachis.task.planning_models import RefinementSettings, SearchSettings, SolverSettings, SplineSettings
from brachis.task.point_data import FitReport
from brachis.task.robot_models import RobotSettings
from brachis.task.segments import CsvSegment, Segment, SegmentModel
from brachis.task.shapes import SplineThrough
from brachis.task.tool_limits import ToolLimits

Row = Literal["x", "y", "z", "yaw"]
_Space = tuple[Row, ...] | Literal["position", "pose", "pose_free_roll", "joints"]
POSITION_ROWS: Final[tuple[Row, ...]] = ("x", "y", "z")
_SPACE_FORMS = "a list of rows out of x, y, z, yaw, or one of position, pose, pose_free_roll, joints"
_POSE_NUMBERS = 7
_MOST_SEGMENTS = 3000
"""Segments of a path: with their blends about as many pieces as a motion can be verified on."""


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


JointValues = Annotated[
    Annotated[Annotated[tuple[Number, ...], Field(min_length=1)], Tag("<list>")]
    | Annotated[Annotated[dict[Name, Number], Field(min_length=1)], Tag("<mapping>")],
    by_form("a list of numbers in the order of the chain, or a mapping of joint name to number"),
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
    path: Annotated[tuple[Segment, ...], Field(min_length=1, max_length=_MOST_SEGMENTS)] = Field(
        description="Segments of the path, in order."
    )
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
        rows = plain(path)
        if isinstance(rows, list) and rows and all(isinstance(row, list) for row in rows):
            found, allowed = (
                f"{len(rows)} lists",
                "segments; points go through csv, spline, or brachis.fit_path(points)",
            )
            raise refuse("points are no segments", found=found, allowed=allowed)
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
