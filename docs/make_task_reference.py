"""Make docs/task_files.md from the task models with ``python docs/make_task_reference.py``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel, TypeAdapter
from pydantic.dataclasses import dataclass
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from brachis.task import (
    BoundarySettings,
    FrictionSettings,
    InertiaMatrix,
    LimitScale,
    LimitsFile,
    LimitSpec,
    Payload,
    Placement,
    ProcessSpeed,
    RefinementSettings,
    RobotSettings,
    SearchSettings,
    SolverSettings,
    SpeedTable,
    SplineSettings,
    Task,
    ToolLimits,
)
from brachis.task.orientation import Attitude, Rotation, Tangent, Target
from brachis.task.point_data import FileUnits, FitTolerance, PointFile
from brachis.task.segments import (
    ArcCenter,
    ArcVia,
    BSplineCurve,
    CircleTurns,
    HelixTurns,
    LineBy,
    LineHeading,
    LineTo,
    MovingSegment,
    SplineThrough,
)

PAGE = Path(__file__).parent / "task_files.md"

LIMITS = dataclass(LimitSpec)
for _name, _key in TypeAdapter(LimitSpec).json_schema()["properties"].items():
    LIMITS.__pydantic_fields__[_name].description = _key["description"]

PARTS: dict[str, type] = {
    "robot": RobotSettings,
    "robot.limits": LIMITS,
    "robot.limits.scale": LimitScale,
    "robot.friction": FrictionSettings,
    "robot.payload": Payload,
    "robot.payload.inertia": InertiaMatrix,
    "robot.tool_offset, robot.mounting": Placement,
    "boundary": BoundarySettings,
    "tool_limits": ToolLimits,
    "tool_limits.speed": SpeedTable,
    "tool_limits.process_speed": ProcessSpeed,
    "spline": SplineSettings,
    "search": SearchSettings,
    "solver": SolverSettings,
    "refinement": RefinementSettings,
}
SEGMENTS: dict[str, tuple[type[BaseModel], ...]] = {
    "line": (LineTo, LineBy, LineHeading),
    "arc": (ArcCenter, ArcVia),
    "circle": (CircleTurns,),
    "helix": (HelixTurns,),
    "spline": (SplineThrough,),
    "bspline": (BSplineCurve,),
    "csv": (PointFile,),
}
FILES: dict[str, type[BaseModel]] = {"units": FileUnits, "tolerance": FitTolerance}
TABLE_HEAD = ("| key | default | meaning |", "|---|---|---|")
INTRODUCTION = """# Task files

<!-- Made by docs/make_task_reference.py. -->

A task file is YAML. Paths in it are relative to the file; SI units; unknown keys are refused. `brachis schema` prints a
JSON schema that editors use for completion: put `# yaml-language-server: $schema=task.schema.json` at the top of a task
file, with the schema saved beside it by `brachis schema --out task.schema.json`.

Limits: an absent key takes the URDF's limit, `null` removes it, a number holds for all joints, a list is in the order
of the chain, a mapping names joints (others keep the URDF's). Torque and velocity limits may differ in both directions:
in a list or mapping a pair `[lower, upper]`, lower < 0 < upper, stands for a number. Such numbers lie between 1e-6 and
1e12 in SI units, scaled ones too; ends of position ranges within 1e6 rad or m of zero, or open (`null`). Limits on
`jerk` and `torque_rate` need splines of degree 3 at least and `rest: full`, so that they hold over the ends too; with
`rest: jerk` (degree 4 at least) both begin and end at zero. Coulomb friction counts in the torque's rate by its slope:
give it a `coulomb_velocity` over which it may change.

Friction is written likewise: absent, `viscous` and `coulomb` are `damping` and `friction` of the URDF's `<dynamics>`;
`null` switches them off. Payload, tool offset and mounting change the robot without the URDF: the payload's `com` and
`inertia` and the tool offset are in the tool frame of the URDF, mounting and gravity in the world frame. What is in use
is printed with a plan, stands under `in_use` in its JSON, and is saved with the motion; `brachis inspect task.yaml`
shows it without planning.

`brachis.plan(robot, task)` with a `Robot` adds what the task's `robot` part sets to what the robot was made with; the
robot stands for the `urdf` key, and what contradicts it is refused with its key.

A `torque_speed` curve is that of the joint, not of its motor, and the same for driving and braking (a drive that brakes
with more is planned too cautiously). A data sheet that states 3000 rpm at 1.27 N m, 4500 rpm without load, and a gear
of 1:50 with an efficiency of 0.8 is, with speed = rpm * 2 pi / 60 / ratio and torque = torque * ratio * efficiency,

```yaml
robot:
  limits:
    torque_speed:
      j1: [[0, 50.8], [6.28, 50.8], [9.42, 0]]   # rad/s, N m: 3000 and 4500 rpm behind 1:50
```

Implausible figures (degrees for rad, mm for m, g for kg, mNm for N m, rpm for rad/s, factors above 10, an end time at
the planner's least) are warned of on standard error and listed as `warnings` in the JSON and as `result.warnings`. A
start posture that looks like degrees is an error. `strict: true` (`--strict`, `brachis.plan(..., strict=True)`) makes
all of them errors, `strict: false` (`--no-strict`) all of them warnings.
"""

LIMITS_FILE = """
## Limits files

`robot.limits_file` names a YAML file of joint limits, such as `robots/panda_limits.yaml`, which has the published
figures of the Franka Emika Panda. Limits count in this order: what the task says in `robot.limits`, the file, the URDF;
where the task names joints, joint by joint. Limits of joints that the URDF has and that stand still (locked, or off the
chain to the tool) have no effect. The file is read with the task: a saved task does not need it any more. In Python:
`brachis.read_limits(path)` gives a `LimitSpec`.

**`joint_limits.yaml`** of MoveIt, of ros2_control and of Universal Robots is read as it is, with `!degrees` and
`!radians`:

```yaml
joint_limits:
  shoulder_pan_joint:
    has_position_limits: true
    min_position: !degrees -180
    max_position: !degrees 180
    has_velocity_limits: true
    max_velocity: !degrees 120     # per second
    has_acceleration_limits: true
    max_acceleration: 5.0          # rad/s^2
    has_jerk_limits: false
    has_effort_limits: true
    max_effort: 330.0              # N m
```

`has_..._limits: false` switches a limit off, the URDF's too; what is not stated is the URDF's. Every joint that moves
the tool needs an entry, there or in the task's `robot.limits`. `default_velocity_scaling_factor` and
`default_acceleration_scaling_factor`, 0.1 in files of MoveIt's Setup Assistant, count as `limits.scale`: with
`robot.limits.scale: {velocity: 1, acceleration: 1}` the task uses the limits in full. The joints of Universal Robots
may lack the `_joint` at the end of their names. A limits file of our own has these keys:
"""
PATH = """
## `path`

A list of segments. Each is a mapping with one of the kinds below (`line`, `arc`, `circle`, `spline`, `bspline`, `csv`,
`turn`) and, beside it, the keys of this table. A segment starts where its predecessor ends, the first one where the
tool is at the start posture. The path must be smooth to the third derivative: segments that do not continue each other
need a `blend`.

Coordinates are those of the rows of the task space, m, and rad for yaw. In task spaces of poses (`pose`,
`pose_free_roll`) they are x, y, z, and `orientation` says how the tool turns.

They are in the world frame, or in a frame of `frames`, such as that of a workpiece: `path: {frame: workpiece, segments:
[...]}`, or the key `path_frame` beside `path`. Segments, splines, files of points, directions, orientations and
`path_start` are all in it. A workpiece that stands elsewhere is then one
changed key; a sweep over `frames.workpiece.xyz` finds its best place. In task spaces of fewer rows than x, y, z the
frame may only turn within these rows. Results, plots and exports are in the world frame.

```yaml
frames:
  workpiece: {xyz: [0.6, 0.1, 0.4], rpy_deg: [0, 0, 30]}
path_frame: workpiece
start: free
task_space: pose
path_start: {position: [0, 0, 0.02], rpy_deg: [180, 0, 0]}   # 20 mm above the workpiece, the tool pointing down
path:
  - line: {by: [0.2, 0, 0]}                                  # along the workpiece
    orientation: {rotate: {axis: [0, 0, 1], angle_deg: 20}}
```

With `task_space: joints` they are the positions of all joints, rad (m), in the order of the chain, and the segments
are `line: {to: ...}`, `line: {by: ...}`, `spline`, `bspline` and `csv`; lengths along the path, those of blends too,
are in rad (m). `docs/from_toppra.md` has an example.
"""
TURN = """
### `turn: {...}`

In task spaces of poses: the tool turns on the spot, by `rotate: {...}` or `to: {...}` as described below. A turn joins
other turns about the same axis, or, with `profile: smooth`, about any axis; it does not join a segment whose position
moves.
"""
ORIENTATION = """## `orientation`

In task spaces of poses every segment but `turn` may say how the tool turns along it. The tool's orientation at the
start of a segment is the one at the end of its predecessor. Orientations are those of the tool frame in the frame of
the path: the world, or `path_frame`.

```yaml
task_space: pose
path:
  - line: {by: [0.3, 0, 0]}               # the tool keeps its orientation
    blend: 0.05
  - line: {by: [0, 0.4, 0]}               # turns by 90 degrees about the path frame's z axis, at rest at both ends
    orientation: {rotate: {axis: [0, 0, 1], angle_deg: 90, profile: smooth}}
  - line: {by: [0, 0.3, 0]}               # turns, the shortest way, to an orientation
    orientation: {to: {rpy_deg: [0, 0, 45], profile: smooth}}
```

| form | meaning |
|---|---|
| `fixed` | The tool keeps its orientation. This is the default. |
| `{rotate: {axis: ..., angle_deg: ...}}` | It turns about an axis that stands still. |
| `{to: {...}}` | It turns to an orientation, about one axis and the shortest way; less than 180 degrees. |
| `tangent` or `{tangent: {up: ...}}` | It turns with the tangent of the path, see below. |

Position and orientation advance together: with `profile: uniform` the tool turns by the same angle for every metre of
the path. Then its turning rate jumps where the next segment turns otherwise, which is refused like a corner. Either
give `profile: smooth`, with which the rate and its first two derivatives start and end at zero, or a `blend`, which
rounds position and orientation alike.

With `tangent` the tool stays at rest in a frame that moves along the path: x along the tangent, y along up x tangent.
So it turns about `up` as the path turns, and pitches as the path rises, while up stays up; how it is oriented at the
start of the segment is kept. Where the tangent is parallel to `up` (within 1 degree) the frame is not defined; then
give another `up`.

A spline passes its waypoints in given orientations with `orientations`, one for each waypoint. Between them the
orientation is smooth, to the third derivative, and does not depend on the choice of the world frame or the tool frame.
The orientation at the segment's start is not listed. Successive orientations must be less than 180 degrees apart.

```yaml
task_space: pose
path:
  - spline:
      relative: true                      # displacements in the path's frame, rotations in the tool frame
      through: [[0.1, 0, 0], [0.2, 0.1, 0], [0.2, 0.2, 0.1]]
      orientations: [{rpy_deg: [0, 0, 20]}, {rpy_deg: [0, 10, 60]}, {quaternion_xyzw: [0, 0, 0.707, 0.707]}]
```

An orientation is written in exactly one of these conventions. None is guessed: quaternions state the order of their
numbers, and so do the angles of robots' makers, which differ. The keys hold wherever an orientation stands, in
`path_start` too; in files of points the same words, without `_deg`, are values of `csv.orientation`.

| key | meaning |
|---|---|
"""
CSV = """
## Files of points

`csv: {file: poses.csv}` is a smooth curve along the rows of a file. Its first line names the columns, in any order;
lines that are empty or begin with `#` are skipped. In task spaces of rows the columns are the rows (`x,y`, `x,z,yaw`,
...), and for paths of joints the joints' names (rad, m; without `units` and `tolerance`). In task spaces of poses they
are

- `x,y,z`: positions; the segment's `orientation` says how the tool turns;
- `x,y,z,qw,qx,qy,qz`: positions and unit quaternions;
- `x,y,z,roll,pitch,yaw`, or `x,y,z,w,p,r` (Fanuc): positions and angles;
- `x,y,z,rx,ry,rz`, `x,y,z,a,b,c` or `x,y,z,q1,q2,q3,q4`: positions and orientations whose meaning differs from maker to
  maker, so that `orientation` must state it: `rotation_vector`, `rpy`, `staubli_xyz` or `fanuc_wpr` for `rx,ry,rz`;
  `kuka_abc` or `rpy` (Mitsubishi) for `a,b,c`; `quaternion_wxyz` (ABB) or `quaternion_xyzw` for `q1` to `q4`.

A column `feed` (or `f`, `speed`, `v`) may stand beside them: the speed of the tool on the way to each row. Columns are
separated by commas, semicolons, tabs or spaces; with all but commas, decimal commas are understood. Units follow names
(`x_mm`, `X [mm]`, `rx (deg)`, `feed_mm/min`) or are stated by `units`; lengths without a unit are in metres, yaw and
rotation vectors in radians; the unit of other angles and of speeds must be stated. What was found out about the file is
told.

The first row is where the segment starts, and where the path begins with `start: free` if the task has no `path_start`.
A segment that starts elsewhere, by more than 1e-4 m or rad, is refused; with `relative: true` the rows are moved so
that the first one is at the segment's start: displacements keep their direction in the path's frame, rotations are
those in the tool frame.

**Without a tolerance** the path passes all rows. Where successive rows have the same position, the curve would have to
stop, and the file is refused, unless the position stands still in the whole file. Rows that are rounded or scatter so
much that the curvature of a curve through them is noise are refused with the reason: give a tolerance.

**With a tolerance** the path is a quintic B-spline, C4, within the tolerance of all rows (up to 100,000 and more), with
few knots, through the first and the last one. Repeated rows are left out and told; spikes and changes of unit are
refused with their line. Ways five times longer than usual are taken as straight, as CAM means them. Corners are found
and listed, and rounded by blends within `tolerance.corner`; the tighter, the slower a robot passes them. The distance
of every row from the curve is measured by a formula that the fit does not use. `brachis inspect TASK` prints what was
found, `brachis plan` too; `result.fits` and the JSON have it, `brachis plot --kind fit` draws the errors.

```yaml
start: free
task_space: pose
path:
  - csv:
      file: seam.csv                      # columns x, y, z, a, b, c
      orientation: kuka_abc
      units: {length: mm, angle: deg}
      tolerance: {position: 0.05 mm, orientation: 0.1 deg, corner: 0.5 mm}
      corner: blend
```

G-code (`.nc`, `.ngc`, `.gcode`, `.tap`) is read likewise: G0 to G3 with I, J, K or R, G17 to G21, G90, G91, F.
Millimetres are taken where it does not say. What has no say in where the tool goes is skipped and told; cycles, cutter
compensation and rotary axes are refused.

Feed rates are largest speeds of the tool, from the first to the last row that has one and linear between them; they
stand beside those of `tool_limits`.

The file is read with the task, and becomes a `spline` or one `bspline` for every stretch between corners: a saved task
does not need it any more. Arrays take the same way: `brachis.fit_path(points, tolerance=...)` returns the segments of a
path along positions, 4x4 matrices, SE3 or positions with SciPy's rotations, the first one included.
"""


def rows(model: type) -> Iterator[str]:
    """Yield one line a key: name, default, description."""
    yield from TABLE_HEAD
    for name, field in model.__pydantic_fields__.items():
        yield _row(name, field)


def _row(name: str, field: FieldInfo) -> str:
    description = " ".join((field.description or "").split())
    return f"| `{name}` | {_default(field)} | {description.replace('|', ' or ')} |"


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined or isinstance(value, BaseModel | LimitSpec):
        return "see below"
    if value is None or isinstance(value, bool):
        return {None: "`null`", False: "`false`", True: "`true`"}[value]
    return f"`{list(value) if isinstance(value, tuple) else value}`"


def page() -> str:
    """Return the whole page."""
    parts = [INTRODUCTION, "## The file\n", *rows(Task)]
    for key, model in PARTS.items():
        parts += [f"\n## `{key}`\n", *rows(model)]
    parts += [LIMITS_FILE, *rows(LimitsFile), PATH, *rows(MovingSegment)]
    for kind, shapes in SEGMENTS.items():
        for shape in shapes:
            keys = ", ".join(
                f"{name}: ..."
                for name, field in shape.model_fields.items()
                if field.is_required()
            )
            parts += [f"\n### `{kind}: {{{keys}}}`\n", *rows(shape)]
    parts += [TURN, ORIENTATION.rstrip()]
    parts += [
        f"| `{name}` | {field.description} |"
        for name, field in Attitude.model_fields.items()
    ]
    parts += ["\n### `rotate: {axis: ..., angle_deg: ...}`\n", *rows(Rotation)]
    profile = Target.model_fields["profile"]
    parts += ["\n### `to: {...}`\n", "An orientation as above, and\n", *TABLE_HEAD]
    parts += [
        _row("profile", profile),
        "\n### `tangent: {...}`\n",
        *rows(Tangent),
        CSV.rstrip(),
    ]
    for key, model in FILES.items():
        parts += [f"\n### `csv.{key}`\n", *rows(model)]
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
