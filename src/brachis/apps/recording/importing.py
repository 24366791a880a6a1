"""From a file of joint positions over time to a trajectory like those that are planned.

The path that a motion follows: by forward kinematics, dense samples, and a smooth curve within a tolerance.

The path coordinate over time, as a B-spline that does not decrease.
"""

from __future__ import annotations

import os
import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis import ik
from brachis.apps.recording.nodes import Nodes, nodes_of
from brachis.apps.recording.recording import Recording, Units, read_recording
from brachis.common.arguments import check_keywords, file_name, numbers
from brachis.common.arrays import freeze, with_like_signs
from brachis.common.files import TASK_SUFFIXES, Kind, kind_of
from brachis.errors import InputError, PathError, TaskError
from brachis.path import Path, build_path
from brachis.robot import Robot, TaskMap, bind
from brachis.robot.from_task import robot_for
from brachis.robot.task_map import JOINTS, JointSpace, Pose
from brachis.robots import locate
from brachis.task import (
    CsvSegment,
    FitTolerance,
    PointFile,
    Segment,
    Task,
    load_task,
)
from brachis.task.fitted import segments_along
from brachis.task.points.points import Points
from brachis.trajectory import Recovered, Trajectory
from brachis.trajectory.recovered import LARGEST, check_tolerance

_POINTS = 2000
_SHARE = 0.5
"""Of the tolerance, for the curve; the rest is for the path coordinate over time, and for what lies between points."""
_STEPS = 4


@dataclass(frozen=True, eq=False)
class Followed:
    """A path, and where on it a motion is.

    Attributes
    ----------
    segments : tuple of Segment
        For a task.
    path : Path
    s : (K,) ndarray
        Path coordinate at the times of the motion's postures.
    miss : float
        Largest distance of the postures' tool from the path, m or rad.
    """

    segments: tuple[Segment, ...]
    path: Path
    s: np.ndarray
    miss: float

    def __post_init__(self) -> None:
        """Take copies that nobody can write to."""
        freeze(self, "s")


def recover_path(
    task_map: TaskMap, q: np.ndarray, qdot: np.ndarray, t: np.ndarray, tolerance: float
) -> Followed:
    """Recover the path that a motion prescribes in a task space.

    Parameters
    ----------
    task_map : TaskMap
    q, qdot : (K, n) ndarray
        The motion, densely.
    t : (K,) ndarray
        s.
    tolerance : float
        m and rad.

    Raises
    ------
    PathError
        The tool does not move, or follows no smooth path within the tolerance: it stops and turns off, for example.
    """
    speed = _speed(task_map, q, qdot)
    length = np.concatenate(
        [[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))]
    )
    if length[-1] < tolerance:
        hint = "A task space of joints takes any motion"
        raise PathError(
            "the tool does not move along a path",
            found=f"{length[-1]:.3g} m",
            where="path",
            hint=hint,
        )
    values = task_map.values(q)
    chosen = _evenly(length)
    try:
        segments = segments_along(
            _points(task_map, values[chosen], chosen), _wanted(tolerance), "path"
        )
    except TaskError as error:
        raise PathError(
            "the motion follows no smooth path within the tolerance",
            found=str(error),
            allowed=f"{tolerance:g} m and rad",
            where="path",
            hint="Where the tool stops and turns off, divide the file there; where positions are measured, say their "
            "noise, or raise the tolerance",
        ) from error
    path = build_path(segments, values[0], task_map.rows)
    s = _nearest(task_map, path, values, length / length[-1])
    miss = np.max(task_map.norms(task_map.difference(values, path.sample(s).target)))
    return Followed(tuple(segments), path, s, float(miss))


def _speed(task_map: TaskMap, q: np.ndarray, qdot: np.ndarray) -> np.ndarray:
    """Return the speed of what the path's length is made of, (K,): the position, or all joints."""
    if isinstance(task_map, JointSpace):
        return np.asarray(np.linalg.norm(qdot, axis=1))
    rates = np.einsum("kmn,kn->km", task_map.jacobian(task_map.twists(q)), qdot)
    return task_map.norms(rates)[0]


def _evenly(length: np.ndarray) -> np.ndarray:
    """Choose indices at about equal distances, the first and the last one among them."""
    places = np.searchsorted(length, np.linspace(0.0, length[-1], _POINTS)).clip(
        max=len(length) - 1
    )
    chosen = np.unique(np.concatenate([[0], places, [len(length) - 1]]))
    apart = np.diff(length[chosen]) > 1e-3 * length[-1] / _POINTS
    return chosen[np.concatenate([[True], apart[:-1], [True]])]


def _points(task_map: TaskMap, values: np.ndarray, chosen: np.ndarray) -> Points:
    """Make points of task coordinates, (K, c)."""
    turning = values[:, len(task_map.axes) or values.shape[1] :]
    if isinstance(task_map, Pose):
        from scipy.spatial.transform import Rotation

        rotations = Rotation.from_matrix(turning.reshape(-1, 3, 3))
        turning = with_like_signs(np.roll(rotations.as_quat(), 1, axis=1))
    else:
        turning = np.unwrap(turning, axis=0)
    position = values[:, : len(task_map.axes) or values.shape[1]]
    return Points(position, turning, None, chosen, "the tool's path", "sample")


def _wanted(tolerance: float) -> CsvSegment:
    share = _SHARE * tolerance
    allowed = FitTolerance(position=share, orientation=share)
    file = PointFile(file="the recorded motion", tolerance=allowed, corner="refuse")
    return CsvSegment(csv=file)


def _nearest(
    task_map: TaskMap, path: Path, values: np.ndarray, s: np.ndarray
) -> np.ndarray:
    """Return the path coordinates nearest to task coordinates, (K, c), from first guesses on; ascending."""
    s = s.copy()
    for _ in range(_STEPS):
        sample = path.sample(s)
        miss = task_map.difference(values, sample.target)
        s += np.sum(miss * sample.xi, axis=1) / np.sum(sample.xi**2, axis=1)
        np.clip(s, 0.0, 1.0, out=s)
    s[[0, -1]] = 0.0, 1.0
    return np.asarray(np.maximum.accumulate(s))


DEGREE = 3
_OFF = 2e-8
"""Root mean square of what the spline may differ from the path coordinates, as a part of the path."""


def coordinate_spline(
    t: np.ndarray, s: np.ndarray, *, at_rest: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return knots over [0, 1] and control points of s over normalised time.

    Its knots lie where s bends. Control points that do not decrease make a spline that does not.

    Parameters
    ----------
    t, s : (K,) ndarray
        Ascending; s from 0 to 1.
    at_rest : bool
        Whether ds/dt vanishes at both ends.
    """
    from scipy.interpolate import splrep

    knots, control_points, _ = splrep(t / t[-1], s, k=DEGREE, s=len(s) * _OFF**2)
    control_points = control_points[: len(knots) - DEGREE - 1].clip(0.0, 1.0)
    control_points[[0, -1]] = 0.0, 1.0
    if at_rest:
        control_points[[1, -2]] = 0.0, 1.0
    return knots, np.maximum.accumulate(control_points)


_TOLERANCE, _DIGITS = 1e-6, 3.0
"""Of a recovered path, m and rad; and how many standard deviations measured positions are off at most."""
_BETWEEN = 4
"""Places at which every piece of the motion is looked at."""


@check_keywords
def import_motion(
    path: str | os.PathLike[str],
    robot: str | os.PathLike[str] | Robot | Task | None = None,
    *,
    task: str | os.PathLike[str] | Mapping[str, object] | Task | None = None,
    task_space: str | Sequence[str] | None = None,
    units: Mapping[str, str] | None = None,
    tolerance: float | None = None,
    noise: float | Sequence[float] | None = None,
) -> Trajectory:
    """Make a trajectory of a motion that runs today, to verify, draw, compare and export it.

    Its velocities and accelerations, where the file has none, are those of polynomials through its positions; the path
    of the tool follows by forward kinematics, as a smooth curve within a tolerance. What was found out, and what is not
    known, is in ``trajectory.recovered.told``.

    Parameters
    ----------
    path : path
        CSV file whose first line names its columns: time (``t``, ``time_ms``, ...), the joints' positions (``j1``,
        ``q_j1``, ``j1_pos [deg]``, ...) and, if known, velocities (``qd_j1``, ``j1_vel``, ...). Other columns are
        left out.
    robot : path, Robot or Task, optional
        URDF file, name of a robot, or robot; or a task file, as if it were `task`. Needed unless the task names one.
    task : path, mapping or Task, optional
        A task whose robot, limits and settings hold; its start and path do not count.
    task_space : str or sequence of str, optional
        What of the motion is its path: rows, ``pose``, ``pose_free_roll``, ``joints``. The task's unless given, else
        the most that the robot can prescribe.
    units : mapping, optional
        ``{"angle": "deg", "length": "mm", "time": "ms"}`` for columns whose header states none; rad, m and s otherwise.
    tolerance : float, optional
        Of the path, m and rad: 1e-6 unless given, or what the file's last digits, or the noise, leave open of it.
    noise : float or (n,) array_like, optional
        Standard deviation of measured positions, rad or m, which are then smoothed; that of the file's digits unless
        given.

    Returns
    -------
    Trajectory

    Raises
    ------
    TaskError
        The file is not understood; the message names line and column.
    PathError
        The tool follows no smooth path within the tolerance.
    InputError
        Robot, task or task space are wrong.

    Examples
    --------
    >>> import tempfile
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     brachis.export.write(result.trajectory, f"{folder}/today.csv", dt=0.004)
    ...     today = brachis.import_motion(f"{folder}/today.csv", brachis.robots.scara3, task_space=["x", "y"])
    >>> today.recovered.tolerance, round(today.t_end - result.t_end, 9)
    (1e-06, 0.0)
    """
    path = file_name(path, "path")
    if tolerance is not None:
        tolerance = check_tolerance(tolerance)
    if task is None and _is_task(robot):
        robot, task = None, robot
    settings = None if task is None else load_task(task)
    if robot is None and (settings is None or settings.robot.urdf is None):
        allowed = (
            "a URDF file, the name of a robot (brachis.robots), a Robot, or a task file"
        )
        raise InputError("the robot is missing", where="robot", allowed=allowed)
    made = robot_for(locate(robot), (settings or load_task(_BLANK)).robot)  # type: ignore[arg-type]
    space = task_space or (
        settings.task_space if settings else ik.default_task_space(made)
    )
    recording = read_recording(path, made, _units(units))
    bound, task_map = bind(made, space)
    rolling = bound.n - made.n
    deviation = _deviation(recording, noise)
    nodes = _with_roll(nodes_of(recording, deviation), bound.n)
    t, q, qdot = _densely(nodes)
    if tolerance is None:
        moved = (
            np.abs(task_map.jacobian(task_map.twists(nodes.q)))[:, :, : len(deviation)]
            @ deviation
        )
        tolerance = float(np.clip(_DIGITS * moved.max(), _TOLERANCE, LARGEST))
    followed = recover_path(task_map, q, qdot, t, tolerance)
    if followed.miss > tolerance:
        found, allowed = f"{followed.miss:.3g} m or rad off", f"{tolerance:.3g}"
        hint = "Raise the tolerance"
        raise PathError(
            "the recovered path misses the motion",
            found=found,
            allowed=allowed,
            where="path",
            hint=hint,
        )
    error = recording.rounding if noise is None else _DIGITS * deviation
    recovered = Recovered(
        recording.source,
        tolerance,
        _told(recording, nodes, followed, tolerance),
        np.column_stack(
            [recording.t, recording.q, np.zeros((len(recording.t), rolling))]
        ),
        np.append(error, np.zeros(rolling)),
    )
    wanted = _task_of(settings, bound, task_map, nodes, followed, space)
    return _trajectory(
        wanted,
        bound,
        nodes,
        coordinate_spline(t, followed.s, at_rest=nodes.at_rest[0]),
        recovered,
    )


_BLANK: dict[str, Any] = {
    "brachis": 1,
    "start": {"joints": [0.0]},
    "task_space": ["x"],
    "path": [{"line": {"by": [1.0]}}],
}
"""A task that only stands for the defaults of all settings."""


def _is_task(given: object) -> bool:
    """Tell a task, or its file, from a robot."""
    return isinstance(given, Task | Mapping) or (
        isinstance(given, str | os.PathLike)
        and (
            kind_of(given) is Kind.TASK
            or pathlib.Path(given).suffix.lower() in TASK_SUFFIXES
        )
    )


def _units(given: Mapping[str, str] | None) -> Units:
    """Read units by the quantities that have them.

    Raises
    ------
    InputError
    """
    if given is not None and not isinstance(given, Mapping):
        allowed = '{"angle": "deg", "length": "mm", "time": "ms"}, or some of them'
        raise InputError(
            "wrong type", where="units", found=repr(given), allowed=allowed
        )
    return check_keywords(Units, "units")(**dict(given or {}))


def _deviation(
    recording: Recording, noise: float | Sequence[float] | None
) -> np.ndarray:
    """Return the standard deviation of every joint's positions, (n,), rad or m: as it is said, else of the digits.

    Raises
    ------
    InputError
    """
    if noise is None:
        return recording.rounding / np.sqrt(3.0)
    given = numbers(noise, "noise", "rad or m")
    n = recording.q.shape[1]
    if given.shape not in ((), (n,)) or not ((given > 0.0) & (given < np.inf)).all():
        allowed = f"> 0 rad or m, one figure or {n}"
        raise InputError(
            "is no standard deviation", where="noise", found=noise, allowed=allowed
        )
    return np.broadcast_to(given, n)


def _with_roll(nodes: Nodes, n: int) -> Nodes:
    """Add the virtual joint of a freely rolling tool, which stands still."""
    still = np.zeros((len(nodes.t), n - nodes.q.shape[1]))
    q, qdot, qddot = (
        np.hstack([part, still]) for part in (nodes.q, nodes.qdot, nodes.qddot)
    )
    return Nodes(nodes.t, q, qdot, qddot, nodes.told)


def _densely(nodes: Nodes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, positions and velocities at the nodes and between."""
    from scipy.interpolate import BPoly

    steps = np.arange(_BETWEEN) / _BETWEEN
    t = np.append(
        (nodes.t[:-1, None] + np.diff(nodes.t)[:, None] * steps).ravel(), nodes.t[-1]
    )
    pieces = BPoly.from_derivatives(
        nodes.t, np.stack([nodes.q, nodes.qdot, nodes.qddot], axis=1)
    )
    return t, pieces(t), pieces(t, nu=1)


def _told(
    recording: Recording, nodes: Nodes, followed: Followed, tolerance: float
) -> tuple[str, ...]:
    h = 1e3 * float(np.median(np.diff(recording.t)))
    return (
        f"{len(recording.t)} rows over {recording.t[-1]:.6g} s, one every {h:.4g} ms",
        *recording.told,
        *nodes.told,
        "not known: what the motion does between the rows, and the torques that were measured",
        f"the tool's path follows by forward kinematics; the curve is at most {followed.miss:.1e} m or rad off",
        f"its tolerance is {tolerance:.1e} m and rad",
    )


def _task_of(
    settings: Task | None,
    robot: Robot,
    task_map: TaskMap,
    nodes: Nodes,
    followed: Followed,
    space: str | Sequence[str],
) -> Task:
    """Write down the task that the motion fulfils."""
    resting, calm = nodes.at_rest
    jacobian = task_map.jacobian(task_map.twists(nodes.q[[0, -1]]))
    speeds = task_map.norms(np.einsum("kmn,kn->km", jacobian, nodes.qdot[[0, -1]]))[
        0
    ].tolist()
    given: dict[str, Any] = {} if settings is None else settings.to_dict()
    kept = ("tool_limits", "custom_limits", "search", "solver", "refinement")
    content: dict[str, Any] = {
        **{key: given[key] for key in kept if key in given},
        "brachis": 1,
        "robot": robot.settings.model_dump(),
        "start": {"joints": nodes.q[0].tolist()},
        "end": {"joints": nodes.q[-1].tolist()},
        "task_space": space,
        "path": [segment.model_dump() for segment in followed.segments],
        "boundary": {}
        if resting
        else {"start_speed": speeds[0], "end_speed": speeds[1]},
        "spline": {**given.get("spline", {}), "rest": "full" if calm else "velocity"},
    }
    return load_task(content)


def _trajectory(
    task: Task,
    robot: Robot,
    nodes: Nodes,
    spline: tuple[np.ndarray, np.ndarray],
    recovered: Recovered,
) -> Trajectory:
    knots, control_points = spline
    return Trajectory(
        task=task,
        urdf=robot.urdf,
        robot=robot,
        redundant_joints=(),
        branch="",
        times=nodes.t,
        q=nodes.q,
        qdot=nodes.qdot,
        qddot=nodes.qddot,
        qddot_before=nodes.qddot,
        knots=knots,
        degree=DEGREE,
        control_points=control_points[None],
        chart_rows=np.empty((0, 0, 0)),
        chart_knots=np.empty(0),
        recovered=recovered,
    )


def joint_path_of(trajectory: Trajectory) -> tuple[Segment, ...]:
    """Return the path of all joints that an imported motion follows, for a task in their space.

    Raises
    ------
    PathError
        The joints follow no smooth path within the tolerance.
    """
    assert trajectory.recovered is not None
    _, task_map = bind(trajectory.robot, JOINTS)
    nodes = Nodes(trajectory.times, trajectory.q, trajectory.qdot, trajectory.qddot, ())
    t, q, qdot = _densely(nodes)
    return recover_path(task_map, q, qdot, t, trajectory.recovered.tolerance).segments
