"""A joint path, timed under the same limits by brachis and, if installed, by toppra.

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


POINTS = 401
"""Points of the joint path through which toppra's spline runs."""


def joint_points(
    robot: brachis.Robot, task: brachis.Task
) -> tuple[np.ndarray, np.ndarray]:
    """Return dense points of a task's joint path: s (POINTS,) and q (POINTS, n), rad."""
    s = np.linspace(0.0, 1.0, POINTS)
    robot, task_map = bind(robot, task.task_space)
    return s, path_of(task_map, task).sample(s).target


def by_toppra(
    robot: brachis.Robot,
    s: np.ndarray,
    q: np.ndarray,
    *,
    intervals: int = 2000,
    speeds: tuple[float, float] = (0, 0),
) -> float:
    """Time a joint path with toppra; return the end time, s.

    Parameters
    ----------
    robot : Robot
    s, q : (S,) ndarray and (S, n) ndarray
        Points of the path.
    intervals : int, optional
        Of toppra's grid.
    speeds : tuple of float, optional
        Norms of the joint velocities at both ends, rad/s.
    """
    import toppra

    data = robot.model.createData()

    def inverse_dynamics(
        q: np.ndarray, qdot: np.ndarray, qddot: np.ndarray
    ) -> np.ndarray:
        return pin.rnea(robot.model, data, q, qdot, qddot)

    both_ways = np.array([-1.0, 1.0])
    path = toppra.SplineInterpolator(s, q)
    constraints = [
        toppra.constraint.JointVelocityConstraint(
            robot.limits.velocity[:, None] * both_ways
        ),
        toppra.constraint.JointAccelerationConstraint(
            robot.limits.acceleration[:, None] * both_ways
        ),
        toppra.constraint.JointTorqueConstraint(
            inverse_dynamics,
            robot.limits.torque[:, None] * both_ways,
            np.zeros(robot.n),
        ),
    ]
    grid = np.linspace(0.0, 1.0, intervals + 1)
    solver = toppra.algorithm.TOPPRA(
        constraints, path, gridpoints=grid, solver_wrapper="seidel"
    )
    rates = speeds / np.linalg.norm(path(np.array([0.0, 1.0]), 1), axis=1)
    _, rate, _ = solver.compute_parameterization(*rates)
    return float(np.sum(2.0 * np.diff(grid) / (rate[1:] + rate[:-1])))


def main() -> tuple[brachis.Result, float | None]:
    """Plan with both and print the end times."""
    result = brachis.plan(TASK)
    print(f"brachis: {result.t_end:.4f} s, verified: {result.verified}")
    try:
        robot = result.trajectory.robot
        ends = result.task.boundary
        points = joint_points(robot, result.task)
        least = by_toppra(robot, *points, speeds=(ends.start_speed, ends.end_speed))
    except ImportError:
        print("toppra is not installed: pip install toppra")
        return result, None
    print(f"toppra:  {least:.4f} s")
    return result, least


if __name__ == "__main__":
    main()
