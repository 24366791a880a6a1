"""The task: the input of the planner.

`Task` has the same keys as the task file. Create a task with `brachis.task.load_task`, which reads files and mappings
alike, and reports a mistake as a `brachis.errors.TaskError` that names the key.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    JsonValue,
    model_validator,
)

from brachis.task.fields import (
    POSITION,
    CheckedModel,
    Flag,
    Mistake,
    Name,
    Version,
    check_defined,
    must,
    refuse,
)
from brachis.task.limit_models import ToolLimits
from brachis.task.orientation import StartPlace, ToolPose
from brachis.task.paths import (
    FreePosture,
    JointValues,
    PathBegin,
    PathStart,
    Posture,
    RedundantJoints,
    StatedPath,
    split_path_in_frame,
)
from brachis.task.point_data import FitReport
from brachis.task.points.units import choices
from brachis.task.program import (
    NEXT,
    WAYS,
    ProgramPart,
    find_mistakes,
    part_names,
    scene_during,
    with_task_space,
)
from brachis.task.scene import CollisionSettings, SceneBody, SceneSource, name_bodies
from brachis.task.segments import CsvSegment
from brachis.task.settings import (
    BoundarySettings,
    FramePlacement,
    RefinementSettings,
    RobotSettings,
    SearchSettings,
    SolverSettings,
    SplineSettings,
    check_frames,
    expand_solver_name,
)
from brachis.task.tolerances import (
    Margins,
    OrientationTolerance,
    PositionTolerance,
    TaskSpace,
    Tolerances,
)

_WORDS = {"free", "start", NEXT}
"""Words that stand for postures that the planner chooses or knows."""
_CHOICES = {
    "redundant_joints": "auto",
    "branch": "auto",
    "search.guesses": "lattice",
    "margins.singularity": None,
    "path_reversed": False,
    "path_begin": 0.0,
}
"""Keys that choose postures along a path of the tool, or where it begins, and their defaults."""
_OF_PATHS = {
    "path": (),
    "path_start": None,
    "path_frame": None,
    "boundary.periodic": False,
    "tool_limits.process_speed": (),
    **_CHOICES,
}
"""Keys of tasks with a path, and their defaults."""


class Task(CheckedModel):
    """A task: a robot, a path for its tool, and settings of the planner.

    The constructor raises pydantic's own errors; `brachis.task.load_task` words them plainly.

    Examples
    --------
    >>> import brachis
    >>> task = brachis.load_task(brachis.examples.scara_line)
    >>> task.task_space, task.redundant_joints
    (('x', 'y'), ('j3',))
    """

    brachis: Version
    """Version of the task format."""
    robot: RobotSettings = Field(default_factory=RobotSettings)
    """The robot, for example {urdf: robot.urdf} or {urdf: scara3}."""
    start: FreePosture
    """Posture at the start of the path: {joints: ...}, a name defined in postures, or free. With free, path_start is
    required unless the path begins with a waypoint. A joint path that begins with a waypoint needs no start."""
    path_start: PathStart = None
    """Point at which the path begins: a list of all task coordinates (m, rad). For a pose, or with axis: {position: [x,
    y, z], rpy_deg: [...]} or another convention; only the rows of the task space are used. It must agree with the start
    posture. Null: the position of the tool in that posture, or the first waypoint."""
    end: FreePosture = "free"
    """Posture at the end, given like start. It must place the tool at the end of the path to within 1e-6 m or rad; the
    nearest posture on the path is used."""
    task_space: TaskSpace
    """Coordinates that the path prescribes: position (x, y and z), pose, pose_free_roll (the tool may roll about its z
    axis), axis, joints (all joint positions; only the timing is planned), free (nothing: a move from the start posture
    to the end posture), or a list of rows: some of x, y, z, then one of yaw, pitch, roll (angle about the world's z, y
    or x axis, rad) or axis (direction of the tool's z axis)."""
    path: StatedPath = ()
    """List of segments; or a list of points, each with all task coordinates, for the spline through them. In a frame:
    {frame: NAME, segments: [...]}. A move (task_space: free) has none."""
    program: tuple[ProgramPart, ...] = ()
    """Parts that follow one another, in place of a path: {path: ...}, {move: ...}, {approach: ...}, {retract: ...},
    {dwell: ...} or {payload: ...}. task_space is then that of the paths. end: start closes the motion."""
    order: Literal["given", "free"] = "given"
    """Order of the paths of a program. free: the planner chooses the order, and adds the moves between them."""
    frames: dict[Name, FramePlacement] = Field(default={})
    """Placements of frames, for example of workpieces, by name: {xyz: ..., rpy_deg: ..., frame: ...}."""
    postures: Annotated[
        dict[Name, JointValues],
        must(
            lambda named: not {*named} & _WORDS,
            "free, start and next cannot be names of postures",
            "different names",
        ),
    ] = Field(default={})
    """Named joint positions, rad (m), in chain order or by joint, for start, end and line: {to_posture: NAME}."""
    path_frame: Name | None = None
    """Frame in which path and path_start are given. Null: the world."""
    path_reversed: Flag = False
    """Whether the tool travels the path backwards, in the same poses. start is then at the end of the path."""
    path_begin: PathBegin = 0.0
    """Fraction of a closed path at which the tool begins. It stops where the ends of the path meet in a corner. Values
    of s are along the path as travelled."""
    boundary: BoundarySettings = Field(default_factory=BoundarySettings)
    """Speeds at both ends, or a periodic motion."""
    tool_limits: ToolLimits = Field(default_factory=ToolLimits)
    """Limits on the motion of the tool."""
    scene: Annotated[
        tuple[SceneBody, ...],
        BeforeValidator(
            lambda scene: (scene,) if isinstance(scene, SceneBody) else scene,
            json_schema_input_type=tuple[SceneBody, ...] | SceneSource,
        ),
        AfterValidator(name_bodies),
    ] = ()
    """Bodies around the robot or carried by it, or {file: cell.yaml} (see docs/my_cell.md)."""
    collisions: CollisionSettings = Field(default_factory=CollisionSettings)
    """Clearance, and the pairs of bodies to which it applies."""
    tolerances: Tolerances = Field(default_factory=Tolerances)
    """Tolerances within which the tool may leave the path."""
    margins: Margins = Field(default_factory=Margins)
    """Margins to keep from singular postures and from the ends of joint ranges."""
    custom_limits: dict[Name, dict[str, JsonValue]] = Field(default={})
    """Parameters of limits that installed packages add, by kind (see docs/own_limit.md)."""
    redundant_joints: RedundantJoints = "auto"
    """Joints whose motion is optimised. auto: planning uses charts, and closed forms until a motion is verified.
    pose_free_roll adds a joint, tool_roll, which the list may leave out."""
    branch: Name = "auto"
    """Label of the branch of the closed form. auto: the branch of the start posture, or all branches with start:
    free."""
    search: SearchSettings = Field(default_factory=SearchSettings)
    """Search for the fastest motion."""
    spline: SplineSettings = Field(default_factory=SplineSettings)
    """B-splines of the motion."""
    solver: Annotated[
        SolverSettings,
        BeforeValidator(
            expand_solver_name, json_schema_input_type=SolverSettings | str
        ),
    ] = Field(default_factory=SolverSettings)
    """Solver, by name or as a mapping."""
    refinement: RefinementSettings = Field(default_factory=RefinementSettings)
    """Refinement of the collocation points."""
    strict: Flag | None = None
    """true: implausible figures cause errors. false: they cause warnings. null: only a posture that seems to be in
    degrees causes an error."""

    @model_validator(mode="before")
    @classmethod
    def _expand(cls, content: object) -> object:
        """Give a joint path a free start by default, and split a path given in a frame."""
        if not isinstance(content, Mapping):
            return content
        if content.get("program"):
            content = with_task_space(content)
        elif content.get("program") in ([], ()) and not (
            content.get("path") or content.get("task_space") == "free"
        ):
            raise refuse("the program is empty", key="program", allowed="parts")
        elif content.get("task_space") == "joints":
            content = {"start": "free", **content}
        return split_path_in_frame(content)

    def joints_at(self, end: str) -> tuple[Any, str] | None:
        """Return the joint positions at ``start`` or ``end`` and their key, or None if the posture is free."""
        posture = getattr(self, end)
        if posture == "start":
            return self.joints_at("start")
        if isinstance(posture, Posture):
            return posture.joints, f"{end}.joints"
        if posture == "free":
            return None
        return self.postures[posture], f"postures.{posture}"

    def posture_key(self, end: str) -> str:
        """Return the key of the joint positions at ``start`` or ``end``; for a periodic motion that of the start."""
        stated = self.joints_at(end) or self.joints_at("start")
        return stated[1] if stated else f"{end}.joints"

    @property
    def _start_forms(self) -> str:
        """Form of ``path_start`` in this task space, for messages."""
        if self.of_poses:
            return "{position: [x, y, z], rpy_deg: [...]}, or another convention"
        if isinstance(self.task_space, tuple):
            return f"[{', '.join(self.task_space)}]"
        return "a list of all joints"

    def _mistakes(self) -> Iterator[Mistake]:
        self._check_names()
        if self.task_space == "free":
            why = "a move has no path"
            if self.program:
                why = "a program states its paths in its parts"
            yield from self._changed(_OF_PATHS, why)
            # The motion of a program may close in motion.
            closes = not self.program or self.program[-1].flies
            if any(self.boundary.given_speeds if closes else self.boundary.speeds):
                yield "boundary", why, "no speeds"
            yield from find_mistakes(self.program, self.order, self.start, self.end)
        elif self.path:
            if self.order == "free":
                yield "order", "only a program has an order", "given"
            yield from self._mistakes_at_the_start()
            yield from self._mistakes_in_the_path()
        else:
            yield "path", "this required key is missing", "a list of segments"
        yield from self._mistakes_in_tolerances()
        yield from self._mistakes_in_splines()

    def _check_names(self) -> None:
        """Refuse names of frames and postures that the task does not define."""
        frames = {"path_frame": self.path_frame}
        frames |= {f"scene[{i}].frame": body.frame for i, body in enumerate(self.scene)}
        frames |= {
            f"program[{i}].path_frame": getattr(part, "path_frame", None)
            for i, part in enumerate(self.program)
        }
        check_frames(self.frames, frames)
        postures = {
            f"path[{i}].line.to_posture": getattr(segment.shape, "to_posture", None)
            for i, segment in enumerate(self.path)
        }
        check_defined("posture", postures, self.postures)
        ends = {"start": self.start, "end": self.end}
        of_program = ["start"] if self.program else []
        check_defined("posture", ends, ["free", *of_program, *self.postures])
        moves = {
            f"program[{i}].move": getattr(part, "move", None)
            for i, part in enumerate(self.program)
        }
        check_defined("posture", moves, [NEXT, *self.postures])
        lives = {
            f"scene[{i}].{key}": getattr(body, key)
            for i, body in enumerate(self.scene)
            for key in ("since", "until")
        }
        names = part_names(self.program) if self.order == "given" else []
        for key, name in lives.items():
            if name is not None and name not in names:
                raise refuse(
                    "no part of the program has this name",
                    key=key,
                    found=name,
                    allowed=", ".join(names)
                    or "null: only a program in a given order has times",
                )
        moving = [i for i, part in enumerate(self.program) if part.kind in WAYS]
        for i, body in enumerate(self.scene):
            if names and not any(
                scene_during([body], self.program, number) for number in moving
            ):
                raise refuse(
                    "the arm does not move while the body is there",
                    key=f"scene[{i}].since",
                    found=body.since,
                    allowed="a body that is there during a path or a move",
                )

    def _mistakes_at_the_start(self) -> Iterator[Mistake]:
        first = self.path[0]
        is_unread = isinstance(first, CsvSegment) and not first.csv.relative
        is_free = self.start == "free"
        has_path_start = self.path_start is not None
        is_pose = isinstance(self.path_start, ToolPose)
        is_stated = has_path_start or is_unread or self.start_place is not None
        is_needed = is_free or (self.begins_elsewhere and self.task_space != "joints")
        if is_needed and not is_stated:
            if self.task_space == "joints":
                yield (
                    "path[0]",
                    "a joint path that does not begin with a waypoint needs a start posture",
                    "spline or csv; or a posture before the path: start or move with {joints: [...]}",
                )
            yield (
                "path_start",
                "this key is missing: nothing else states where the path begins",
                self._start_forms,
            )
        if is_free and self.search.guesses == "numeric":
            yield (
                "search.guesses",
                "numeric inverse kinematics needs a start posture, but start is free",
                "lattice",
            )
        if has_path_start and self.of_poses and not is_pose:
            yield (
                "path_start",
                "a list does not state the convention of the orientation, for example whether w comes first or last",
                f"{{position: [x, y, z], ...}} with one of {choices(suffix='_deg')}",
            )
        if is_pose and not self.of_poses:
            yield (
                "path_start",
                "a position with an orientation needs a task space of poses",
                self._start_forms,
            )

    def _mistakes_in_the_path(self) -> Iterator[Mistake]:
        last = self.path[-1]
        at = f"path[{len(self.path) - 1}]."
        if last.blend is not None:
            yield (
                f"{at}blend",
                "the last segment has no corner to blend",
                "no blend on the last segment",
            )
        if last.stop:
            yield (
                f"{at}dwell" if last.dwell else f"{at}stop",
                "the last segment cannot stop, because the path and the motion end there",
                "no stop and no dwell on the last segment; boundary.end_speed: 0 makes the motion end at rest",
            )
        if self.task_space != "joints":
            return
        if self.path_frame is not None:
            yield (
                "path_frame",
                "a joint path cannot be in a frame",
                "null, with task_space: joints",
            )
        yield from self._changed(_CHOICES, "a joint path leaves no choice")

    def _changed(self, defaults: Mapping[str, object], why: str) -> Iterator[Mistake]:
        """Refuse keys, given by their defaults, that this task space does not have."""
        for key, default in defaults.items():
            if attrgetter(key)(self) != default:
                beside = "program" if self.program else f"task_space: {self.task_space}"
                yield key, why, f"no such key beside {beside}"

    def _mistakes_in_tolerances(self) -> Iterator[Mistake]:
        tolerances = self.tolerances
        of_places = self.task_space in {"pose", "pose_free_roll", POSITION}
        if tolerances.orientation != OrientationTolerance() and not self.of_poses:
            yield (
                "tolerances.orientation",
                "the path does not prescribe the orientation",
                "no tolerances of the orientation, or task_space: pose or axis",
            )
        if tolerances.position != PositionTolerance() and not of_places:
            yield (
                "tolerances.position",
                "this task space has no tolerances of the position",
                "no tolerances of the position, or task_space: position, pose or pose_free_roll",
            )
        if tolerances.orientation.roll is not None and self.task_space != "pose":
            yield (
                "tolerances.orientation.roll",
                "the roll is free in this task space",
                "no tolerance of the roll, or task_space: pose",
            )

    def _mistakes_in_splines(self) -> Iterator[Mistake]:
        spline = self.spline
        if self.boundary.in_motion and spline.knots == "free":
            yield (
                "spline.knots",
                "free knots need a motion that starts and ends at rest",
                "uniform, or a motion that starts and ends at rest",
            )
        if self.boundary.periodic:
            if self.end != "free":
                yield (
                    "end",
                    "the end posture of a periodic motion is its start posture",
                    "free",
                )
            return
        # Each end fixes a value and the derivatives that vanish.
        least = 2 * spline.vanishing + 3 - spline.degree
        if spline.intervals != "auto" and spline.intervals < least:
            yield (
                "spline.intervals",
                f"rest: {spline.rest} leaves no freedom for splines of degree {spline.degree} with so few intervals",
                f">= {least}, or auto",
            )

    @property
    def collision_mode(self) -> str:
        """Treatment of collisions in this task: ``avoid``, ``check`` or ``off``."""
        if self.collisions.mode != "auto":
            return self.collisions.mode
        return "avoid" if self.scene else "off"

    def with_scene(self, bodies: Sequence[SceneBody]) -> Task:
        """Return the task with some of its bodies, which are always there, and its treatment of collisions."""
        always = {"since": None, "until": None}
        scene = tuple(body.model_copy(update=always) for body in bodies)
        absent = {body.name for body in self.scene} - {body.name for body in scene}
        disable = [pair for pair in self.collisions.disable if absent.isdisjoint(pair)]
        changes = {"mode": self.collision_mode, "disable": tuple(disable)}
        collisions = self.collisions.model_copy(update=changes)
        return self.model_copy(update={"scene": scene, "collisions": collisions})

    @property
    def of_poses(self) -> bool:
        """Whether the path prescribes the orientation of the tool or of its axis."""
        space = self.task_space
        return space in {"pose", "pose_free_roll"} or "axis" in space

    @property
    def begins_elsewhere(self) -> bool:
        """Whether the tool begins the path elsewhere than the path is written to begin."""
        return self.path_reversed or self.path_begin > 0.0

    @property
    def travel(self) -> str:
        """Say how the path is travelled, if not as it is written: where it begins, and whether it is reversed."""
        begin = f"from s = {self.path_begin:.3g}" if self.path_begin else ""
        turn = "reversed" if self.path_reversed else ""
        return ", ".join(filter(None, (begin, turn)))

    @property
    def start_place(self) -> StartPlace:
        """Start of the path as stated by the first segment, in the form of `path_start`; None if it states no start."""
        if not self.path:
            return None
        place, turn = self.path[0].start or (None, None)
        if place is None or not self.of_poses:
            return place
        position = place[: len(POSITION)]
        if turn is None or len(position) < len(POSITION):
            return None
        return ToolPose.model_validate({"position": position, **turn.model_dump()})

    @property
    def speed_unit(self) -> str:
        """Unit of a speed along the path; along a joint path the speed is the norm of the joint velocities."""
        return "rad/s (m/s)" if self.task_space == "joints" else "m/s"

    @property
    def fits(self) -> tuple[FitReport, ...]:
        """Reports on the fits to points, one for each file or array of points in the path."""
        paths = [self.path, *(getattr(part, "path", ()) for part in self.program)]
        segments = (segment for path in paths for segment in path)
        fits = (getattr(segment.shape, "fit", None) for segment in segments)
        return tuple(fit for fit in fits if fit is not None)

    def to_dict(self) -> dict[str, Any]:
        """Return the task as plain mappings, lists, numbers and strings.

        All defaults are written out, so that the result keeps its meaning if a default changes.
        ``load_task(task.to_dict()) == task``.
        """
        written = self.model_dump(mode="json")
        if not self.path:
            del written["path"]
        return written
