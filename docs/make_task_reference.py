"""Make docs/task_files.md from the task models with ``python docs/make_task_reference.py``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel
from pydantic.dataclasses import dataclass
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from brachis.task import (
    FrictionSettings,
    LimitSpec,
    Payload,
    Placement,
    ProcessSpeed,
    RefinementSettings,
    RobotSettings,
    SolverSettings,
    SpeedTable,
    SplineSettings,
    Task,
    ToolLimits,
)
from brachis.task.fields import describe_fields
from brachis.task.limit_kinds import LimitScale
from brachis.task.limits_file import LimitsFile
from brachis.task.orientation import Attitude, Rotation, Tangent, Target
from brachis.task.point_data import FileUnits, FitTolerance, PointFile
from brachis.task.scene import CollisionSettings, HalfSpaceShape, Round, SceneBody
from brachis.task.segments import (
    ArcCenter,
    ArcVia,
    BSplineCurve,
    CircleTurns,
    HelixTurns,
    LineBy,
    LineHeading,
    LineTo,
    LineToPosture,
    MovingSegment,
    SplineThrough,
)
from brachis.task.settings import (
    BoundarySettings,
    FramePlacement,
    InertiaMatrix,
    SearchSettings,
)

PAGE = Path(__file__).parent / "task_files.md"

LIMITS = dataclass(LimitSpec)

PARTS: dict[str, type] = {
    "robot": RobotSettings,
    "robot.limits": LIMITS,
    "robot.limits.scale": LimitScale,
    "robot.friction": FrictionSettings,
    "robot.payload": Payload,
    "robot.payload.inertia": InertiaMatrix,
    "robot.tool_offset, robot.mounting": Placement,
    "frames.NAME": FramePlacement,
    "boundary": BoundarySettings,
    "tool_limits": ToolLimits,
    "tool_limits.speed": SpeedTable,
    "tool_limits.process_speed": ProcessSpeed,
    "scene[i]": SceneBody,
    "scene[i].cylinder, scene[i].capsule": Round,
    "scene[i].half_space": HalfSpaceShape,
    "collisions": CollisionSettings,
    "spline": SplineSettings,
    "search": SearchSettings,
    "solver": SolverSettings,
    "refinement": RefinementSettings,
}
SEGMENTS: dict[str, tuple[type[BaseModel], ...]] = {
    "line": (LineTo, LineBy, LineHeading, LineToPosture),
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

A task file is YAML. Units are SI. File names are relative to the task file. Unknown keys are errors. For completion in
editors, save a JSON schema next to the task file with `brachis schema --out task.schema.json`, and begin the task file
with `# yaml-language-server: $schema=task.schema.json`.

**Other units.** `!degrees` and `!millimeters` before a number change it to rad or m:

```yaml
start: {joints: [!degrees 30, !degrees -120, 2.0944]}   # rad without a tag
end: {joints: {j1: !degrees 45, j2: -1.5708, j3: 0.5}}
```

**Postures by name.** `start`, `end` and lines take them; a line ends at the tool's place in the posture, and for poses
with its orientation:

```yml
postures: {home: [0.5, -2.1, 2.1]}                      # rad (m)
start: home
end: home
path: [{line: {by: [0, 0.3]}, stop: true}, {line: {to_posture: home}}]
```

**Limits.** If a key is absent, the URDF's limit holds; `null` removes the limit. A number holds for all joints. A list
is in chain order. A mapping names joints; the others keep the limits of the URDF. For torque and velocity, lists and
mappings may contain a pair `[lower, upper]` with lower < 0 < upper instead of a number. Numbers must be from 1e-6 to
1e12 in SI units, also after scaling; ends of position ranges within 1e6 rad or m of zero, or open (`null`).

Limits on `jerk` and `torque_rate` need `spline.degree` >= 3 and `spline.rest: full`; they then hold at both ends too.
With `rest: jerk` (degree >= 4) jerk and torque rate are zero at both ends. The torque rate includes the change of
Coulomb friction; a larger `coulomb_velocity` makes it change slower.

**Friction.** If `viscous` or `coulomb` is absent, the URDF's `<dynamics>` has the value. `null` switches it off.

A plan prints the values in use; they are also in the saved motion and, under `in_use`, in the JSON. `brachis inspect
task.yaml` shows them without planning, with the path and the postures at its ends. What a plan refuses about these is
an error there too.

**A `Robot` in Python.** `brachis.plan(robot, task)` uses the robot in place of the `urdf` key and adds the settings of
the task's `robot` part. A setting that contradicts the robot is an error that names its key.

**`torque_speed`** is a curve at the joint, not at the motor. It is the same for driving and braking; for a drive that
brakes with more torque the plan is too cautious. Example: a data sheet gives 1.27 N m at 3000 rpm, and 4500 rpm
without load; the gear is 1:50 with efficiency 0.8. With speed = rpm * 2 pi / 60 / ratio and torque = torque * ratio *
efficiency:

```yaml
robot:
  limits:
    torque_speed:
      j1: [[0, 50.8], [6.28, 50.8], [9.42, 0]]   # rad/s, N m: 3000 and 4500 rpm behind 1:50
```

**Implausible figures** are degrees for rad, mm for m, g for kg, mNm for N m, rpm for rad/s, factors above 10, or an
end time at the planner's lower bound. They cause warnings on standard error, in `warnings` of the JSON and in
`result.warnings`. A start posture that looks like degrees is an error. `strict: true` (`--strict`, `brachis.plan(...,
strict=True)`) makes all of them errors, `strict: false` (`--no-strict`) all of them warnings.
"""

LIMITS_FILE = """
## Limits files

`robot.limits_file` names a YAML file of joint limits. An example is `robots/panda_limits.yaml` with the published
figures of the Franka Emika Panda. `robot.limits` of the task comes before the file, and the file before the URDF. If
the task names joints, this holds for each joint. Limits of joints that do not move (locked, or off the chain to the
tool) have no effect. The file is read with the task; a saved task does not need it. In Python,
`brachis.read_limits(path)` returns a `LimitSpec`.

**`joint_limits.yaml`** of MoveIt, ros2_control and Universal Robots can be used unchanged, also with `!degrees` and
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

`has_..._limits: false` removes a limit, also that of the URDF. Limits that are not in the file come from the URDF.
Every joint that moves the tool needs an entry in the file or in the task's `robot.limits`.
`default_velocity_scaling_factor` and `default_acceleration_scaling_factor` are used as `limits.scale`. MoveIt's Setup
Assistant sets them to 0.1; with `robot.limits.scale: {velocity: 1, acceleration: 1}` the task uses the full limits.
Files of Universal Robots may omit `_joint` at the end of joint names.

A limits file in the format of brachis has these keys:
"""
PATH = """
## `path`

A path is a list of segments. Each segment is a mapping with one kind (`line`, `arc`, `circle`, `helix`, `spline`,
`bspline`, `csv` or `turn`) and, optionally, the keys of the table below. A segment starts at the end of the one
before. The first one starts at `path_start`, at the tool's place in the start posture, or at its first waypoint. The
path must be smooth up to its third derivative; a corner between two segments needs a `blend` or a stop.

With `stop: true` the tool stops at the end of a segment, with `dwell: 0.5` it also waits there for 0.5 s. All joints
are at rest at a stop; the posture is free. The motions before and after it are planned together. Where the path ends,
the motion ends at rest anyway (`boundary.end_speed: 0`).

Points have all task coordinates: m, and rad for yaw, pitch or roll. For poses (`pose`, `pose_free_roll`) these are x,
y, z, and `orientation` says how the tool turns.

`task_space` takes any rows of the position, and one row of rotation behind them. A SCARA with a quill, a palletiser
that keeps its tool level, or a gantry with a turning axis takes `[x, y, z, yaw]`:

```yaml
task_space: [x, y, z, yaw]
path:
  - line: {by: [-0.1, 0.12, 0, 1.0]}                         # m, m, m, rad
```

An arm in the xz-plane takes `[x, z, pitch]`, one in the yz-plane `[y, z, roll]`. The angle follows the right-hand rule
about the world's axis. It is 0 where the first axis of the tool frame that is perpendicular to this axis points along x
(for roll: along y). No joint may tilt the tool.

`axis` prescribes the direction of the tool's z axis and nothing else, as for a torch whose roll is free. `[x, y, axis]`
adds positions; `[x, y, z, axis]` is `pose_free_roll`. Segments turn the axis as they turn poses, by `orientation` and
`turn`. For `axis` alone the path has only segments `turn`.

```yaml
task_space: [x, y, axis]
path:
  - line: {by: [0.1, -0.1]}
    orientation: {rotate: {axis: [0, 1, 0], angle_deg: 30}}
```

Rows that depend on each other, or that no joint changes, are refused.

Points are in the world frame, or in one of the `frames`, for example that of a workpiece. Write `path: {frame:
workpiece, segments: [...]}`, or the key `path_frame` next to `path`. Segments, files of points, directions,
orientations and `path_start` are then in this frame. Bodies of the scene stand in it with `frame: workpiece`, and other
frames too. If the workpiece moves, only one key changes; a sweep over `frames.workpiece.xyz` finds its best place. If
the task space has only some of x, y, z, the frame may be rotated only within these coordinates. Results, plots and
exports are in the world frame.

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

With `task_space: joints` points are the positions of all joints, rad (m), in chain order. The segments are `line: {to:
...}`, `line: {by: ...}`, `spline`, `bspline` and `csv`. Lengths along the path and of blends are in rad (m).
`docs/from_toppra.md` has an example.
"""
TURN = """
### `turn: {...}`

For poses only: the tool turns on the spot, by `rotate: {...}` or `to: {...}` as described below. A turn can follow
another turn about the same axis, or about any axis with `profile: smooth`. It cannot follow or precede a segment with
a moving position.
"""
ORIENTATION = """## `orientation`

For poses, every segment except `turn` can have an `orientation`: how the tool turns along the segment. The segment
starts with the orientation at the end of the one before. Orientations are those of the tool frame in the frame of the
path (the world or `path_frame`).

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
| `{rotate: {axis: ..., angle_deg: ...}}` | The tool turns about a fixed axis. |
| `{to: {...}}` | The tool turns to an orientation about one axis, the shortest way, by less than 180 degrees. |
| `tangent` or `{tangent: {up: ...}}` | The tool turns with the tangent of the path; see below. |

Position and orientation advance together. With `profile: uniform` the tool turns by the same angle for every metre of
the path. If the next segment turns differently, the turning rate jumps, which is refused like a corner. Then use
`profile: smooth` (the rate and its first two derivatives are zero at both ends) or a `blend` (it rounds position and
orientation).

With `tangent` the tool keeps its orientation in a frame that moves along the path: x along the tangent, y along up x
tangent. So the tool turns about `up` if the path turns, and pitches if the path rises. If the tangent is parallel to
`up` (within 1 degree), the frame is not defined; give another `up`.

A spline passes its waypoints with the orientations of `orientations`, one for each waypoint. They do not include the
orientation at the segment's start. Between waypoints the orientation is smooth up to the third derivative and does not
depend on the choice of the world frame or tool frame. Successive orientations must differ by less than 180 degrees.

```yaml
task_space: pose
path:
  - spline:
      relative: true                      # displacements in the path's frame, rotations in the tool frame
      through: [[0.1, 0, 0], [0.2, 0.1, 0], [0.2, 0.2, 0.1]]
      orientations: [{rpy_deg: [0, 0, 20]}, {rpy_deg: [0, 10, 60]}, {quaternion_xyzw: [0, 0, 0.707, 0.707]}]
```

Write an orientation in exactly one of these conventions. brachis guesses none: the key states the order of a
quaternion's numbers or whose angles are meant. The keys hold for every orientation, also in `path_start`. For files of
points, `csv.orientation` takes the same names without `_deg`.

| key | meaning |
|---|---|
"""
CSV = """
## Files of points

`csv: {file: poses.csv}` is a smooth curve along the points of a file, one point per row. The first line names the
columns, in any order. Empty lines and lines that begin with `#` are skipped. If the task space is a list of
coordinates, they are the names of the columns (`x,y`, `x,y,z,yaw`, ...). With `axis` the columns are those of the
positions and of an orientation. For a path of joints the columns have the names of the joints (rad, m); `units` and
`tolerance` are not allowed there. For poses the columns are

- `x,y,z`: positions; the segment's `orientation` says how the tool turns;
- `x,y,z,qw,qx,qy,qz`: positions and unit quaternions;
- `x,y,z,i,j,k`: positions and directions of the tool's z axis, of length 1; for `task_space: pose_free_roll`. Where
  CAM's axis points out of the workpiece and the tool's z axis into it, change the signs;
- `x,y,z,roll,pitch,yaw`, `x,y,z,w,p,r` (Fanuc), `x,y,z,o,a,t` (Kawasaki) or `x,y,z,a,e,r` (Comau): positions and
  angles;
- `x,y,z,rx,ry,rz`, `x,y,z,a,b,c` or `x,y,z,q1,q2,q3,q4`: positions and orientations. Their meaning depends on the
  robot's maker, so `orientation` must state it: `rotation_vector`, `rpy`, `staubli_xyz` or `fanuc_wpr` for `rx,ry,rz`;
  `kuka_abc` or `rpy` (Mitsubishi) for `a,b,c`; `quaternion_wxyz` (ABB) or `quaternion_xyzw` for `q1` to `q4`.

An extra column `feed` (or `f`, `speed`, `v`) gives the tool's speed on the way to each point; it needs a `tolerance`.
Columns are separated by commas, semicolons, tabs or spaces. Numbers may have decimal commas unless commas separate the
columns. Units are part of the column names (`x_mm`, `X [mm]`, `rx (deg)`, `feed_mm/min`) or are given by `units`.
Lengths without a unit are in m, the angle of a task space and rotation vectors in rad. Other angles and speeds need a
unit. brachis reports how it understood the file.

The segment starts at the first point. With `start: free` and without `path_start`, the path begins there too. If the
segment would have to start more than 1e-4 m or rad away from it, the file is refused. With `relative: true` all points
are moved so that the first one is at the segment's start.

**Without a tolerance** the path passes through all points. Two successive points with the same position are refused,
because the motion would have to stop there. A file in which the position never changes is allowed. Points that are
rounded or noisy are refused if the curvature of a curve through them is only noise; then give a tolerance.

**With a tolerance** the path is a quintic B-spline (C4) with few knots. It passes through the first and last point and
within the tolerance of all others (100,000 and more). The path may wind, cross itself or be passed several times: a
helix takes about six knot intervals a turn. Repeated points are left out and reported. Spikes and changes of unit are
refused, with their line. If the distance between two points is more than five times the usual one, the path
between them is straight, as CAM systems mean it. Corners are listed, and rounded by blends within `tolerance.corner`.
The smaller this tolerance, the slower the robot passes them. With `corner: stop` the tool stops at them instead, with
or without a tolerance; corners are changes of direction of more than 12 degrees at one place. The reported distance
of a point is that from a place of the curve on the same turn. `brachis inspect TASK` and `brachis plan` print the
findings; they are also in `result.fits` and the JSON. `brachis plot --kind fit` draws the errors.

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

G-code files (`.nc`, `.ngc`, `.gcode`, `.tap`) are read in the same way: G0 to G3 with I, J, K or R and with turns (P),
G17 to G21, G90, G91, G90.1, G91.1 and F. The default unit is mm. Commands that leave the path as it is are skipped and
reported. Cycles, cutter compensation, dwells, rotary axes, changes of the work offset, and letters that may change the
path are refused, with their line. So is a move in G91 from a place that is not known: begin with G90 G0, or G92.

Feed rates are largest speeds of the tool, linear between the first and the last point that has one. They hold in
addition to those of `tool_limits`.

The file is read with the task and becomes one `spline` or `bspline`, or one for each section between corners; a saved
task does not need it. For arrays, `brachis.fit_path(points, tolerance=...)` returns the segments of a path, including
the first point. Points may be positions, 4x4 matrices, SE3 objects, or positions with SciPy's rotations.
"""


def rows(model: type) -> Iterator[str]:
    """Yield one line a key: name, default, description."""
    yield from TABLE_HEAD
    for name in model.__pydantic_fields__:
        yield _row(model, name)


def _row(model: type, name: str) -> str:
    field = model.__pydantic_fields__[name]
    text = field.description or describe_fields(model)[name]
    description = " ".join(text.split()).replace("|", " or ")
    return f"| `{name}` | {_default(field)} | {description} |"


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
    parts += [
        "\n### `to: {...}`\n",
        "The keys of an orientation as above, and\n",
        *TABLE_HEAD,
    ]
    parts += [
        _row(Target, "profile"),
        "\n### `tangent: {...}`\n",
        *rows(Tangent),
        CSV.rstrip(),
    ]
    for key, model in FILES.items():
        parts += [f"\n### `csv.{key}`\n", *rows(model)]
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
