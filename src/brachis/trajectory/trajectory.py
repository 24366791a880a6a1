"""Joint motion along a path, evaluated at any time; also as an argument: a trajectory, what has one, or its file."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, wraps
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Concatenate, ParamSpec, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from brachis.common import tolerances
from brachis.common.arguments import number, numbers
from brachis.common.arrays import freeze
from brachis.common.files import file_name
from brachis.common.summary import Summary
from brachis.common.words import write_apart, write_count
from brachis.errors import InputError, UnknownNameError
from brachis.kernel import Spline
from brachis.robot import Robot, dynamics
from brachis.task import Task
from brachis.trajectory.phases import MotionPhase, PhaseSpline, find_phase_knots
from brachis.trajectory.pieces import Pieces, piece_coefficients
from brachis.trajectory.recovered import Recovered
from brachis.trajectory.result_file import ARRAYS, read_result, write_result
from brachis.trajectory.samples import Samples, tool_motion
from brachis.trajectory.sensitivities import Sensitivities

if TYPE_CHECKING:
    import pandas as pd


CONTINUOUS_TORQUE = 3
"""Least B-spline degree that gives continuous acceleration, and so torque."""


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Summary):
    """Joint motion along a path.

    Joint positions are quintic polynomials between nodes, which meet the closed form to 1e-11 rad or m and join with
    continuous position, velocity and (from degree 3 on) acceleration. The path coordinate and the redundant joints are
    also kept as the B-splines that the optimiser found; in a chart, its measure sigma of self-motion in their place.

    Attributes
    ----------
    task : Task
    urdf : str
        Text of the URDF at planning time.
    robot : Robot
    redundant_joints : tuple of str
    branch : str
        Label of the closed form's branch.
    times : (L + 1,) ndarray
        Nodes, from 0 to t_end, s.
    q, qdot, qddot : (L + 1, n) ndarray
        Joint motion at the nodes.
    qddot_before : (L + 1, n) ndarray
        Acceleration just before the nodes; differs from `qddot` at knots of splines of degree 2.
    knots : ndarray
        B-spline knots in normalised time, N + 2 d + 1 of one phase; those where phases meet d + 1 times.
    degree : int
        B-spline degree d.
    control_points : (1 + r, N + d) ndarray
        Of s (dimensionless), then of each redundant joint (rad or m) in chain order, or of the chart's sigma.
    phase_ends : (P,) ndarray
        Times at which the phases end, ascending, s; the last one is t_end. Most motions have one phase.
    chart_rows : (B, r, n + 1) ndarray
        Coefficients of the chart in which the motion was planned, see `brachis.kinematics.ChartRows`; B = 0 where a
        closed form took its place.
    chart_knots : ndarray
        Knots of its splines; none where the rows are constant (B = 1).
    recovered : Recovered or None
        Where the motion comes from, if it was not planned; its path is then known to a tolerance.
    own_limits : tuple of str
        Names of limits of the user's own that were no part of the task. The limits themselves are not saved.
    sensitivities : Sensitivities or None
        What limits, speeds and stops cost, where that is known from the plan.

    Examples
    --------
    >>> import brachis
    >>> result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], effort="single", intervals=8)
    >>> trajectory = result.trajectory
    >>> trajectory.position(0.1).shape, trajectory.torque([0.1, 0.2]).shape
    ((3,), (2, 3))
    """

    task: Task
    urdf: str
    robot: Robot
    redundant_joints: tuple[str, ...]
    branch: str
    times: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    qddot_before: np.ndarray
    knots: np.ndarray
    degree: int
    control_points: np.ndarray
    phase_ends: np.ndarray
    chart_rows: np.ndarray
    chart_knots: np.ndarray
    recovered: Recovered | None = None
    own_limits: tuple[str, ...] = ()
    sensitivities: Sensitivities | None = None

    def __post_init__(self) -> None:
        """Make the arrays read-only copies."""
        freeze(self, *ARRAYS)

    @property
    def t_end(self) -> float:
        """End time, s."""
        return float(self.times[-1])

    @property
    def node_accelerations(self) -> np.ndarray:
        """Accelerations on both sides of all nodes, (2 L + 2, n), rad/s^2 or m/s^2."""
        return np.concatenate([self.qddot_before, self.qddot])

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints in chain order."""
        return self.robot.joint_names

    @property
    def redundancy(self) -> str:
        """Redundant joints, or what stands for them in a chart, in words."""
        count = len(self.control_points) - 1
        if self.redundant_joints or not (count and self.chart_rows.size):
            return ", ".join(self.redundant_joints) or "none"
        coordinates = write_count(count, "coordinate")
        return f"none chosen; the self-motion of all joints has {coordinates} (a chart)"

    @cached_property
    def pieces(self) -> Pieces:
        """Joint positions less those of the node before; see `position`."""
        return self._polynomials[0]

    @cached_property
    def jerk_pieces(self) -> Pieces:
        """Joint jerks: the third derivative of `pieces`, to rounding."""
        return self._polynomials[1]

    @cached_property
    def _polynomials(self) -> tuple[Pieces, Pieces]:
        nodes = (self.times, self.q, self.qdot, self.qddot, self.qddot_before)
        positions, jerks = piece_coefficients(*nodes)
        return Pieces(positions, self.times), Pieces(jerks, self.times)

    @cached_property
    def path_spline(self) -> Spline:
        """s(t), over time in seconds."""
        return self._spline(self.control_points[0])

    @cached_property
    def redundant_spline(self) -> Spline:
        """Positions of the r redundant joints, or sigma of the chart, over time in seconds."""
        return self._spline(self.control_points[1:].T)

    def _spline(self, control_points: np.ndarray) -> Spline:
        """Put control points on knots in s; those where phases meet are exactly the ends of the phases."""
        times = self.knots * self.phase_ends[-1]
        first = find_phase_knots(self.knots, self.degree)[1:]
        times[first[:, None] + np.arange(self.degree + 1)] = self.phase_ends[:, None]
        return Spline(times, control_points, self.degree)

    @cached_property
    def phase_splines(self) -> tuple[PhaseSpline, ...]:
        """Curves of each phase: s, then the redundant joints or sigma. `join_splines` undone, to rounding."""
        outer = self.degree + 1
        numbers = find_phase_knots(self.knots, self.degree)
        ends = np.append(0.0, self.phase_ends)
        splines = []
        for (begin, end), (first, last) in zip(
            pairwise(ends), pairwise(numbers), strict=True
        ):
            times = self.knots[first : last + outer] * ends[-1]
            knots = (times - begin) / (end - begin)
            knots[:outer] = 0.0
            knots[-outer:] = 1.0
            points = self.control_points[:, first:last]
            splines.append(PhaseSpline(end - begin, knots, self.degree, points))
        return tuple(splines)

    @cached_property
    def phases(self) -> tuple[MotionPhase, ...]:
        """What each phase is: its times, its part of the path, and its given speed."""
        ends = [0.0, *self.phase_ends.tolist()]
        speeds = self.task.tool_limits.process_speed
        phases = []
        times = pairwise(ends)
        for (begin, end), spline in zip(times, self.phase_splines, strict=True):
            s_begin, s_end = spline.control_points[0, [0, -1]].tolist()
            is_dwell = s_begin == s_end
            # The phases of a recorded motion are between its stops, and longer than the parts.
            s = (s_begin, s_end)
            matching = (
                (section.speed, is_dwell, section.lead_length)
                for section in speeds
                if not is_dwell and np.allclose(s, section.s, 0.0, 1e-9)
            )
            kind = next(matching, (None, is_dwell))
            phases.append(MotionPhase(begin, end, *s, *kind))
        return tuple(phases)

    def path_coordinate(self, t: ArrayLike) -> np.ndarray:
        """Path coordinate s at times `t`, same shape."""
        times = self._check_times(t)
        end = self.control_points[0, -1]  # without the spline's rounding
        return np.where(times == self.t_end, end, self.path_spline(times))

    def position(self, t: ArrayLike) -> np.ndarray:
        """Joint positions at times `t`: (n,) for a number, (K, n) for (K,); rad or m.

        Raises
        ------
        InputError
            A time lies outside [0, t_end].
        """
        times = self._check_times(t)
        node = np.searchsorted(self.times[1:-1], times, side="right")
        return self.q[node] + self.pieces(times)

    def velocity(self, t: ArrayLike) -> np.ndarray:
        """Joint velocities, as `position`; rad/s or m/s."""
        return self.pieces(self._check_times(t), nu=1)

    def acceleration(self, t: ArrayLike) -> np.ndarray:
        """Joint accelerations, as `position`; rad/s^2 or m/s^2."""
        return self.pieces(self._check_times(t), nu=2)

    def jerk(self, t: ArrayLike) -> np.ndarray:
        """Joint jerks, as `position`; rad/s^3 or m/s^3. At a node the value behind it."""
        return self.jerk_pieces(self._check_times(t))

    def torque(self, t: ArrayLike) -> np.ndarray:
        """Joint torques, as `position`; Nm or N. Raises UrdfError if the URDF has no masses."""
        motion = self.at(t)
        tau = dynamics.torque(self.robot, motion.q, motion.qdot, motion.qddot)
        return tau if np.ndim(t) else tau[0]

    def at(self, t: ArrayLike) -> Samples:
        """All quantities at times `t`, (K,), s; of a number K = 1."""
        times = np.atleast_1d(numbers(t, "t", "s"))
        return self._samples(times, self._check_times(times))

    def _samples(
        self, t: np.ndarray, within: np.ndarray, *, stops: bool = False
    ) -> Samples:
        """Evaluate the motion at times within it, to be shown at times t; with `stops` the last posture is at rest."""
        q = self.position(within)
        qdot = self.velocity(within)
        qddot = self.acceleration(within)
        if stops:
            qdot[-1] = 0.0
            qddot[-1] = 0.0
        robot = self.robot
        tau = dynamics.torque(robot, q, qdot, qddot) if robot.has_masses else None
        tool = tool_motion(self.robot, q, qdot)
        return Samples(t, self.path_coordinate(within), q, qdot, qddot, tau, *tool)

    def sample(self, dt: float, *, last: str = "exact") -> Samples:
        """Sample at a controller's rate.

        Parameters
        ----------
        dt : float
            Period, s.
        last : {"exact", "hold"}, optional
            What follows the last multiple of `dt` before t_end. ``exact``: one sample at t_end itself, so that the last
            period may be shorter. ``hold``: one at the next multiple of `dt`, at or after t_end, where the end posture
            is held at rest: velocity and acceleration are zero, and the torque is what holds the posture.

        Returns
        -------
        Samples
            At 0, dt, 2 dt, ... and the last one.

        Raises
        ------
        InputError
            `dt` is not positive, or so small that there would be more than ten million samples; or a motion that does
            not end at rest is to be held.
        UnknownNameError
            `last` is neither.
        """
        if last not in ("exact", "hold"):
            raise UnknownNameError("ending", last, ("exact", "hold"), where="last")
        dt = number(dt, "dt", "s")
        if not (0.0 < dt < np.inf and self.t_end / dt < 1e7):
            raise InputError(
                "the period is out of range",
                where="dt",
                found=f"{dt} s",
                allowed="> 0 s, at most 1e7 samples",
            )
        boundary = self.task.boundary
        if last == "hold" and (boundary.periodic or boundary.end_speed):
            raise InputError(
                "a motion that does not end at rest cannot be held",
                where="last",
                allowed="exact",
            )
        periods = int(np.ceil(self.t_end / dt * (1.0 - tolerances.ROUNDING)))
        t = np.arange(periods + 1.0) * dt
        if last == "exact":
            t[-1] = self.t_end
            return self.at(t)
        return self._samples(t, np.minimum(t, self.t_end), stops=True)

    def to_dataframe(self, dt: float) -> pd.DataFrame:
        """Return a pandas table, a row every `dt` seconds; see `sample`.

        Columns: ``t`` (s), ``s``; for every joint ``q_<joint>`` (rad or m), ``qd_``, ``qdd_`` and ``tau_`` (Nm or N, if
        known); ``tool_x``, ``tool_y``, ``tool_z`` (m), ``tool_qw``, ..., ``tool_qz`` and ``tool_speed`` (m/s). Needs
        the extra ``pandas``.

        Raises
        ------
        InputError
            `dt` is not a usable period; or, as `NotInstalledError`, pandas is not installed.
        """
        return self.sample(dt).to_dataframe(self.joint_names)

    def summary(self) -> Mapping[str, object]:
        """Return what is shown."""
        source = Path(self.robot.source)
        intervals = write_count(len(np.unique(self.knots)) - 1, "interval")
        return {
            "end time": f"{self.t_end:.4f} s",
            "robot": Path(*source.parts[-2:]).as_posix(),
            "joints": ", ".join(self.joint_names),
            "redundant joints": self.redundancy,
            **({} if len(self.chart_rows) else {"branch": self.branch or "none"}),
            "start posture": self.robot.in_words(self.q[0]),
            "end posture": self.robot.in_words(self.q[-1]),
            **({"recovered from": self.recovered.source} if self.recovered else {}),
            "splines": f"degree {self.degree}, {intervals}",
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one npz file with all that is needed to load and verify the trajectory.

        The file is written under a temporary name and renamed, so that a broken write leaves nothing behind. An older
        result of this name is replaced.

        Raises
        ------
        InputError
            The suffix is another than npz, the folder does not exist or cannot be written, or the file exists and is
            not a result.
        """
        meta = {
            "task": self.task.to_dict(),
            "urdf": self.urdf,
            "redundant_joints": self.redundant_joints,
            "branch": self.branch,
            "degree": self.degree,
            "joint_names": self.joint_names,
            "recovered": self.recovered and self.recovered.to_file(),
            "own_limits": self.own_limits,
            "sensitivities": self.sensitivities and self.sensitivities.to_file(),
        }
        write_result(path, meta, {name: getattr(self, name) for name in ARRAYS})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Read a file that `save` wrote.

        Raises
        ------
        ResultFileError
            The file is missing, broken or of another schema version, or its parts do not fit each other.
        """
        return cls(**read_result(file_name(path, "path")))

    def _check_times(self, t: ArrayLike) -> np.ndarray:
        """Refuse times outside the trajectory; rounding at the ends is forgiven."""
        times = numbers(t, "t", "s")
        if times.ndim > 1:
            raise InputError(
                "the times have the wrong shape",
                found=times.shape,
                allowed="a number, or a list or an array of numbers, (K,)",
            )
        inside = np.clip(times, 0.0, self.t_end)
        if not np.all(np.abs(times - inside) <= 1e-9 * self.t_end):
            last, t_end = write_apart(times.max(), self.t_end, digits=6)
            raise InputError(
                "the time is outside the trajectory",
                found=f"{times.min():g} s to {last} s",
                allowed=f"0 s to {t_end} s",
            )
        return inside


_P = ParamSpec("_P")
_R = TypeVar("_R")


class HasMotion(Protocol):
    """A result of a plan."""

    @property
    def trajectory(self) -> Trajectory:
        """Return the motion."""


MotionSource = Trajectory | HasMotion | str | os.PathLike[str]


def motion_of(source: MotionSource, where: str = "trajectory") -> Trajectory:
    """Return the trajectory that is given, as the argument `where` of a public function.

    Raises
    ------
    ResultFileError
        A file is not that of a motion.
    InputError
        It is something else.
    """
    if isinstance(source, Trajectory):
        return source
    if isinstance(source, str | os.PathLike):
        return Trajectory.load(source)
    motion = getattr(source, "trajectory", None)
    if not isinstance(motion, Trajectory):
        raise InputError(
            "this is not a motion",
            where=where,
            found=type(source).__name__,
            allowed="a Trajectory, a Result, or the npz file of one",
        )
    return motion


def of_motion(
    function: Callable[Concatenate[Trajectory, _P], _R],
) -> Callable[Concatenate[MotionSource, _P], _R]:
    """Let a function of a trajectory take all that `motion_of` does."""

    @wraps(function)
    def taking(trajectory: MotionSource, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        """Call the function with the trajectory of what is given."""
        return function(motion_of(trajectory), *args, **kwargs)

    return taking  # type: ignore[return-value]  # mypy fears a second `trajectory` among the keywords
