"""Import of a file of joint positions over time as a trajectory, which can be used like a planned one.

Forward kinematics gives dense samples of the tool's path, and a smooth curve is fitted to them within a tolerance. The
path coordinate over time is a B-spline that does not decrease. Where the motion waits, the path has a stop and may have
a corner.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from typing import Any

import numpy as np

from brachis import ik
from brachis.apps.controller import nearest_on_path
from brachis.apps.recording.nodes import (
    RecordedNodes,
    find_rests,
    nodes_of,
    split_at_rests,
    with_rests,
)
from brachis.apps.recording.recording import Recording, check_units, read_recording
from brachis.common.arguments import check_keywords, numbers
from brachis.common.arrays import spread, with_like_signs
from brachis.common.files import file_name
from brachis.errors import InputError, PathError, TaskError
from brachis.path import build_path
from brachis.planner import RobotOrTask
from brachis.robot import Robot, TaskMap, bind
from brachis.robot.from_task import robot_for
from brachis.robot.task_map import JOINTS, JointSpace
from brachis.robot.task_map.choice import FREE
from brachis.robots import is_robot, locate
from brachis.task import (
    CsvSegment,
    FitTolerance,
    PointFile,
    RobotSettings,
    Segment,
    Source,
    Task,
    load_task,
    name_task_file,
)
from brachis.task.fitted import segments_along
from brachis.task.points.points import Points
from brachis.trajectory import PhaseSpline, Recovered, Trajectory, join_splines
from brachis.trajectory.recovered import LARGEST, check_tolerance

_SURE = 3.0
"""Largest deviation assumed for measured positions, in standard deviations."""


@check_keywords
def import_motion(
    path: str | os.PathLike[str],
    robot: RobotOrTask = None,
    *,
    task: Source | None = None,
    task_space: str | Sequence[str] | None = None,
    units: Mapping[str, str | None] | None = None,
    tolerance: float | None = None,
    noise: float | Sequence[float] | None = None,
) -> Trajectory:
    """Turn a recorded motion into a trajectory that can be verified, drawn, compared and exported.

    If the file has no velocities and accelerations, they are computed from polynomials through its positions. The
    tool's path is computed by forward kinematics, as a smooth curve within a tolerance. ``trajectory.recovered.told``
    says what was found in the file and what is unknown.

    Parameters
    ----------
    path : path
        CSV file whose first line names its columns: time (``t``, ``time_ms``, ...), joint positions (``j1``, ``q_j1``,
        ``j1_pos [deg]``, ...) and, if known, velocities (``qd_j1``, ``j1_vel``, ...). Other columns are ignored.
    robot : path, Robot or Task, optional
        Robot, its name or its URDF file; or a task file, which is then used as `task`. Required unless the task names a
        robot.
    task : path, mapping or Task, optional
        Task whose robot, limits and settings are used. The start and the path of this task are ignored.
    task_space : str or sequence of str, optional
        Task space of the path: rows, ``pose``, ``pose_free_roll`` or ``joints``. Default: the task space of the task
        or, without a task, the largest one that the robot allows.
    units : mapping, optional
        ``{"angle": "deg", "length": "mm", "time": "ms"}`` for columns whose header states no unit. Default: rad, m, s.
    tolerance : float, optional
        Tolerance of the path, m and rad. Default: 1e-6, or more if the digits in the file or the noise are coarser.
    noise : float or (n,) array_like, optional
        Standard deviation of measured positions, rad or m. The positions are smoothed accordingly. Default: the
        standard deviation due to rounding to the digits in the file.

    Returns
    -------
    Trajectory

    Raises
    ------
    TaskError
        The file cannot be read; the message names the line and the column.
    PathError
        The tool follows no smooth path within the tolerance.
    InputError
        The robot, the task or the task space is invalid.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     brachis.export.write(result.trajectory, f"{folder}/recorded.csv", dt=0.004)
    ...     motion = brachis.import_motion(f"{folder}/recorded.csv", brachis.robots.scara3, task_space=["x", "y"])
    >>> motion.recovered.tolerance, round(motion.t_end - result.t_end, 9)
    (1e-06, 0.0)
    """
    path = file_name(path, "path")
    if tolerance is not None:
        tolerance = check_tolerance(tolerance)
    given_robot, settings = _read_robot(robot, task)
    default = settings.task_space if settings else ik.default_task_space(given_robot)
    space = task_space or default
    if settings and settings.task_space == FREE:
        raise InputError(
            "a recorded motion is compared with a path",
            where="robot" if task is None else "task",
            found="a task with a program" if settings.program else "a move",
            allowed="a task with a path, or a robot",
        )
    recording = read_recording(path, given_robot, check_units(units or {}))
    tolerances = settings.tolerances if settings else None
    bound, task_map = bind(given_robot, space, tolerances)
    deviation = _deviations(recording, noise)
    nodes = nodes_of(recording, deviation)
    error = recording.rounding if noise is None else _SURE * deviation
    virtual = (0, bound.n - given_robot.n)  # virtual joints stand still
    states = np.pad(nodes.states, ((0, 0), (0, 0), virtual))
    nodes = with_rests(RecordedNodes(nodes.t, states, nodes.notes))
    if tolerance is None:
        slopes = np.abs(task_map.jacobian(task_map.twists(nodes.q)))
        moved = slopes[:, :, : len(deviation)] @ deviation
        tolerance = float(np.clip(_SURE * moved.max(), 1e-6, LARGEST))
    followed = recover_path(task_map, nodes, tolerance)
    if followed.miss > tolerance:
        raise PathError(
            "the recovered path is too far from the motion",
            found=f"{followed.miss:.3g} m or rad off",
            allowed=f"{tolerance:.3g}",
            where="path",
            hint="Raise the tolerance",
        )
    t = recording.t
    period = 1e3 * float(np.median(np.diff(t)))
    notes = (
        f"{len(t)} rows over {t[-1]:.6g} s, one every {period:.4g} ms",
        *recording.notes,
        *nodes.notes,
        "unknown: the motion between the rows, and the measured torques",
        f"the tool's path comes from forward kinematics; the fitted curve is at most {followed.miss:.1e} m or rad off",
        f"the tolerance of the path is {tolerance:.1e} m and rad",
    )
    rows = np.pad(np.column_stack([t, recording.q]), ((0, 0), virtual))
    error = np.pad(error, virtual)
    knots, control_points = _join_coordinate(nodes, followed)
    return Trajectory(
        task=_task_of(settings, bound, task_map, nodes, followed.segments, space),
        urdf=bound.urdf,
        robot=bound,
        redundant_joints=(),
        branch="",
        times=nodes.t,
        q=nodes.q,
        qdot=nodes.qdot,
        qddot=nodes.qddot,
        qddot_before=nodes.qddot,
        knots=knots,
        degree=DEGREE,
        control_points=control_points,
        phase_ends=nodes.t[[*chain(*followed.rests), -1]],
        chart_rows=np.empty((0, 0, 0)),
        chart_knots=np.empty(0),
        recovered=Recovered(recording.source, tolerance, notes, rows, error),
    )


def _read_robot(robot: RobotOrTask, task: Source | None) -> tuple[Robot, Task | None]:
    """Return the robot with the settings of the task, and the task, which may have been passed as `robot`."""
    if task is None and robot is not None and not is_robot(robot):
        task = robot  # type: ignore[assignment]
        robot = None
    settings = None if task is None else load_task(task)
    robot_settings = settings.robot if settings else RobotSettings()
    if robot is None and robot_settings.urdf is None:
        raise InputError(
            "the robot is missing",
            where="robot",
            allowed="a URDF file, the name of a robot (brachis.robots), a Robot, or a task file",
        )
    with name_task_file(None if robot is not None else task):
        return robot_for(locate(robot), robot_settings), settings  # type: ignore[arg-type]


def _join_coordinate(
    nodes: RecordedNodes, followed: RecoveredPath
) -> tuple[np.ndarray, np.ndarray]:
    """Return the knots and control points of s over time; s is constant during waits. See `join_splines`."""
    is_resting, _ = nodes.at_rest
    splines = [fit_coordinate(*followed.parts[0], is_resting=is_resting)]
    for (first, end), (t, s) in zip(followed.rests, followed.parts[1:], strict=True):
        splines.append(splines[-1].wait(nodes.t[end] - nodes.t[first]))
        splines.append(fit_coordinate(t, s, is_resting=is_resting))
    return join_splines(splines)


def joint_path_of(trajectory: Trajectory) -> tuple[Segment, ...]:
    """Return the joint path of an imported motion, for a task in joint space.

    Raises
    ------
    PathError
        The joints follow no smooth path within the tolerance.
    """
    assert trajectory.recovered is not None
    _, task_map = bind(trajectory.robot, JOINTS)
    states = np.stack([trajectory.q, trajectory.qdot, trajectory.qddot])
    nodes = RecordedNodes(trajectory.times, states)
    return recover_path(task_map, nodes, trajectory.recovered.tolerance).segments


@dataclass(frozen=True, eq=False)
class RecoveredPath:
    """A path recovered from a motion, and the path coordinate during the motion.

    Attributes
    ----------
    segments : tuple of Segment
        Segments of the path, for a task.
    rests : list of (int, int)
        First and last node of each wait.
    parts : tuple of ((K,) ndarray, (K,) ndarray)
        Dense times, s, and path coordinates, for each part between waits.
    miss : float
        Largest distance of the tool from the path, m or rad.
    """

    segments: tuple[Segment, ...]
    rests: list[tuple[int, int]]
    parts: tuple[tuple[np.ndarray, np.ndarray], ...]
    miss: float


def recover_path(
    task_map: TaskMap, nodes: RecordedNodes, tolerance: float
) -> RecoveredPath:
    """Recover the path of a motion in a task space within a tolerance, m and rad. The path stops at waits.

    Raises
    ------
    PathError
        The tool does not move, or does not follow a smooth path within the tolerance, for example because it changes
        its direction without waiting.
    """
    rests = find_rests(nodes)
    moves = split_at_rests(nodes, rests)
    followed = [_follow(task_map, move, tolerance) for move in moves]
    (segments, _, first_values, _), *followed_later = followed
    for (first, end), (following, *_) in zip(rests, followed_later, strict=True):
        dwell = float(nodes.t[end] - nodes.t[first])
        waits = segments[-1].model_copy(update={"stop": True, "dwell": dwell})
        segments = [*segments[:-1], waits, *following]
    path = build_path(segments, first_values[0], task_map.rows)
    places = pairwise([0.0, *path.stops.tolist(), 1.0])
    coordinates = []
    worst = 0.0
    for (_, t, values, share), ends in zip(followed, places, strict=True):
        span = path.between(*ends)
        begun = np.interp(share, [0.0, 1.0], ends)
        s = nearest_on_path(span, task_map, values, begun, ends, steps=4)
        s[[0, -1]] = ends
        s = np.maximum.accumulate(s)
        miss = task_map.difference(values, span.sample(s).target)
        worst = max(worst, float(np.max(task_map.norms(miss))))
        coordinates.append((t, s))
    return RecoveredPath(tuple(segments), rests, tuple(coordinates), worst)


def _follow(
    task_map: TaskMap, nodes: RecordedNodes, tolerance: float
) -> tuple[list[Segment], np.ndarray, np.ndarray, np.ndarray]:
    """Fit segments to the part of a motion between two waits; see `recover_path`.

    Returns
    -------
    list of Segment
    t : (K,) ndarray
        Times at which this part is sampled densely, s.
    values : (K, c) ndarray
        Task coordinates at these times.
    share : (K,) ndarray
        Distance travelled since the beginning of the part, as a fraction of the part's length.
    """
    from scipy.integrate import cumulative_trapezoid
    from scipy.interpolate import BPoly

    t = spread(nodes.t, 4)
    pieces = BPoly.from_derivatives(nodes.t, np.swapaxes(nodes.states, 0, 1))
    q = pieces(t)
    qdot = pieces(t, nu=1)
    speed = _tool_speed(task_map, q, qdot)
    if isinstance(task_map, JointSpace):
        speed = np.linalg.norm(qdot, axis=1)
    length = cumulative_trapezoid(speed, t, initial=0)
    if length[-1] < tolerance:
        raise PathError(
            "the tool does not move along a path",
            found=f"{length[-1]:.3g} m",
            where="path",
            hint="With the task space joints, any motion can be imported",
        )
    values = task_map.values(q)
    chosen = _choose_evenly(length)
    share = (
        0.5 * tolerance
    )  # the other half of the tolerance is for s over time and for the path between the points
    allowed = FitTolerance(position=share, orientation=share)
    file = PointFile(file="the recorded motion", tolerance=allowed, corner="refuse")
    points = _points(task_map, values[chosen], chosen)
    try:
        segments = segments_along(points, CsvSegment(csv=file), "path")
    except TaskError as error:
        raise PathError(
            "the motion follows no smooth path within the tolerance",
            found=str(error),
            allowed=f"{tolerance:g} m and rad",
            where="path",
            hint="If the tool stops for fewer than five rows and changes its direction, split the file there. If the "
            "positions are measured, set their noise or raise the tolerance",
        ) from error
    return list(segments), t, values, length / length[-1]


def _tool_speed(task_map: TaskMap, q: np.ndarray, qdot: np.ndarray) -> np.ndarray:
    """Return the speed of the tool's position, (K,); in joint space, it is 0."""
    rates = np.einsum("kmn,kn->km", task_map.jacobian(task_map.twists(q)), qdot)
    return task_map.norms(rates)[0]


def _choose_evenly(length: np.ndarray) -> np.ndarray:
    """Choose about 2000 indices at roughly equal distances, including the first and the last."""
    count = 2000
    end = len(length) - 1
    even = np.searchsorted(length, np.linspace(0.0, length[-1], count)).clip(max=end)
    chosen = np.unique([0, *even, end])
    is_apart = np.diff(length[chosen]) > 1e-3 * length[-1] / count
    return chosen[np.concatenate([[True], is_apart[:-1], [True]])]


def _points(task_map: TaskMap, values: np.ndarray, rows: np.ndarray) -> Points:
    """Turn task coordinates, (K, c), into the points of a path to be fitted."""
    count = len(task_map.axes) if task_map.angles else values.shape[1]
    turning = values[:, count:]
    if len(task_map.angles) > 1:
        from scipy.spatial.transform import Rotation

        rotations = Rotation.from_matrix(turning.reshape(-1, 3, 3))
        turning = with_like_signs(np.roll(rotations.as_quat(), 1, axis=1))
    else:
        turning = np.unwrap(turning, axis=0)
    return Points(values[:, :count], turning, None, rows, "the tool's path", "sample")


DEGREE = 3
"""Degree of the spline of the path coordinate."""


def fit_coordinate(t: np.ndarray, s: np.ndarray, *, is_resting: bool) -> PhaseSpline:
    """Return s over time as the spline of a phase.

    Knots are placed where s bends. The control points do not decrease, so the spline does not decrease either.

    Parameters
    ----------
    t, s : (K,) ndarray
        Times, s, and path coordinates; both are ascending.
    is_resting : bool
        Whether ds/dt vanishes at the ends of the path. At waits, which begin between rows, ds/dt is only close to zero.
    """
    from scipy.interpolate import splrep

    duration = t[-1] - t[0]
    t_norm = (t - t[0]) / duration
    first = 2 if is_resting and s[0] == 0.0 else 1
    last = 2 if is_resting and s[-1] == 1.0 else 1
    for rms in (2e-8, 1e-9, 2e-10):  # allowed difference between the spline and s
        knots, points, _ = splrep(t_norm, s, k=DEGREE, s=len(s) * rms**2)
        points = points[: len(knots) - DEGREE - 1].clip(s[0], s[-1])
        points[:first] = s[0]
        points[-last:] = s[-1]
        points = np.maximum.accumulate(points)[None]
        spline = PhaseSpline(duration, knots, DEGREE, points)
        if np.abs(spline.at(t - t[0])[0][:, 0] - s).max() <= 2e-7:
            break
    return spline


def _deviations(
    recording: Recording, noise: float | Sequence[float] | None
) -> np.ndarray:
    """Return the standard deviation of each joint's positions, (n,), rad or m: as stated, or from the last digit.

    Raises
    ------
    InputError
    """
    if noise is None:
        return recording.rounding / np.sqrt(3.0)
    deviations = numbers(noise, "noise", "rad or m")
    n = recording.q.shape[1]
    if (
        deviations.shape not in ((), (n,))
        or not ((deviations > 0.0) & (deviations < np.inf)).all()
    ):
        raise InputError(
            "the noise is not a valid standard deviation",
            where="noise",
            found=noise,
            allowed=f"one number > 0 rad or m, or {n} of them",
        )
    return np.broadcast_to(deviations, n)


def _task_of(
    settings: Task | None,
    robot: Robot,
    task_map: TaskMap,
    nodes: RecordedNodes,
    segments: Sequence[Segment],
    space: str | Sequence[str],
) -> Task:
    """Make the task that the recorded motion carries out."""
    is_resting, is_calm = nodes.at_rest
    content: dict[str, Any] = {
        "brachis": 1,
        "robot": robot.settings.model_dump(),
        "start": {"joints": nodes.q[0].tolist()},
        "end": {"joints": nodes.q[-1].tolist()},
        "task_space": space,
        "path": [segment.model_dump() for segment in segments],
        "spline": {},
    }
    if settings is not None:
        stated = settings.to_dict()
        copied = (
            "tool_limits",
            "custom_limits",
            "search",
            "solver",
            "refinement",
            "spline",
        )
        content |= {key: stated[key] for key in copied if key in stated}
    content["spline"]["rest"] = "full" if is_calm else "velocity"
    if not is_resting:
        first, last = _tool_speed(task_map, nodes.q[[0, -1]], nodes.qdot[[0, -1]])
        content["boundary"] = {"start_speed": float(first), "end_speed": float(last)}
    return load_task(content)
