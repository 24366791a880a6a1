"""The trajectory: immutable, evaluated at any time, saved and loaded with all that is needed to verify it again."""

from __future__ import annotations

import json
import os
import zipfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from brachis.errors import InputError, ResultFileError
from brachis.files import atomic_write
from brachis.robot import Robot, dynamics
from brachis.robot.from_task import robot_from_settings
from brachis.task import Task, load_task

if TYPE_CHECKING:
    from scipy.interpolate import BPoly, BSpline

SCHEMA = 1
CONTINUOUS_TORQUE = 3
"""Least B-spline degree that gives continuous acceleration, and so torque."""
_ARRAYS = ("times", "q", "qdot", "qddot", "qddot_before", "knots", "control_points")


@dataclass(frozen=True, eq=False)
class Samples:
    """A trajectory at K times; joints in chain order.

    Attributes
    ----------
    t : (K,) ndarray
        s.
    s : (K,) ndarray
        Path coordinate, dimensionless.
    q, qdot, qddot, tau : (K, n) ndarray
        Position (rad or m), velocity, acceleration, torque (Nm or N).
    """

    t: np.ndarray
    s: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    qddot: np.ndarray
    tau: np.ndarray


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Joint motion along a path.

    Joint positions are quintic polynomials between nodes, which meet the closed form to 1e-11 rad or m and join with
    continuous position, velocity and (from degree 3 on) acceleration. The path coordinate and the redundant joints are
    also kept as the B-splines that the optimiser found.

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
    knots : (N + 2 d + 1,) ndarray
        B-spline knots in normalised time.
    degree : int
        B-spline degree d.
    control_points : (1 + r, N + d) ndarray
        Of s (dimensionless), then of each redundant joint (rad or m) in chain order.
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

    @property
    def t_end(self) -> float:
        """End time, s."""
        return float(self.times[-1])

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints in chain order."""
        return self.robot.joint_names

    @cached_property
    def pieces(self) -> BPoly:
        """Joint positions as SciPy's piecewise polynomial over time."""
        from scipy.interpolate import BPoly  # noqa: PLC0415  (imports in 0.3 s)

        return BPoly(_bernstein(self.times, self.q, self.qdot, self.qddot, self.qddot_before), self.times)

    @cached_property
    def path_spline(self) -> BSpline:
        """s(t) as SciPy's B-spline over time in seconds."""
        from scipy.interpolate import BSpline  # noqa: PLC0415

        return BSpline(self.knots * self.t_end, self.control_points[0], self.degree)

    def path_coordinate(self, t: np.ndarray | float) -> np.ndarray:
        """Path coordinate s at times `t`, same shape."""
        return np.asarray(self.path_spline(self._checked(t)))

    def position(self, t: np.ndarray | float) -> np.ndarray:
        """Joint positions at times `t`: (n,) for a number, (K, n) for (K,); rad or m.

        Raises
        ------
        InputError
            A time lies outside [0, t_end].
        """
        return np.asarray(self.pieces(self._checked(t)))

    def velocity(self, t: np.ndarray | float) -> np.ndarray:
        """Joint velocities, as `position`; rad/s or m/s."""
        return np.asarray(self.pieces(self._checked(t), nu=1))

    def acceleration(self, t: np.ndarray | float) -> np.ndarray:
        """Joint accelerations, as `position`; rad/s^2 or m/s^2."""
        return np.asarray(self.pieces(self._checked(t), nu=2))

    def torque(self, t: np.ndarray | float) -> np.ndarray:
        """Joint torques, as `position`; Nm or N."""
        t = self._checked(t)
        states = (np.atleast_2d(part(t)) for part in (self.position, self.velocity, self.acceleration))
        tau = dynamics.torque(self.robot, *states)
        return tau if np.ndim(t) else tau[0]

    def at(self, t: np.ndarray) -> Samples:
        """All quantities at times `t`, (K,)."""
        q, qdot, qddot = self.position(t), self.velocity(t), self.acceleration(t)
        return Samples(t, self.path_coordinate(t), q, qdot, qddot, dynamics.torque(self.robot, q, qdot, qddot))

    def sample(self, dt: float) -> Samples:
        """Sample at a controller's rate.

        Parameters
        ----------
        dt : float
            Period, s.

        Returns
        -------
        Samples
            At 0, dt, 2 dt, ... and at t_end exactly; the last period may be shorter.

        Raises
        ------
        InputError
            `dt` is not positive, or so small that there would be more than ten million samples.
        """
        if not (np.isfinite(dt) and dt > 0.0 and self.t_end / dt < 1e7):  # noqa: PLR2004
            raise InputError(
                "is not a usable period", where="dt", found=f"{dt} s", allowed="> 0 s, at most 1e7 samples"
            )
        whole = int(np.ceil(self.t_end / dt * (1.0 - 1e-12)))
        return self.at(np.append(np.arange(whole) * dt, self.t_end))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one npz file with all that is needed to load and verify the trajectory.

        The file is written under a temporary name and renamed, so that a broken write leaves nothing behind.

        Raises
        ------
        InputError
            The folder does not exist or cannot be written.
        """
        meta = {
            "schema": SCHEMA,
            "task": self.task.to_dict(),
            "urdf": self.urdf,
            "redundant_joints": list(self.redundant_joints),
            "branch": self.branch,
            "degree": self.degree,
            "joint_names": list(self.joint_names),
        }
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        with atomic_write(path) as stream:
            np.savez(stream, meta=np.array(json.dumps(meta)), **arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Read a file that `save` wrote.

        Raises
        ------
        ResultFileError
            The file is missing, broken or of another schema version.
        """
        meta, arrays = _read(Path(path))
        try:
            task = load_task(meta["task"])
            robot = robot_from_settings(task.robot, urdf_text=meta["urdf"])
            trajectory = cls(
                task=task,
                urdf=meta["urdf"],
                robot=robot,
                redundant_joints=tuple(meta["redundant_joints"]),
                branch=meta["branch"],
                degree=int(meta["degree"]),
                **arrays,
            )
        except (KeyError, TypeError) as error:
            raise ResultFileError("the result file lacks a part", where=str(path), found=str(error)) from error
        shape = (len(trajectory.times), robot.n)
        parts = (trajectory.q, trajectory.qdot, trajectory.qddot, trajectory.qddot_before)
        if any(part.shape != shape for part in parts):
            raise ResultFileError("the result file does not fit its robot", where=str(path), allowed=f"{shape} values")
        return trajectory

    def _checked(self, t: np.ndarray | float) -> np.ndarray:
        """Refuse times outside the trajectory; rounding at the ends is forgiven."""
        times = np.asarray(t, dtype=float)
        slack = 1e-9 * self.t_end
        if times.size and not (times.min() >= -slack and times.max() <= self.t_end + slack):
            raise InputError(
                "time outside the trajectory",
                found=f"{times.min():g} s to {times.max():g} s",
                allowed=f"0 s to {self.t_end:.6g} s",
            )
        return np.clip(times, 0.0, self.t_end)


def _bernstein(times: np.ndarray, q: np.ndarray, qdot: np.ndarray, after: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Bernstein coefficients (6, L, n) of the quintic Hermite pieces between nodes.

    A Bezier curve of degree 5 and length h begins with q = c0, qdot = 5 (c1 - c0) / h and
    qddot = 20 (c2 - 2 c1 + c0) / h^2, and ends likewise.
    """
    h = np.diff(times)[:, None]
    slope, bend = h / 5.0, h**2 / 20.0
    left = [q[:-1], q[:-1] + slope * qdot[:-1], q[:-1] + 2.0 * slope * qdot[:-1] + bend * after[:-1]]
    right = [q[1:] - 2.0 * slope * qdot[1:] + bend * before[1:], q[1:] - slope * qdot[1:], q[1:]]
    return np.stack([*left, *right])


def _read(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Read the metadata and arrays of a result file."""
    if not path.is_file():
        raise ResultFileError("the result file does not exist", where=str(path))
    try:
        with np.load(path, allow_pickle=False) as archive:
            meta = json.loads(str(archive["meta"]))
            arrays = {name: archive[name] for name in _ARRAYS}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise ResultFileError(
            "the file is not a brachis result",
            where=str(path),
            found=str(error),
            allowed="a file written by brachis plan",
        ) from error
    if meta.get("schema") != SCHEMA:
        raise ResultFileError("unknown schema version", where=str(path), found=meta.get("schema"), allowed=SCHEMA)
    return meta, arrays
