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
from brachis.task.orientation import Attitude, Rotation, Tangent
from brachis.task.point_data import FileUnits, FitTolerance, PointFile
from brachis.task.scene import CollisionSettings, SceneBody
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
    "robot.friction": FrictionSettings,
    "robot.payload": Payload,
    "robot.payload.inertia": InertiaMatrix,
    "robot.tool_offset, robot.mounting, frames.NAME": FramePlacement,
    "boundary": BoundarySettings,
    "tool_limits": ToolLimits,
    "tool_limits.speed": SpeedTable,
    "tool_limits.process_speed": ProcessSpeed,
    "scene[i]": SceneBody,
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
BY_BRACHIS = "written by brachis."
"""End of the descriptions of keys that no user writes."""
FILES: dict[str, type[BaseModel]] = {"units": FileUnits, "tolerance": FitTolerance}
INTRODUCTION = """# Task files

<!-- Made by docs/make_task_reference.py. -->

A task file is YAML. Units are SI; `!degrees` and `!millimeters` before a number change it to rad or m. File names are
relative to the task file. Unknown keys are errors. Each key below has its default (`{...}`: a section of its own);
`null` means none unless a line says otherwise. For completion in editors, run `brachis schema --out
task.schema.json` and begin the task file with `# yaml-language-server: $schema=task.schema.json`.

```yaml
start: {joints: [!degrees 30, !degrees -120, 2.0944]}   # rad without a tag
end: {joints: {j1: !degrees 45, j2: -1.5708, j3: 0.5}}
```

**Limits and friction.** If a key is absent, the URDF's value holds; `null` removes it. A number holds for all joints, a
list is in chain order, a mapping names joints; the others keep the URDF's values. For torque and velocity, lists and
mappings may contain a pair `[lower, upper]` with lower < 0 < upper. Numbers must be from 1e-6 to 1e12, also after
scaling; ends of position ranges within 1e6 rad or m of zero.

Limits on `jerk` and `torque_rate` need `spline.degree` >= 3 and `spline.rest: full`; they hold at both ends too. The
torque rate includes the change of Coulomb friction; a larger `coulomb_velocity` makes it change slower.

**What is in use** is printed by a plan; it is also in the saved motion and, under `in_use`, in the JSON. `brachis
inspect task.yaml` shows it without a plan, and refuses what a plan refuses at once.

**`torque_speed`** is a curve at the joint, not at the motor; for a drive that brakes with more torque the plan is too
cautious. A motor with 1.27 N m at 3000 rpm and 4500 rpm without load, behind a gear of 1:50 with efficiency 0.8
(speed = rpm * 2 pi / 60 / ratio, torque = torque * ratio * efficiency):

```yaml
robot:
  limits:
    torque_speed:
      j1: [[0, 50.8], [6.28, 50.8], [9.42, 0]]   # rad/s, N m: 3000 and 4500 rpm behind 1:50
```

**Implausible figures** (degrees for rad, mm for m, g for kg, mNm for N m, rpm for rad/s, factors above 10, an end
time at the planner's lower bound) cause warnings: on standard error, in `warnings` of the JSON, in `result.warnings`.
`strict` (`--strict`, `--no-strict`, `brachis.plan(..., strict=True)`) makes all of them errors, or none.
"""

SCALE = """
`robot.limits.scale` has a factor on every limit, 1.0 by default:
{names}.
That of `torque` also acts on torque-speed curves, that of `power` on `total_power`."""

LIMITS_FILE = """
## Limits files

`robot.limits_file` names a YAML file of joint limits, such as `robots/panda_limits.yaml` with the published figures
of the Franka Emika Panda. `robot.limits` comes before the file, joint by joint, and the file before the URDF. Joints
that do not move (locked, or off the chain to the tool) have no effect. A saved task does not need the file. In
Python, `brachis.read_limits(path)` returns a `LimitSpec`.

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

`has_..._limits: false` removes a limit, also that of the URDF. `default_velocity_scaling_factor` and
`default_acceleration_scaling_factor` become `limits.scale`; MoveIt's Setup Assistant sets them to 0.1, and
`robot.limits.scale: {velocity: 1, acceleration: 1}` uses the full limits. Files of Universal Robots may omit `_joint`
at the end of joint names.

A limits file in the format of brachis has these keys:
"""
PATH = """
## `path`

A path is a list of segments. Each is a mapping with one kind (`line`, `arc`, `circle`, `helix`, `spline`, `bspline`,
`csv` or `turn`) and, if you like, keys of the list below. A segment starts at the end of the one before, the first
one at `path_start`, at the tool's place in the start posture, or at its first waypoint. The path must be smooth up to
its third derivative; a corner needs a `blend` or a stop. Motions before and after a stop are planned together
([phases](phases.md)).

Points have all task coordinates: m, and rad for yaw, pitch or roll. For poses (`pose`, `pose_free_roll`) these are x,
y, z, and `orientation` says how the tool turns.

**Rows.** A SCARA with a quill, a palletiser that keeps its tool level, or a gantry with a turning axis takes
`[x, y, z, yaw]`, an arm in the xz-plane `[x, z, pitch]`, one in the yz-plane `[y, z, roll]`:

```yaml
task_space: [x, y, z, yaw]
path:
  - line: {by: [-0.1, 0.12, 0, 1.0]}                         # m, m, m, rad
```

The angle is 0 where the first axis of the tool frame that is perpendicular to the world's axis points along x (for
roll: along y). No joint may tilt the tool.

`axis` prescribes the direction of the tool's z axis, as for a torch whose roll is free; `[x, y, z, axis]` is
`pose_free_roll`. Segments turn the axis as they turn poses. For `axis` alone the path has only segments `turn`.

```yaml
task_space: [x, y, axis]
path:
  - line: {by: [0.1, -0.1]}
    orientation: {rotate: {axis: [0, 1, 0], angle_deg: 30}}
```

Rows that depend on each other, or that no joint changes, are refused.

**Frames.** The path may be in one of the `frames`, such as that of a workpiece: `path: {frame: workpiece, segments:
[...]}`, or the key `path_frame`. Segments, files of points, directions, orientations and `path_start` are then in it;
bodies of the scene and other frames are placed in it with `frame: workpiece`. If the task space has only some of x, y,
z, the frame may be rotated only within these. Results are in the world frame.

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

**Joints.** With `task_space: joints` points are the positions of all joints, rad (m), in chain order, and lengths of
the path and of blends are in rad (m). Segments are `line` (`to`, `by`), `spline`, `bspline` and `csv`. [From
toppra](from_toppra.md) has an example.
"""
TURN = """
### `turn: {...}`

For poses: the tool turns on the spot, by `rotate: {...}` or `to: {...}` as below. A turn can follow another one about
the same axis, or about any axis with `profile: smooth`. It cannot follow or precede a segment with a moving position.
"""
ORIENTATION = """## `orientation`

How the tool turns along a segment, for poses. The segment starts with the orientation at the end of the one before.
Orientations are those of the tool frame in the frame of the path.

```yaml
task_space: pose
path:
  - line: {by: [0.3, 0, 0]}               # the tool keeps its orientation: fixed, the default
    blend: 0.05
  - line: {by: [0, 0.4, 0]}               # turns by 90 degrees about the path frame's z axis, at rest at both ends
    orientation: {rotate: {axis: [0, 0, 1], angle_deg: 90, profile: smooth}}
  - line: {by: [0, 0.3, 0]}               # turns the shortest way, by less than 180 degrees
    orientation: {to: {rpy_deg: [0, 0, 45], profile: smooth}}
```

Position and orientation advance together. With `profile: uniform` the tool turns by the same angle for every metre.
Where the next segment turns differently, the turning rate jumps, which is refused like a corner. Then use `profile:
smooth` (the rate and its first two derivatives are zero at both ends) or a `blend` (it rounds position and
orientation).

With `tangent` or `{tangent: {up: ...}}` the tool keeps its orientation in a frame with x along the tangent and y along
up x tangent: it turns about `up` if the path turns, and pitches if the path rises. `up` must be more than 1 degree from
the tangent.

A spline passes its waypoints with the orientations of `orientations`, one for each; that of the segment's start is
not among them. In between the orientation is smooth up to the third derivative, whatever the world or tool frame.
Successive orientations must differ by less than 180 degrees.

```yaml
task_space: pose
path:
  - spline:
      relative: true                      # displacements in the path's frame, rotations in the tool frame
      through: [[0.1, 0, 0], [0.2, 0.1, 0], [0.2, 0.2, 0.1]]
      orientations: [{rpy_deg: [0, 0, 20]}, {rpy_deg: [0, 10, 60]}, {quaternion_xyzw: [0, 0, 0.707, 0.707]}]
```

Every orientation, also in `path_start`, is written in exactly one of these conventions; brachis guesses none.
`csv.orientation` takes the same names without `_deg`.

"""
CSV = """
## Files of points

`csv: {file: poses.csv}` is a smooth curve along the points of a file, one a row. The first line names the columns, in
any order. Empty lines and lines that begin with `#` are skipped. For a list of coordinates the columns have their
names (`x,y`, `x,y,z,yaw`, ...); with `axis` there are those of positions and of an orientation. For a path of joints
they have the names of the joints (rad, m), without `units` and `tolerance`. For poses they are

- `x,y,z`: positions; the segment's `orientation` says how the tool turns;
- `x,y,z,qw,qx,qy,qz`: positions and unit quaternions;
- `x,y,z,i,j,k`: positions and directions of the tool's z axis, of length 1, for `pose_free_roll`. If CAM's axis
  points out of the workpiece, change the signs;
- `x,y,z,roll,pitch,yaw`, `x,y,z,w,p,r` (Fanuc), `x,y,z,o,a,t` (Kawasaki) or `x,y,z,a,e,r` (Comau): positions and
  angles;
- `x,y,z,rx,ry,rz`, `x,y,z,a,b,c` or `x,y,z,q1,q2,q3,q4`: positions and orientations, whose meaning depends on the
  maker. `orientation` must state it: `rotation_vector`, `rpy`, `staubli_xyz` or `fanuc_wpr` for `rx,ry,rz`;
  `kuka_abc` or `rpy` (Mitsubishi) for `a,b,c`; `quaternion_wxyz` (ABB) or `quaternion_xyzw` for `q1` to `q4`.

A column `feed` (or `f`, `speed`, `v`) gives the largest speed on the way to each point, linear between the first and
the last point that has one, besides `tool_limits`; it needs a `tolerance`. Columns are separated by commas,
semicolons, tabs or spaces. Decimal commas are read unless commas separate the columns. Units are part of the column
names (`x_mm`, `X [mm]`, `rx (deg)`, `feed_mm/min`) or given by `units`. brachis reports how it understood the file.

The segment starts at the first point; with `start: free` and without `path_start` so does the path. A start more than
1e-4 m or rad away is refused, unless `relative: true` moves the points there.

**Without a tolerance** the path passes through all points. Two successive points with the same position are refused,
unless the position never changes; so are rounded or noisy points, whose curvature is only noise.

**With a tolerance** the path is a quintic B-spline (C4) with few knots, also for 100,000 points. It passes through
the first and last point. It may wind, cross itself or be passed several times. Repeated points are left out and
reported. Spikes and changes of unit are refused, with their line. If two points are more than five times as far apart
as usual, the path between them is straight. [Corners](cam_seam.md#corners) (more than 12 degrees at one place) are
listed, and rounded by blends. Each point is compared with the same turn of the curve. `brachis inspect TASK` and
`brachis plan` print the findings; they are also in `result.fits` and the JSON. `brachis plot --kind fit` draws the
errors.

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

**G-code** (`.nc`, `.ngc`, `.gcode`, `.tap`): G0 to G3 with I, J, K or R and turns (P), G17 to G21, G90, G91, G90.1,
G91.1 and F; in mm by default. Commands that leave the path as it is are skipped and reported. Cycles, cutter
compensation, dwells, rotary axes, changes of the work offset, and letters that may change the path are refused, with
their line. So is a move in G91 from an unknown place: begin with G90 G0, or G92.

The file becomes one `spline` or `bspline`, or one for each section between corners; a saved task does not need it.
For arrays, `brachis.fit_path(points, tolerance=...)` returns the segments, including the first point. Points may be
positions, 4x4 matrices, SE3 objects, or positions with SciPy's rotations.
"""


def rows(*models: type, above: set[str] | None = None) -> Iterator[str]:
    """Yield one line a key: name, default, description.

    Keys that differ in their names alone share a line; of keys that are said `above` only the names are repeated.
    """
    above = set() if above is None else above
    again = []
    names: dict[str, list[str]] = {}
    for model in models:
        for name, field in model.__pydantic_fields__.items():
            text = field.description or describe_fields(model)[name]
            meaning = " ".join(text.split())
            if meaning.endswith(BY_BRACHIS):
                meaning = f"Of saved tasks; {BY_BRACHIS}"
            if field.is_required():
                meaning = f"required. {meaning}"
            key = f"`{name}{_default(field)}`"
            keys = (
                again if f"{key} {meaning}" in above else names.setdefault(meaning, [])
            )
            if key not in keys:
                keys.append(key)
    above |= {f"{key} {meaning}" for meaning, keys in names.items() for key in keys}
    for meaning, keys in names.items():
        mark = ", " if meaning.startswith("required. ") else ". "
        yield f"- {', '.join(keys)}{mark}{meaning}"
    if again:
        yield f"- {', '.join(again)}. As above."


def _default(field: FieldInfo) -> str:
    """Return the default behind the key, as a task file has it."""
    if field.is_required():
        return ""
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined or isinstance(value, BaseModel | LimitSpec):
        return ": {...}"
    words = {None: "null", False: "false", True: "true"}
    if value is None or isinstance(value, bool):
        return f": {words[value]}"
    return f": {list(value) if isinstance(value, tuple) else value}"


def _needed(shape: type[BaseModel]) -> str:
    """Return what a form of a segment needs: ``center: ..., angle_deg: ...``."""
    fields = shape.model_fields.items()
    return ", ".join(f"{name}: ..." for name, field in fields if field.is_required())


def page() -> str:
    """Return the whole page."""
    parts = [INTRODUCTION, "## The file\n", *rows(Task)]
    for key, model in PARTS.items():
        parts += [f"\n## `{key}`\n", *rows(model)]
        if model is LIMITS:
            names = ", ".join(f"`{name}`" for name in LimitScale.model_fields)
            parts += [SCALE.format(names=names)]
    parts += [LIMITS_FILE, *rows(LimitsFile), PATH, *rows(MovingSegment)]
    above: set[str] = set()
    for kind, shapes in SEGMENTS.items():
        forms = " or ".join(f"`{{{_needed(shape)}}}`" for shape in shapes)
        parts += [f"\n### `{kind}`: {forms}\n", *rows(*shapes, above=above)]
    parts += [TURN, ORIENTATION.rstrip() + "\n"]
    parts += [
        f"- `{name}`. {field.description}"
        for name, field in Attitude.model_fields.items()
    ]
    needed = _needed(Rotation)
    parts += [f"\n### `rotate: {{{needed}}}`, `to: {{...}}`, `tangent: {{...}}`\n"]
    parts += ["`to` takes an orientation and `profile`; `tangent` takes `up`.\n"]
    parts += [*rows(Rotation, Tangent), CSV.rstrip()]
    for key, model in FILES.items():
        parts += [f"\n### `csv.{key}`\n", *rows(model)]
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
