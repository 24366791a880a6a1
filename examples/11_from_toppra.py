"""The same path of joints under the same limits, timed by brachis and, where it is installed, by toppra.

Usage: python examples/11_from_toppra.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin

import brachis
from brachis.path import path_of
from brachis.robot import bind

TASK = Path(__file__).with_suffix(".yaml")


def by_toppra(robot: brachis.Robot, task: brachis.Task, intervals: int = 2000) -> float:
    """Time a task's path with toppra; return the end time, s."""
    import toppra  # noqa: PLC0415  (not everyone has it)

    robot, task_map = bind(robot, task.task_space)
    path, data = path_of(task_map, task), robot.model.createData()

    class Geometry(toppra.interpolator.AbstractGeometricPath):
        """The very path of the task, for toppra."""

        dof, waypoints, path_interval = robot.n, None, np.array([0.0, 1.0])

        def __call__(self, s: np.ndarray | float, order: int = 0) -> np.ndarray:
            """Positions, or their first or second derivative."""
            sample = path.sample(np.atleast_1d(s))
            values = (sample.target, sample.xi, sample.xi_ds)[order]
            return values if np.ndim(s) else values[0]

    def inverse_dynamics(q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray) -> np.ndarray:
        return np.asarray(pin.rnea(robot.model, data, q, qdot, qddot))

    both_ways = np.array([-1.0, 1.0])
    constraints = [
        toppra.constraint.JointVelocityConstraint(robot.limits.velocity[:, None] * both_ways),
        toppra.constraint.JointAccelerationConstraint(robot.limits.acceleration[:, None] * both_ways),
        toppra.constraint.JointTorqueConstraint(
            inverse_dynamics, robot.limits.torque[:, None] * both_ways, np.zeros(robot.n)
        ),
    ]
    grid = np.linspace(0.0, 1.0, intervals + 1)
    solver = toppra.algorithm.TOPPRA(constraints, Geometry(), gridpoints=grid, solver_wrapper="seidel")
    ends = np.array([task.boundary.start_speed, task.boundary.end_speed])
    _, speed, _ = solver.compute_parameterization(*(ends / np.linalg.norm(path.sample([0.0, 1.0]).xi, axis=1)))
    return float(np.sum(2.0 * np.diff(grid) / (speed[1:] + speed[:-1])))


def main() -> tuple[brachis.Result, float | None]:
    """Plan with both and print the end times."""
    result = brachis.plan(TASK)
    print(f"brachis: {result.t_end:.4f} s, verified: {result.verified}")
    try:
        least = by_toppra(result.trajectory.robot, result.task)
    except ImportError:
        print("toppra is not installed: pip install toppra")
        return result, None
    print(f"toppra:  {least:.4f} s")
    return result, least


if __name__ == "__main__":
    main()
