"""Seeded motions as they run today: pseudo-inverse joint paths, timed by toppra, beside plans along the same path.

Usage: python studies/today.py [--count 10] [--first 0] [--dt 0.002] [--write FILE]

Even seeds are planar arms of three joints, odd ones the KUKA iiwa 14. The tool goes along a line or an arc, carried by
the pseudo-inverse of the Jacobian from a drawn posture; a quintic spline through its joint positions is timed by toppra
within limits of velocity, acceleration and torque, and written as a CSV file of time and joint positions.
`brachis.compare` sees that file, the URDF and the limits alone. With --write the first motion is written, within its
URDF's limits: examples/12_today.csv is that of --first 4 --dt 0.004.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.interpolate import make_interp_spline

import brachis
from brachis.path import path_of
from brachis.robot import TaskMap, bind, dynamics
from brachis.robot.from_task import robot_from_settings

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "benchmarks"))

from committed import processor_time  # noqa: E402

STATIONS, GRID, CORRECTIONS, BETWEEN, INSTANTS = 400, 1000, 4, 7, 20_001
REACH, HELD, WELL = 0.8, 0.6, 0.15
"""Parts of the joint ranges and of the torques that gravity takes; least singular value of the Jacobian."""


@dataclass(frozen=True)
class Today:
    """A motion: where it is at any time, and the task whose limits it keeps."""

    robot: brachis.Robot
    task_map: TaskMap
    content: dict[str, Any]
    motion: Any

    def write(self, path: Path, dt: float) -> None:
        """Write time and joint positions."""
        t = np.append(np.arange(0.0, self.motion.duration, dt), self.motion.duration)
        header = ",".join(["t", *self.robot.joint_names[: self.motion.dof]])
        np.savetxt(
            path,
            np.column_stack([t, self.motion(t)]),
            delimiter=",",
            header=header,
            comments="",
            fmt="%.12g",
        )

    def largest_ratio(self) -> float:
        """Return the largest ratio to a limit of velocity, acceleration or torque, from the motion itself."""
        t, limits = np.linspace(0.0, self.motion.duration, INSTANTS), self.robot.limits
        q, qdot, qddot = (self.motion(t, order) for order in range(3))
        tau = dynamics.torque(self.robot, q, qdot, qddot)
        parts = (
            qdot / limits.velocity,
            qddot / limits.acceleration,
            tau / limits.torque,
        )
        return float(max(np.abs(part).max() for part in parts))

    def miss(self, trajectory: brachis.Trajectory, dt: float) -> float:
        """Return the largest distance of the given motion's tool from a recovered path, m; between the rows, too."""
        path = path_of(self.task_map, trajectory.task)
        t = np.linspace(
            0.0, self.motion.duration, BETWEEN * round(self.motion.duration / dt)
        )
        places = self.task_map.values(self.motion(t))
        s = trajectory.path_coordinate(np.minimum(t, trajectory.t_end))
        for _ in range(CORRECTIONS):
            sample = path.sample(s)
            off = self.task_map.difference(places, sample.target)
            s = np.clip(
                s + np.sum(off * sample.xi, axis=1) / np.sum(sample.xi**2, axis=1),
                0.0,
                1.0,
            )
        return float(
            np.max(
                self.task_map.norms(
                    self.task_map.difference(places, path.sample(s).target)
                )[0]
            )
        )


def case(seed: int, *, limits: bool = True) -> Today:
    """Return the motion with this number: the first drawn one that stays clear of ranges and singularities."""
    rng = np.random.default_rng(seed)
    content = _planar(rng) if seed % 2 == 0 else _spatial(rng)
    if not limits:
        del content["robot"]["limits"]
    task = brachis.load_task(
        {
            **content,
            "start": {"joints": [0.0] * 3},
            "path": [{"line": {"by": [1.0, 0.0]}}],
        }
    )
    robot, task_map = bind(robot_from_settings(task.robot), task.task_space)
    while True:
        q = _joint_path(rng, robot, task_map)
        if q is not None:
            motion = _timed(robot, q)
            if motion is not None:
                return Today(robot, task_map, content, motion)


def _planar(rng: np.random.Generator) -> dict[str, Any]:
    limits = {
        "velocity": 2.0,
        "acceleration": rng.uniform(4.0, 8.0, 3).round(2).tolist(),
    }
    urdf = str(ROOT / "robots/scara3/robot.urdf")
    robot = {"urdf": urdf, "gravity": [0, 0, 0], "limits": limits}
    return {
        "brachis": 1,
        "robot": robot,
        "task_space": ["x", "y"],
        "spline": {"intervals": 20},
    }


def _spatial(rng: np.random.Generator) -> dict[str, Any]:
    limits = {
        "acceleration": rng.uniform(10.0, 20.0, 7).round(2).tolist(),
        "scale": {"torque": 0.5},
    }
    urdf = str(ROOT / "robots/iiwa14/robot.urdf")
    robot = {"urdf": urdf, "limits": limits}
    return {
        "brachis": 1,
        "robot": robot,
        "task_space": "pose",
        "spline": {"intervals": 20},
    }


def _joint_path(
    rng: np.random.Generator, robot: brachis.Robot, task_map: TaskMap
) -> np.ndarray | None:
    """Draw a start posture and a line or an arc, and carry the one along the other; None where that ends."""
    low, high = (
        np.clip(end, -np.pi, np.pi)
        for end in (robot.limits.position_lower, robot.limits.position_upper)
    )
    q = REACH * rng.uniform(low, high)
    first = task_map.value(q)
    axes, spin = len(task_map.axes), rng.standard_normal(3)
    along, across = np.linalg.qr(rng.standard_normal((axes, axes)))[0][:2]
    length, bend = rng.uniform(0.3, 0.6), rng.uniform(0.0, 2.0)
    found = [q]
    for s in np.linspace(0.0, length, STATIONS + 1)[1:]:
        target = first.copy()
        target[:axes] += (
            along * np.sin(bend * s) / bend + across * (1.0 - np.cos(bend * s)) / bend
        )
        if len(target) > axes:
            turned = first[axes:].reshape(3, 3) @ pin.exp3(0.5 * spin * s)
            target[axes:] = turned.ravel()
        for _ in range(CORRECTIONS):
            jacobian = task_map.jacobian(task_map.twists(q[None]))[0]
            if np.linalg.svd(jacobian, compute_uv=False)[-1] < WELL:
                return None
            q = q + np.linalg.pinv(jacobian) @ task_map.difference(
                target, task_map.value(q)
            )
        found.append(q)
    q_all, data = np.array(found), robot.model.createData()
    held = np.array(
        [pin.computeGeneralizedGravity(robot.model, data, each) for each in q_all]
    )
    within = (q_all > robot.limits.position_lower) & (
        q_all < robot.limits.position_upper
    )
    return (
        q_all
        if within.all() and (np.abs(held) < HELD * robot.limits.torque).all()
        else None
    )


def _timed(robot: brachis.Robot, q: np.ndarray) -> Any:
    """Let toppra time a path of joints; None where it cannot."""
    import toppra

    spline = make_interp_spline(np.linspace(0.0, 1.0, len(q)), q, k=5)
    data, n = robot.model.createData(), q.shape[1]

    class Geometry(toppra.interpolator.AbstractGeometricPath):
        dof, waypoints, path_interval = n, None, np.array([0.0, 1.0])

        def __call__(self, s, order=0):
            return spline(s, nu=order)

    def inverse_dynamics(*state: np.ndarray) -> np.ndarray:
        return np.asarray(pin.rnea(robot.model, data, *state))

    both, limits = np.array([-1.0, 1.0]), robot.limits
    between = toppra.constraint.DiscretizationType.Interpolation
    torque = (inverse_dynamics, limits.torque[:, None] * both, np.zeros(n))
    constraints = [
        toppra.constraint.JointVelocityConstraint(limits.velocity[:, None] * both),
        toppra.constraint.JointTorqueConstraint(*torque, discretization_scheme=between),
    ]
    if np.isfinite(limits.acceleration).all():
        constraints.append(
            toppra.constraint.JointAccelerationConstraint(
                limits.acceleration[:, None] * both, between
            )
        )
    grid = np.linspace(0.0, 1.0, GRID + 1)
    wrapper = {"solver_wrapper": "seidel", "parametrizer": "ParametrizeConstAccel"}
    solver = toppra.algorithm.TOPPRA(
        constraints, Geometry(), gridpoints=grid, **wrapper
    )
    return solver.compute_trajectory(0.0, 0.0)


def main() -> None:
    """Print a line a motion, then a summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--dt", type=float, default=0.002)
    parser.add_argument("--write", type=Path)
    given = parser.parse_args()
    if given.write:
        case(given.first, limits=False).write(given.write, given.dt)
        return
    rows = []
    print(
        "                                                                largest ratio of today's"
    )
    print(
        "seed  robot      today    planned     saved   path off        itself    rows   planned  compared in"
    )
    for seed in range(given.first, given.first + given.count):
        today = case(seed)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "today.csv"
            today.write(file, given.dt)
            began = processor_time()
            task = {
                **today.content,
                "start": {"joints": [0.0]},
                "path": [{"line": {"by": [1.0]}}],
            }
            found = brachis.compare(file, task=task)
        took = processor_time() - began
        miss = today.miss(found.recorded, given.dt)
        rows.append((found.saved, miss, found.result.verified))
        ratios = (
            max(use.recorded for use in found.uses),
            found.result.verification.worst_ratio,
        )
        name = "scara3" if seed % 2 == 0 else "iiwa14"
        print(
            f"{seed:4d}  {name} {found.recorded.t_end:8.4f} s {found.result.t_end:8.4f} s {100 * found.saved:7.2f} % "
            f"{1e6 * miss:8.3f} um {today.largest_ratio():12.4f} {ratios[0]:7.4f} {ratios[1]:9.4f} {took:9.1f} s",
            flush=True,
        )
    saved, misses, verified = np.array(rows).T
    print(
        f"{len(rows)} motions: {100 * saved.min():.1f} to {100 * saved.max():.1f} % saved, median "
        f"{100 * np.median(saved):.1f} %; paths recovered to {misses.max():.1e} m; {int(verified.sum())} plans "
        f"verified, {int((saved < 0).sum())} slower than the motion given"
    )


if __name__ == "__main__":
    main()
