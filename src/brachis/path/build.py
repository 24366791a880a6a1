"""The path of a task: the curves of its segments, joined with blends; it begins at the tool of the start posture."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from brachis.common import tolerances
from brachis.common.words import write_apart
from brachis.errors import PathError, StartError, check_names
from brachis.path.context import SegmentContext
from brachis.path.curves import (
    LineCurve,
    arc_center,
    arc_via,
    circle,
    helix,
    line_by,
    line_heading,
    line_to,
)
from brachis.path.joins import (
    blend_poses,
    blend_rows,
    find_joins,
    pose_corner,
    refuse_corners,
    row_corner,
)
from brachis.path.orientation import orientation_along, turn_of
from brachis.path.pose import OrientedPath, PosePath, pose_curve, rotations
from brachis.path.protocol import Array, Curve, MappedCurve
from brachis.path.rotations import rotation_of
from brachis.path.sequence import CurveSpan, Path, PathFrame
from brachis.path.splines import (
    bspline_curve,
    pose_bspline,
    pose_spline,
    spline_through,
)
from brachis.robot import Robot, TaskMap
from brachis.robot.joints import principal
from brachis.robot.plausibility import (
    distance_hint,
    distances_from_base,
    place_hint,
    position_hint,
    reach,
    turn_hint,
)
from brachis.robot.task_map.protocol import (
    ANGLES,
    POSE_ROWS,
    TURN_ROWS,
    joints_of,
    position_rows,
)
from brachis.task import Task
from brachis.task.orientation import AlongTangent, Target, TurnTo
from brachis.task.point_data import PointFile
from brachis.task.points.units import quaternions_of
from brachis.task.segments import (
    ArcCenter,
    ArcVia,
    BSplineCurve,
    BSplineSegment,
    CircleTurns,
    HelixTurns,
    LineBy,
    LineHeading,
    LineSegment,
    LineTo,
    LineToPosture,
    Segment,
    SplineSegment,
    SplineThrough,
    TurnSegment,
)
from brachis.task.settings import place_frame


def _unread(shape: PointFile, context: SegmentContext) -> Curve:
    raise context.wrong(
        "the file has not been read",
        ".file",
        found=shape.file,
        allowed="a curve",
        hint="brachis.load_task reads the file and turns it into a curve",
    )


BUILDERS: Final[dict[type, Callable[[Any, SegmentContext], Curve]]] = {
    LineTo: line_to,
    LineBy: line_by,
    LineHeading: line_heading,
    ArcCenter: arc_center,
    ArcVia: arc_via,
    CircleTurns: circle,
    HelixTurns: helix,
    SplineThrough: spline_through,
    BSplineCurve: bspline_curve,
    PointFile: _unread,
}
"""For every form of segment, the function that builds the curve of the rows or, for poses, of the position."""


@dataclass(frozen=True)
class RowCoordinates:
    """Rows of a task space; the task velocity is their derivative.

    Attributes
    ----------
    rows : tuple of str
        Names of the rows, which come first among the coordinates; the position rows come first among the rows.
    """

    rows: tuple[str, ...]
    corner = staticmethod(row_corner)
    blend = staticmethod(blend_rows)

    def curve(self, segment: Segment, index: int, start: Array) -> Curve:
        """Return the curve of a segment, whose index in the path is `index`, beginning at `start`.

        Raises
        ------
        PathError
            The segment has zero length or does not fit these coordinates.
        """
        context = SegmentContext(f"path[{index}].{segment.kind}", start, self.rows)
        if isinstance(segment, TurnSegment) or segment.orientation is not None:
            key = "turn" if isinstance(segment, TurnSegment) else "orientation"
            raise PathError(
                f"this {key} needs a task space of poses",
                found=f"task_space [{', '.join(self.rows)}]",
                where=f"path[{index}].{key}",
                hint="Set task_space: pose, or turn yaw by line: {by: [..., angle]}",
            )
        return BUILDERS[type(segment.shape)](segment.shape, context)


@dataclass(frozen=True)
class JointCoordinates(RowCoordinates):
    """The positions of all joints."""

    def curve(self, segment: Segment, index: int, start: Array) -> Curve:
        """Return the curve of a segment, whose coordinates may list the joints in a different order."""
        if not isinstance(segment, LineSegment | SplineSegment | BSplineSegment):
            by = ", ".join(["1.5708", *["0"] * (len(self.rows) - 1)])
            raise PathError(
                "a joint path cannot have this segment",
                found=segment.kind,
                allowed="line: {to: ...}, line: {by: ...}, spline, bspline, csv",
                where=f"path[{index}]",
                hint=f"To turn one joint by 90 degrees, write line: {{by: [{by}]}}",
            )
        names = getattr(segment.shape, "joints", None)
        if names is None:
            return super().curve(segment, index, start)
        joints = joints_of(self.rows)
        where = f"path[{index}].{segment.kind}.joints"
        check_names("joint", names, joints, where)
        if sorted(names) != sorted(joints):
            raise PathError(
                "each joint must be named exactly once",
                found=list(names),
                allowed=", ".join(joints),
                where=where,
            )
        order = [joints.index(name) for name in names]
        permuted = RowCoordinates(tuple(self.rows[column] for column in order))
        columns = np.argsort(order)
        curve = permuted.curve(segment, index, start[order])
        return MappedCurve(curve, partial(_permute, columns))


def _permute(columns: np.ndarray, _sigma: Array, derivatives: Array) -> Array:
    return derivatives[:, :, columns]


@dataclass(frozen=True)
class PoseCoordinates(RowCoordinates):
    """Rows of the position, then the rotation matrix row by row; `rows` names only the rows of the position."""

    corner = staticmethod(pose_corner)
    blend = staticmethod(blend_poses)

    def curve(self, segment: Segment, index: int, start: Array) -> Curve:
        """Return the curve of position and orientation along a segment."""
        position = start[: len(self.rows)]
        rotation = rotations(start)
        context = SegmentContext(f"path[{index}].{segment.kind}", position, self.rows)
        if isinstance(segment, TurnSegment):
            turn = turn_of(segment.turn, rotation, context.key)
            if abs(turn.angle) < tolerances.LENGTH:
                raise context.wrong(
                    "the turn has zero length",
                    found="0 degrees",
                    allowed="an orientation that differs from the previous one",
                )
            still = LineCurve(position, np.zeros_like(position), abs(turn.angle))
            return pose_curve(still, turn.over(still.length))
        if not self.rows:
            raise context.wrong(
                "this segment moves the position, but the task space has no position rows",
                found=segment.kind,
                allowed="turn: {rotate: ...} or turn: {to: ...}",
            )
        shape = segment.shape
        if isinstance(shape, SplineThrough) and shape.orientations is not None:
            return pose_spline(shape, context, rotation)
        columns = len(self.rows) + 4
        if isinstance(shape, BSplineCurve) and len(shape.control_points[0]) == columns:
            return pose_bspline(shape, context, rotation)
        curve = BUILDERS[type(shape)](shape, context)
        key = f"path[{index}].orientation"
        turns = segment.orientation
        if turns == "tangent" or isinstance(turns, AlongTangent):
            context.need_rows("an orientation along the tangent", 3)
        turning = orientation_along(segment.orientation, curve, rotation, key)
        return pose_curve(curve, turning)


def build_path(
    segments: Sequence[Segment],
    start: Sequence[float] | Array,
    task_space_rows: Sequence[str],
    frame: PathFrame | None = None,
    postures: Mapping[str, Array] | None = None,
) -> Path:
    """Return the path that segments describe.

    Parameters
    ----------
    segments : sequence of Segment
        The segments of a task, at least one.
    start : array_like, shape (c,)
        Task coordinates at the start posture, m and rad; for an orientation, the rotation matrix row by row.
    task_space_rows : sequence of str
        Rows of the task space: some of x, y, z, followed by one of roll, pitch, yaw, or by rx, ry, rz for orientations;
        or the rows of all joints (`brachis.robot.task_map.protocol.joint_rows`).
    frame : PathFrame, optional
        Frame in which the segments are given. Default: the world. The start is always in the world.
    postures : mapping of str to ndarray, optional
        Task coordinates in the world, (c,), of the postures to which lines lead.

    Returns
    -------
    Path
        The path in the world, three times continuously differentiable with respect to s except at its stops. For poses,
        the path is a `PosePath`, whose samples have the body twist; for orientations with fewer position rows, an
        `OrientedPath`.

    Raises
    ------
    PathError
        A segment does not fit the task space, has zero length or is undefined; the path has a corner without a blend or
        a stop; or a blend does not fit. The message names the key.

    Examples
    --------
    >>> from brachis.task import LineBy, LineSegment
    >>> path = build_path([LineSegment(line=LineBy(by=(0.0, 2.0)))], [1.0, 0.0], ["x", "y"])
    >>> path.sample([0.5]).target.tolist()
    [[1.0, 1.0]]
    """
    rows = tuple(task_space_rows)
    point = np.array(start, dtype=float)
    path_type = Path
    coordinates = RowCoordinates(rows)
    if joints_of(rows):
        coordinates = JointCoordinates(rows)
    elif rows[-3:] == TURN_ROWS:
        path_type = PosePath if rows == POSE_ROWS else OrientedPath
        coordinates = PoseCoordinates(position_rows(rows))
        # This is the closest rotation: the polar decomposition without its stretch.
        u, _, vt = np.linalg.svd(rotations(point))
        point[-9:] = (u @ vt).ravel()
    if frame is not None:
        point = frame.to_frame(point)
    curves: list[Curve] = []
    for i, segment in enumerate(segments):
        if isinstance(segment.shape, LineToPosture):
            assert postures is not None
            place = postures[segment.shape.to_posture]
            place = place if frame is None else frame.to_frame(place)
            segments = [*segments]
            segments[i] = _line_to(segment, place, point, rows)
        curve = coordinates.curve(segments[i], i, point)
        point = curve.derivatives(np.array([curve.length]), 0)[0, 0]
        curves.append(curve)
    spans = _join(curves, segments, coordinates)
    positions = len(position_rows(coordinates.rows))
    return path_type.of(spans, positions, frame)


def _line_to(
    segment: Segment, place: Array, start: Array, rows: tuple[str, ...]
) -> Segment:
    """Replace a line to a posture by the line from `start` to `place`, (c,), with the shorter of the two rotations."""
    orientation = None
    if rows[-3:] == TURN_ROWS:
        turn = rotation_of(rotations(place))
        target = Target(quaternion_wxyz=tuple(quaternions_of(turn).tolist()))
        orientation = TurnTo(to=target)
        place = place[:-9]
    elif rows[-1] in ANGLES:
        angle = start[-1] + principal(place[-1] - start[-1])
        place = np.append(place[:-1], angle)
    line = LineTo(to=tuple(place.tolist()))
    return segment.model_copy(update={"line": line, "orientation": orientation})


def _join(
    curves: Sequence[Curve],
    segments: Sequence[Segment],
    coordinates: RowCoordinates,
) -> tuple[CurveSpan, ...]:
    """Return the spans of the segments' curves, joined end to end, with rounded corners.

    Raises
    ------
    PathError
        Consecutive curves do not match up to the third derivative, and there is no blend or stop between them; or a
        blend does not fit.
    """
    corners = []
    spans = []
    taken = 0.0
    for join in find_joins(curves, coordinates.rows):
        i = join.index
        size = segments[i].blend or 0.0
        dwell = segments[i].dwell if segments[i].stop else None
        end = join.first.length - size
        spans.append(CurveSpan(join.first, taken, end, (i,), dwell))
        taken = size
        if segments[i].stop:
            continue
        if not size:
            corners.append(coordinates.corner(join))
        else:
            rounded = coordinates.blend(join, size)
            spans.append(CurveSpan(rounded, 0.0, rounded.length, (i, i + 1)))
    last = len(curves) - 1
    spans.append(CurveSpan(curves[last], taken, curves[last].length, (last,)))
    refuse_corners(corners)
    # If two blends meet in the middle of a segment, nothing is left of the segment except rounding errors.
    return tuple(span for span in spans if span.length > 1e-11 * span.curve.length)


def path_of(task_map: TaskMap, task: Task) -> Path:
    """Build the path of a task. The path of a move prescribes nothing; its s is the share of the move.

    Parameters
    ----------
    task_map : TaskMap
    task : Task

    Returns
    -------
    Path

    Raises
    ------
    StartError
        The tool in the start posture is not at the task's ``path_start``.
    PathError, UnknownNameError, InputError
        As for `build_path`; or ``path_start`` does not fit the task space.
    """
    if not task_map.m:
        nowhere = LineCurve(np.empty(0), np.empty(0), 1.0)
        return Path.of((CurveSpan(nowhere, 0.0, 1.0),), 0, None)
    frame = None
    if task.path_frame is not None:
        frame = PathFrame.of(place_frame(task.frames, task.path_frame), task_map.rows)
    point = None
    if task.path_start is not None:
        point = task_map.read_start(task.path_start)
        if frame is not None:
            point = frame.to_world(point)
    postures = {
        name: task_map.value(task_map.robot.posture(joints, f"postures.{name}"))
        for name, joints in task.postures.items()
    }
    known = (task_map.rows, frame, postures)
    path = None
    if task.begins_elsewhere:
        assert point is not None
        written = build_path(task.path, point, *known)
        path = written.travelled(task.path_begin, is_reversed=task.path_reversed)
        (point,) = path.sample([0.0]).target
    given_joints = task.joints_at("start")
    if given_joints is not None:
        start = task_map.robot.posture(*given_joints)
        if point is not None:
            check_on_path(task_map, start, point, "start", given_joints[1])
        point = task_map.value(start)
    assert point is not None
    return path or build_path(task.path, point, *known)


class OffPathError(StartError):
    """The tool in a given posture is not where the path starts or ends.

    Attributes
    ----------
    name : {"start", "end"}
    """

    name: str


def check_on_path(
    task_map: TaskMap, posture: np.ndarray, target: np.ndarray, name: str, where: str
) -> None:
    """Reject a posture, (n,), given at `where`, whose tool is not at `target`, (c,), the start or end of the path.

    Raises
    ------
    OffPathError
    """
    place = task_map.value(posture)
    miss = np.abs(task_map.difference(place, target))
    worst = np.argmax(miss)
    largest = tolerances.WRITTEN
    if miss[worst] > largest:
        unit = task_map.units[worst]
        distance, allowed = write_apart(miss[worst], largest, digits=3)
        error = OffPathError(
            f"the {name} posture is off the path",
            where=where,
            found=f"{distance} {unit} off in {task_map.rows[worst]}",
            allowed=f"at most {allowed} {unit}",
            hint=_place_hint(task_map, place, target)
            or posture_hint(task_map.robot, posture)
            or f"Choose a posture with the tool at the {name} of the path",
        )
        error.name = name
        raise error


def posture_hint(robot: Robot, posture: np.ndarray) -> str | None:
    """Return a hint about implausible positions in a posture, (n,), such as degrees; None if all are plausible."""
    ends = robot.limits.both_ways("position")
    joints = zip(posture.tolist(), *ends, robot.position_units, strict=True)
    hints = (position_hint(*joint) for joint in joints)
    return next(filter(None, hints), None)


def _place_hint(task_map: TaskMap, place: np.ndarray, target: np.ndarray) -> str | None:
    """Return a hint about stated coordinates, (c,), that differ from the tool's coordinates, (c,)."""
    axes = len(task_map.axes)
    hint = place_hint(place[:axes], target[:axes], task_map.rows)
    if axes:
        robot = task_map.robot
        away = distances_from_base(robot, task_map.axes, target[:axes])
        hint = hint or distance_hint(float(away), reach(robot))
    if len(target) == axes + 9:
        turned, target_rotation = (
            coordinates[axes:].reshape(3, 3) for coordinates in (place, target)
        )
        hint = hint or turn_hint(turned, target_rotation)
    return hint
