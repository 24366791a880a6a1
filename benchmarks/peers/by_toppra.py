"""toppra: the fastest timing of the joint path that the pseudo-inverse of the Jacobian gives, what people do today."""

from __future__ import annotations

import time

import numpy as np
import pinocchio as pin

from peers.lines import Answer, Line

GRID = 400


def solve(line: Line) -> Answer:
    """Follow the line, then time the joints."""
    import toppra

    began = time.process_time()
    robot = line.robot
    data = robot.model.createData()
    both_ways = np.array([-1.0, 1.0])
    path = toppra.SplineInterpolator(*line.joint_path())
    torque = toppra.constraint.JointTorqueConstraint(
        lambda q, qdot, qddot: pin.rnea(robot.model, data, q, qdot, qddot),
        robot.limits.torque[:, None] * both_ways,
        np.zeros(robot.n),
        discretization_scheme=toppra.constraint.DiscretizationType.Interpolation,
    )
    constraints = [torque]
    if np.isfinite(robot.limits.velocity).all():
        speeds = robot.limits.velocity[:, None] * both_ways
        constraints.append(toppra.constraint.JointVelocityConstraint(speeds))
    ready = time.process_time()
    solver = toppra.algorithm.TOPPRA(
        constraints,
        path,
        gridpoints=np.linspace(0.0, 1.0, GRID + 1),
        solver_wrapper="seidel",
        parametrizer="ParametrizeConstAccel",
    )
    motion = solver.compute_trajectory(0.0, 0.0)
    ended = time.process_time()
    return Answer(
        ready - began,
        ended - ready,
        float(motion.duration),
        lambda t: (motion(t), motion(t, 1), motion(t, 2)),
    )
