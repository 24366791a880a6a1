"""Joint motion along a path, evaluated at any time; and how to obtain a trajectory from a result or a file."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

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
from brachis.robot import Robot
from brachis.robot.task_map.choice import FREE
from brachis.task import Task
from brachis.trajectory.phases import MotionPhase, PhaseSpline, find_phase_knots
from brachis.trajectory.pieces import Pieces, piece_coefficients
from brachis.trajectory.program import (
    Event,
    MotionPart,
    summarise_program,
    torques_of,
)
from brachis.trajectory.recovered import Recovered
from brachis.trajectory.result_file import ARRAYS, read_result, write_result
from brachis.trajectory.samples import Samples, tool_motion
from brachis.trajectory.sensitivities import Sensitivities

if TYPE_CHECKING:
    import pandas as pd


CONTINUOUS_TORQUE = 3
"""Minimum B-spline degree for continuous acceleration, and hence for continuous torque."""


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Summary):
    """Joint motion along a path.

    Joint positions are quintic polynomials between nodes. These polynomials agree with the closed form to within 1e-11
    rad or m. Where the polynomials join, the position, the velocity and (from degree 3 on) the acceleration are
    continuous. The path coordinate and the redundant joints are also stored as the B-splines that the optimiser found.
    If the motion was planned in a chart, the chart's coordinates sigma of the self-motion take the place of the
    redundant joints.

    Attributes
    ----------
    task : Task
    urdf : str
        Text of the URDF at the time of planning.
    robot : Robot
    redundant_joints : tuple of str
    branch : str
        Label of the branch of the closed form.
    times : (L + 1,) ndarray
        Times of the nodes, from 0 to t_end, s.
    q, qdot, qddot : (L + 1, n) ndarray
        Joint positions, velocities and accelerations at the nodes.
    qddot_before : (L + 1, n) ndarray
        Acceleration just before the nodes. It differs from `qddot` at knots of splines of degree 2.
    knots : ndarray
        B-spline knots in normalised time; N + 2 d + 1 for a single phase. A knot where phases meet occurs d + 1 times.
    degree : int
        Degree d of the B-splines.
    control_points : (1 + r, N + d) ndarray
        Control points of s (dimensionless), then of each redundant joint (rad or m) in chain order or of the chart's
        coordinates sigma.
    phase_ends : (P,) ndarray
        Ascending times at which the phases end, s. The last one is t_end. Most motions have only one phase.
    chart_rows : (B, r, n + 1) ndarray
        Coefficients of the chart in which the motion was planned, see `brachis.kinematics.ChartRows`. B = 0 if a closed
        form was used instead.
    chart_knots : ndarray
        Knots of the chart's splines; empty if the rows are constant (B = 1).
    recovered : Recovered or None
        Origin of the motion if it was not planned here; its path is then known only to within a tolerance.
    own_limits : tuple of str
        Names of the user's own limits that were not part of the task. The limits themselves are not saved.
    sensitivities : Sensitivities or None
        The time that limits, speeds and stops cost; None if it is unknown.
    parts : tuple of MotionPart
        The parts of a program; empty for a single path or move.
    events : tuple of Event
        The events of a program, in the order of their times.
    components : tuple of (float, Trajectory)
        The motions that make up the motion of a program, each with its own task and the time at which it begins, s.

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
    parts: tuple[MotionPart, ...] = ()
    events: tuple[Event, ...] = ()
    components: tuple[tuple[float, Trajectory], ...] = ()

    def __post_init__(self) -> None:
        """Make the arrays read-only copies."""
        freeze(self, *ARRAYS)

    @property
    def t_end(self) -> float:
        """End time of the motion, s."""
        return float(self.times[-1])

    @property
    def node_accelerations(self) -> np.ndarray:
        """Accelerations just before and just after all nodes, (2 L + 2, n), rad/s^2 or m/s^2."""
        return np.concatenate([self.qddot_before, self.qddot])

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in chain order."""
        return self.robot.joint_names

    @property
    def redundancy(self) -> str:
        """The redundant joints in words or, for a chart, the number of its coordinates of the self-motion."""
        if self.components:
            paths = (
                part for _, part in self.components if part.task.task_space != FREE
            )
            names = dict.fromkeys(path.redundancy for path in paths)
            return "; ".join(names) or "none"
        if self.redundant_joints or not self.chart_rows.size:
            return ", ".join(self.redundant_joints) or "none"
        return (
            "none chosen; the self-motion of all joints has "
            f"{write_count(self.chart_rows.shape[1], 'coordinate')} (a chart)"
        )

    @cached_property
    def pieces(self) -> Pieces:
        """Joint positions relative to the previous node; see `position`."""
        return self._polynomials[0]

    @cached_property
    def jerk_pieces(self) -> Pieces:
        """Joint jerks, which are the third derivative of `pieces` except for rounding."""
        return self._polynomials[1]

    @cached_property
    def _polynomials(self) -> tuple[Pieces, Pieces]:
        nodes = (self.times, self.q, self.qdot, self.qddot, self.qddot_before)
        positions, jerks = piece_coefficients(*nodes)
        return Pieces(positions, self.times), Pieces(jerks, self.times)

    @cached_property
    def path_spline(self) -> Spline:
        """The path coordinate s(t), over time in seconds."""
        return self._spline(self.control_points[0])

    @cached_property
    def redundant_spline(self) -> Spline:
        """Positions of the r redundant joints, or the chart's sigma, over time in seconds."""
        return self._spline(self.control_points[1:].T)

    def _spline(self, control_points: np.ndarray) -> Spline:
        """Make a spline over time in seconds. Knots where phases meet are exactly at the ends of the phases."""
        times = self.knots * self.phase_ends[-1]
        first = find_phase_knots(self.knots, self.degree)[1:]
        times[first[:, None] + np.arange(self.degree + 1)] = self.phase_ends[:, None]
        return Spline(times, control_points, self.degree)

    @cached_property
    def phase_splines(self) -> tuple[PhaseSpline, ...]:
        """Curves of each phase: s, then the redundant joints or sigma.

        These are the curves before `join_splines`, except for rounding.
        """
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
        """The phases of the motion, each with its times, its part of the path, and the given speed, if any."""
        ends = [0.0, *self.phase_ends.tolist()]
        speeds = self.task.tool_limits.process_speed
        phases = []
        times = pairwise(ends)
        for (begin, end), spline in zip(times, self.phase_splines, strict=True):
            s_begin, s_end = spline.control_points[0, [0, -1]].tolist()
            is_dwell = s_begin == s_end
            # The phases of a recorded motion are those between its stops, and are longer than the parts with a given
            # speed.
            s = (s_begin, s_end)
            matching = (
                (section.speed, is_dwell, section.lead_length)
                for section in speeds
                if np.allclose(s, section.s, 0.0, 1e-9)
            )
            kind = next(matching, (None, is_dwell))
            phases.append(MotionPhase(begin, end, *s, *kind))
        if self.components:
            phases = [self._with_given_speed(phase) for phase in phases]
        return tuple(phases)

    def _with_given_speed(self, phase: MotionPhase) -> MotionPhase:
        """Return a phase of a program with the speed that is given in its component."""
        if phase.is_dwell:
            return phase
        middle = np.array([0.5 * (phase.begin + phase.end)])
        pieces = self.split_times(middle)
        component, time = next((part, t[0]) for part, _, t in pieces if len(t))
        inner = next(phase for phase in component.phases if phase.end >= time)
        return replace(phase, speed=inner.speed, leads=inner.leads)

    def path_coordinate(self, t: ArrayLike) -> np.ndarray:
        """Return the path coordinate s at times `t`, in the same shape."""
        times = self._check_times(t)
        end = self.control_points[0, -1]  # avoids rounding of the spline
        return np.where(times == self.t_end, end, self.path_spline(times))

    def position(self, t: ArrayLike) -> np.ndarray:
        """Return joint positions at times `t`, rad or m: shape (n,) for a number, (K, n) for K times.

        Raises
        ------
        InputError
            A time lies outside [0, t_end].
        """
        times = self._check_times(t)
        node = np.searchsorted(self.times[1:-1], times, side="right")
        return self.q[node] + self.pieces(times)

    def velocity(self, t: ArrayLike) -> np.ndarray:
        """Return joint velocities, rad/s or m/s, in the shape of `position`."""
        return self.pieces(self._check_times(t), nu=1)

    def acceleration(self, t: ArrayLike) -> np.ndarray:
        """Return joint accelerations, rad/s^2 or m/s^2, in the shape of `position`."""
        return self.pieces(self._check_times(t), nu=2)

    def jerk(self, t: ArrayLike) -> np.ndarray:
        """Return joint jerks, rad/s^3 or m/s^3, in the shape of `position`; at a node, the value just after it."""
        return self.jerk_pieces(self._check_times(t))

    def torque(self, t: ArrayLike) -> np.ndarray:
        """Return joint torques, Nm or N, in the shape of `position`; UrdfError if the URDF has no masses."""
        self.robot.check_masses("torques")
        tau = self.at(t).tau
        assert tau is not None
        return tau if np.ndim(t) else tau[0]

    def at(self, t: ArrayLike) -> Samples:
        """Return all quantities at times `t`, (K,), s. For a number, K = 1."""
        times = np.atleast_1d(numbers(t, "t", "s"))
        return self._samples(times, self._check_times(times))

    def _samples(
        self, t: np.ndarray, within: np.ndarray, *, stops: bool = False
    ) -> Samples:
        """Evaluate the motion at times `within`, labelled with times `t`; with `stops`, the last sample is at rest."""
        q = self.position(within)
        qdot = self.velocity(within)
        qddot = self.acceleration(within)
        if stops:
            qdot[-1] = 0.0
            qddot[-1] = 0.0
        robot = self.robot
        tau = self._torques(within, q, qdot, qddot) if robot.has_masses else None
        tool = tool_motion(self.robot, q, qdot)
        return Samples(t, self.path_coordinate(within), q, qdot, qddot, tau, *tool)

    def _torques(self, t: np.ndarray, *states: np.ndarray) -> np.ndarray:
        """Return the torques of q, qdot and qddot, (K, n), with the payloads that the robot has at times t."""
        tau = np.empty_like(states[0])
        for component, rows, _ in self.split_times(t):
            tau[rows] = torques_of(component.robot, *(state[rows] for state in states))
        return tau

    def split_times(
        self, t: np.ndarray
    ) -> Iterator[tuple[Trajectory, np.ndarray, np.ndarray]]:
        """Yield the components, each with the indices of its times, (k,), and these times from its start, s.

        A motion without components is its only one. A time at which two meet belongs to the later one. While the arm
        waits after a component, the time is that of its end.
        """
        components = self.components or ((0.0, self),)
        begins = [begin for begin, _ in components]
        numbers = np.searchsorted(begins[1:], t, side="right")
        for place, (begin, component) in enumerate(components):
            (rows,) = np.nonzero(numbers == place)
            yield component, rows, np.clip(t[rows] - begin, 0.0, component.t_end)

    def sample(self, dt: float, *, last: str = "exact") -> Samples:
        """Sample the motion at a controller's rate.

        Parameters
        ----------
        dt : float
            Sampling period, s.
        last : {"exact", "hold"}, optional
            Time of the last sample. ``exact``: the last sample is at t_end, so the last period may be shorter.
            ``hold``: the last sample is at the first multiple of `dt` at or after t_end, with the end posture held at
            rest. The velocity and the acceleration of this sample are zero, and its torque is the holding torque.

        Returns
        -------
        Samples
            Samples at 0, dt, 2 dt, ... and the last one.

        Raises
        ------
        InputError
            `dt` is not positive, or so small that there would be more than ten million samples; or `last` is ``hold``
            and the motion does not end at rest.
        UnknownNameError
            `last` is neither ``exact`` nor ``hold``.
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
        """Return a pandas table with a row every `dt` seconds; see `sample`.

        The columns are ``t`` (s) and ``s``; for every joint ``q_<joint>`` (rad or m), ``qd_``, ``qdd_`` and ``tau_``
        (Nm or N, if known); ``tool_x``, ``tool_y``, ``tool_z`` (m), ``tool_qw``, ..., ``tool_qz`` and ``tool_speed``
        (m/s). This needs the extra ``pandas``.

        Raises
        ------
        InputError
            `dt` is not a usable period; or pandas is not installed (`NotInstalledError`).
        """
        return self.sample(dt).to_dataframe(self.joint_names)

    def summary(self) -> Mapping[str, object]:
        """Return the entries shown to the user."""
        no_branch = len(self.chart_rows) or self.components
        intervals = write_count(len(np.unique(self.knots)) - 1, "interval")
        return {
            "end time": f"{self.t_end:.4f} s",
            "robot": Path(*Path(self.robot.source).parts[-2:]).as_posix(),
            "joints": ", ".join(self.joint_names),
            "redundant joints": self.redundancy,
            **({} if no_branch else {"branch": self.branch or "none"}),
            "start posture": self.robot.in_words(self.q[0]),
            "end posture": self.robot.in_words(self.q[-1]),
            **({"recovered from": self.recovered.source} if self.recovered else {}),
            "splines": f"degree {self.degree}, {intervals}",
            **summarise_program(self.parts, self.events),
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one npz file with all the data needed to load and verify the trajectory.

        The file is written under a temporary name and then renamed, so that an interrupted write leaves no incomplete
        file. An older result with the same name is replaced.

        Raises
        ------
        InputError
            The suffix is not npz, the folder does not exist or cannot be written to, or the file exists and is not a
            result.
        """
        write_result(path, *self.contents())

    def contents(self) -> tuple[dict[str, object], dict[str, np.ndarray]]:
        """Return the data of a result file: the metadata, and the arrays, also those of the components."""
        arrays = {name: getattr(self, name) for name in ARRAYS}
        components = []
        for place, (begin, component) in enumerate(self.components):
            meta, inner = component.contents()
            components.append({"begin": begin, **meta})
            arrays |= {f"{place}.{name}": inner[name] for name in ARRAYS}
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
            "parts": [asdict(part) for part in self.parts],
            "events": [asdict(event) for event in self.events],
            "components": components,
        }
        return meta, arrays

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Read a file that `save` wrote.

        Raises
        ------
        ResultFileError
            The file is missing, is broken or has an unknown schema version, or its parts do not fit each other.
        """
        contents = read_result(file_name(path, "path"))
        components = tuple(
            (begin, cls(**parts)) for begin, parts in contents["components"]
        )
        return cls(**contents | {"components": components})

    def _check_times(self, t: ArrayLike) -> np.ndarray:
        """Raise an error for times outside the trajectory, except for rounding at its ends."""
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
