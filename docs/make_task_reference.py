"""Generate docs/task_files.md and docs/profiles.md from the models: ``python docs/make_task_reference.py``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel
from pydantic.dataclasses import dataclass
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from brachis.apps.controller import Language, Profile
from brachis.apps.controller.profile import Axis, AxisGroup
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
PROFILES = Path(__file__).parent / "profiles.md"

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
"""End of the descriptions of keys that users do not write."""
FILES: dict[str, type[BaseModel]] = {"units": FileUnits, "tolerance": FitTolerance}
INTRODUCTION = """# Task files

<!-- Made by docs/make_task_reference.py. -->

A task file is YAML. Units are SI; `!degrees` and `!millimeters` before a number convert it to rad or m. File names are
relative to the task file. Unknown keys are errors. Each key is listed with its default (`{...}`: a separate section).
`null` means none unless stated otherwise. For completion in editors, run `brachis schema --out task.schema.json` and
begin the task file with `# yaml-language-server: $schema=task.schema.json`.

```yaml
start: {joints: [!degrees 30, !degrees -120, 2.0944]}   # rad without a tag
end: {joints: {j1: !degrees 45, j2: -1.5708, j3: 0.5}}
```

**Limits and friction.** If a key is absent, the URDF value applies; `null` removes it. A number applies to all joints.
A list is in chain order. Joints that a mapping leaves out keep their URDF values. For torque and velocity, lists and
mappings may contain pairs `[lower, upper]` with lower < 0 < upper. Numbers must be from 1e-6 to 1e12, also after
scaling. Position ranges must be within 1e6 rad or m of zero.

Limits on `jerk` and `torque_rate` need `spline.degree` >= 3 and `spline.rest: full`, and also apply at both ends. The
torque rate includes the change of Coulomb friction, which is slower with a larger `coulomb_velocity`.

A plan prints **the values in use**. They are also in the saved motion and, under `in_use`, in the JSON. `brachis
inspect task.yaml` shows and checks them without planning.

**`torque_speed`** is a curve at the joint, not at the motor. For a drive that can brake with more torque, the plan is
too cautious. Example: a motor with 1.27 N m at 3000 rpm, and 4500 rpm without load, behind a 1:50 gear with efficiency
0.8 (speed = rpm * 2 pi / 60 / ratio, torque = torque * ratio * efficiency):

```yaml
robot:
  limits:
    torque_speed:
      j1: [[0, 50.8], [6.28, 50.8], [9.42, 0]]   # rad/s, N m: 3000 and 4500 rpm behind 1:50
```

**Implausible figures** (degrees for rad, mm for m, g for kg, mNm for N m, rpm for rad/s, factors above 10, an end
time at the planner's lower bound) cause warnings on standard error, in `warnings` of the JSON and in `result.warnings`.
`strict` (`--strict`, `--no-strict`) turns all or none of them into errors.
"""

SCALE = """
`robot.limits.scale` has a factor, 1.0 by default, for each of these limits:
{names}.
The factor of `torque` also applies to torque-speed curves, that of `power` to `total_power`."""

LIMITS_FILE = """
## Limits files

`robot.limits_file` names a YAML file of joint limits, such as `robots/panda_limits.yaml` with the published figures of
the Franka Emika Panda. For each joint, `robot.limits` overrides the file, and the file overrides the URDF. Limits of
joints that do not move are ignored. In Python, `brachis.read_limits(path)` returns a `LimitSpec`.

Files **`joint_limits.yaml`** of MoveIt, ros2_control and Universal Robots can be used unchanged, also with `!degrees`
and `!radians`:

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

`has_..._limits: false` also removes the URDF limit. `default_velocity_scaling_factor` and
`default_acceleration_scaling_factor` become `limits.scale`. MoveIt's Setup Assistant sets them to 0.1;
`robot.limits.scale: {velocity: 1, acceleration: 1}` restores the full limits. In files of Universal Robots, `_joint`
may be missing at the end of joint names.

A limits file in the format of brachis has these keys:
"""
PATH = """
## `path`

A path is a list of segments. Each segment is a mapping with one kind (`line`, `arc`, `circle`, `helix`, `spline`,
`bspline`, `csv` or `turn`) and optional keys listed below. A segment starts where the previous one ends. The first
segment starts at `path_start`, at the tool position of the start posture, or at its first waypoint. The path must be
smooth up to its third derivative; a corner needs a `blend` or a stop. Motions before and after a stop are planned
together ([phases](phases.md)).

Points have all task coordinates, in m and, for yaw, pitch or roll, in rad. For poses (`pose`, `pose_free_roll`) the
coordinates are x, y, z, and `orientation` describes how the tool turns.

**Rows.** Use `[x, y, z, yaw]` for a SCARA, a palletiser or a gantry with a rotary axis, `[x, z, pitch]` for an arm in
the xz-plane, and `[y, z, roll]` for an arm in the yz-plane:

```yaml
task_space: [x, y, z, yaw]
path:
  - line: {by: [-0.1, 0.12, 0, 1.0]}                         # m, m, m, rad
```

The angle is 0 if the first tool axis that is perpendicular to the world's axis points along x (for roll, along y). No
joint may tilt the tool.

`axis` prescribes only the direction of the tool's z axis, for example of a torch. `[x, y, z, axis]` means
`pose_free_roll`. Segments turn the axis like a pose. With `axis` alone, all segments are `turn`.

```yaml
task_space: [x, y, axis]
path:
  - line: {by: [0.1, -0.1]}
    orientation: {rotate: {axis: [0, 1, 0], angle_deg: 30}}
```

**Frames.** With `path: {frame: workpiece, segments: [...]}` or `path_frame`, the path is given in one of the `frames`.
This applies to segments, files of points, directions, orientations and `path_start`. `frame: workpiece` places scene
bodies and other frames in this frame. If the task space has only some of x, y, z, the frame may be rotated only within
these. Results are in the world frame.

```yaml
frames:
  workpiece: {xyz: [0.6, 0.1, 0.4], rpy_deg: [0, 0, 30]}
path_frame: workpiece
start: free
task_space: pose
path_start: {position: [0, 0, 0.02], rpy_deg: [180, 0, 0]}   # 20 mm above the workpiece, tool pointing down
path:
  - line: {by: [0.2, 0, 0]}                                  # along the workpiece
    orientation: {rotate: {axis: [0, 0, 1], angle_deg: 20}}
```

**Joints.** With `task_space: joints`, points are positions of all joints, rad (m), in chain order. Lengths of paths and
blends are also in rad (m). Possible segments are `line` (`to`, `by`), `spline`, `bspline` and `csv`
([example](from_toppra.md)).
"""
TURN = """
### `turn: {...}`

For poses: the tool turns on the spot, by `rotate: {...}` or `to: {...}` as below. A turn can follow a turn about the
same axis or, with `profile: smooth`, about any axis. It cannot be next to a segment that changes the position.
"""
ORIENTATION = """## `orientation`

For poses: how the tool turns along a segment. The segment starts with the orientation at the end of the previous
segment. Orientations are those of the tool frame in the path's frame.

```yaml
task_space: pose
path:
  - line: {by: [0.3, 0, 0]}               # the tool keeps its orientation: fixed, the default
    blend: 0.05
  - line: {by: [0, 0.4, 0]}               # turns by 90 degrees about the path's z axis, with zero rate at both ends
    orientation: {rotate: {axis: [0, 0, 1], angle_deg: 90, profile: smooth}}
  - line: {by: [0, 0.3, 0]}               # turns the shortest way, by less than 180 degrees
    orientation: {to: {rpy_deg: [0, 0, 45], profile: smooth}}
```

With `profile: uniform` the tool turns by the same angle in every metre. If the next segment turns differently, the
turning rate jumps. Then use `profile: smooth` (the rate and its first two derivatives are zero at both ends) or a
`blend`, which rounds position and orientation.

With `tangent` or `{tangent: {up: ...}}` the tool keeps its orientation in a frame with x along the tangent and y along
up x tangent. The tool turns about `up` if the path turns, and pitches if the path rises. The angle between `up` and the
tangent must exceed 1 degree.

The `orientations` of a spline are those at its waypoints, without the start of the segment. The orientation is smooth
up to the third derivative. Successive orientations must differ by less than 180 degrees.

```yaml
task_space: pose
path:
  - spline:
      relative: true
      through: [[0.1, 0, 0], [0.2, 0.1, 0], [0.2, 0.2, 0.1]]
      orientations: [{rpy_deg: [0, 0, 20]}, {rpy_deg: [0, 10, 60]}, {quaternion_xyzw: [0, 0, 0.707, 0.707]}]
```

Every orientation, also in `path_start`, is written in exactly one of these conventions.
`csv.orientation` takes the same names without `_deg`.

"""
CSV = """
## Files of points

`csv: {file: poses.csv}` is a smooth curve along the points of a file, one per row. The first line names the columns, in
any order. Empty lines and lines that begin with `#` are skipped. Columns are named like the rows of the task space
(`x,y`, `x,y,z,yaw`, ...); for `axis` give an orientation as below. For a joint path, each column has the name of its
joint and is in rad or m; `units` and `tolerance` do not apply. For poses the columns are

- `x,y,z`: positions, with the `orientation` of the segment;
- `x,y,z,qw,qx,qy,qz`: positions and unit quaternions;
- `x,y,z,i,j,k`: positions and directions of the tool's z axis, of length 1, for `pose_free_roll`. If CAM's
  axis points out of the workpiece, change the signs;
- `x,y,z,roll,pitch,yaw`, `x,y,z,w,p,r` (Fanuc), `x,y,z,o,a,t` (Kawasaki) or `x,y,z,a,e,r` (Comau): positions and
  angles;
- `x,y,z,rx,ry,rz`, `x,y,z,a,b,c` or `x,y,z,q1,q2,q3,q4`: positions and orientations whose meaning depends on the
  manufacturer. `orientation` must state it: `rotation_vector`, `rpy`, `staubli_xyz` or `fanuc_wpr` for `rx,ry,rz`;
  `kuka_abc` or `rpy` (Mitsubishi) for `a,b,c`; `quaternion_wxyz` (ABB) or `quaternion_xyzw` for `q1` to `q4`.

A column `feed` (or `f`, `speed`, `v`) states the maximum speed on the way to each point, in addition to `tool_limits`.
Feed rates need a `tolerance`. Columns are separated by commas, semicolons, tabs or spaces. Decimal commas are read
unless commas separate the columns. Units are part of the column names (`x_mm`, `X [mm]`, `rx (deg)`, `feed_mm/min`) or
given by `units`.

The segment starts at the first point; with `start: free` and no `path_start`, so does the path. A different start (by
more than 1e-4 m or rad) is refused, unless `relative: true` moves the points there.

**Without a tolerance** the path passes through all points. Successive points with the same position are refused, unless
the position never changes.

**With a tolerance** the path is a quintic B-spline (C4) with few knots, even for 100,000 points. It passes through the
first and last point, and may wind, cross itself or repeat itself. Repeated points are left out and reported. Spikes and
changes of unit are rejected, and the error names the line. If two points are more than five times as far apart as
usual, the path between them is straight. [Corners](cam_seam.md#corners) (more than 12 degrees at one place) are listed
and rounded by blends. `brachis inspect` and `brachis plan` print how the file was read, which is also in `result.fits`
and the JSON. `brachis plot --kind fit` draws the errors.

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
G91.1 and F; in mm by default. Commands that do not affect the path are skipped and reported. Cycles, cutter
compensation, dwells, rotary axes, changes of the work offset, letters that may change the path, and a move in G91 from
an unknown position are rejected, and the error names the line. Begin with G90 G0 or G92.

The file becomes one `spline` or `bspline`, or one for each section between corners. Saved tasks need neither point
files nor limits files. For arrays, `brachis.fit_path(points, tolerance=...)` returns the segments. Points may be
positions, 4x4 matrices, SE3 objects, or positions with SciPy rotations.
"""

PROFILE_INTRODUCTION = """# A profile of your own

<!-- Made by docs/make_task_reference.py. -->

A profile is a YAML file. With `extends` it contains only the differences from an included profile:

```yaml
extends: fanuc_stream_8ms
axes:
  - {joint: joint_1}
  - {joint: joint_2, zero: 0.1}       # J2 is 0 where joint_2 is 0.1
  - {joint: joint_3, sign: -1}        # J3 turns against joint_3
  - {joint: joint_4}
  - {joint: joint_5}
  - {joint: joint_6}
  - {joint: rail, external: true, name: E2}
coupled: {J3: {J2: 0}}
limits: {velocity: [3, 3, 3, 6, 6, 9]}   # rad/s
```

An axis value is sign * (joint - zero) in its unit, plus coupled multiples. The profile is in rad and m. Every moving
joint needs an axis. Lists replace included lists; mappings are merged. Check signs and zeros: at the start posture, the
controller must display the first row of the file.

## Keys
"""
PROFILE_PARTS: dict[str, type[BaseModel]] = {
    "axes[i]": Axis,
    "arm, external": AxisGroup,
    "program": Language,
}


def rows(*models: type, above: set[str] | None = None) -> Iterator[str]:
    """Yield one line per key: name, default, description.

    Keys that differ only in their names share a line. Of keys that are already described `above`, only the names are
    repeated.
    """
    above = set() if above is None else above
    again = []
    names: dict[str, list[str]] = {}
    for model in models:
        for name, field in model.__pydantic_fields__.items():
            text = field.description or describe_fields(model)[name]
            meaning = " ".join(text.split())
            if meaning.endswith(BY_BRACHIS):
                meaning = f"In saved tasks; {BY_BRACHIS}"
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
    """Return the default that follows the key, in the form of a task file."""
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
    """Return the required keys of a form of a segment: ``center: ..., angle_deg: ...``."""
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


def profile_page() -> str:
    """Return the page of the keys of profiles."""
    parts = [PROFILE_INTRODUCTION, *rows(Profile)]
    for key, model in PROFILE_PARTS.items():
        parts += [f"\n### `{key}`\n", *rows(model)]
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
    PROFILES.write_text(profile_page())
