"""Drake's KinematicTrajectoryOptimization: a B-spline of all joints, whose tool is on the line at chosen places."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from peers.lines import INTERVALS, Answer, Line

PLACES = 61
"""Values of s at which the tool is held on its path and the torques within their limits."""
_MOST_ITERATIONS = 20_000
_SLACK = 1e-4
"""Tolerance of the tool's position (m) and angle (rad)."""


def solve(line: Line) -> Answer:
    """Set the program up, and solve it from the joint path of the pseudo-inverse."""
    from pydrake.planning import KinematicTrajectoryOptimization
    from pydrake.solvers import SnoptSolver, Solve, SolverOptions
    from pydrake.trajectories import BsplineTrajectory

    began = time.process_time()
    limits = line.robot.limits
    count = INTERVALS + 3
    program = KinematicTrajectoryOptimization(line.robot.n, count, 4)
    s_path, q_path = line.joint_path()
    even = np.linspace(0.0, 1.0, count)
    guess = np.array([np.interp(even, s_path, column) for column in q_path.T])
    points = [column[:, None] for column in guess.T]
    program.SetInitialGuess(BsplineTrajectory(program.basis(), points))
    program.AddDurationConstraint(0.05, 20.0)
    program.AddDurationCost(1.0)
    program.AddPathPositionConstraint(line.start, line.start, 0.0)
    zero = np.zeros(line.robot.n)
    for end in (0.0, 1.0):
        program.AddPathVelocityConstraint(zero, zero, end)
        program.AddPathAccelerationConstraint(zero, zero, end)
    if np.isfinite(limits.position_lower).all():
        program.AddPositionBounds(limits.position_lower, limits.position_upper)
    if np.isfinite(limits.velocity).all():
        program.AddVelocityBounds(-limits.velocity, limits.velocity)
    kept = _hold_tool_and_effort(program, line)
    ready = time.process_time()
    options = SolverOptions()
    options.SetOption(SnoptSolver.id(), "Iterations limit", _MOST_ITERATIONS)
    result = Solve(program.prog(), solver_options=options)
    ended = time.process_time()
    del kept
    if not result.is_success():
        return Answer(ready - began, ended - ready, np.nan, lambda t: (t, t, t))
    motion = program.ReconstructTrajectory(result)
    orders = (motion, motion.MakeDerivative(1), motion.MakeDerivative(2))
    return Answer(
        ready - began,
        ended - ready,
        float(motion.end_time()),
        lambda t: tuple(own.vector_values(t).T for own in orders),  # type: ignore[return-value]
    )


def _hold_tool_and_effort(program: Any, line: Line) -> Any:
    """Hold the tool on the line, and efforts within their limits, at `PLACES`; return what has to live as long."""
    from pydrake.math import RotationMatrix
    from pydrake.multibody.inverse_kinematics import (
        OrientationConstraint,
        PositionConstraint,
    )
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    robot = line.robot
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(robot.urdf, "urdf")
    root = plant.GetBodyByName(robot.model.frames[1].name)
    if root.index() != plant.world_body().index():
        plant.WeldFrames(plant.world_frame(), root.body_frame())
    plant.mutable_gravity_field().set_gravity_vector(np.array(robot.chain.gravity))
    for name, torque in zip(robot.joint_names, robot.limits.torque, strict=True):
        if not plant.HasJointActuatorNamed(name):
            plant.AddJointActuator(name, plant.GetJointByName(name), torque)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    world = plant.world_frame()
    tool = plant.GetFrameByName(robot.tool_frame)
    begin, end = line.targets(np.array([0.0, 1.0]))
    places = np.linspace(0.0, 1.0, PLACES)
    for place in places:
        box = _box(line, end if place == 1.0 else begin, end)
        at = PositionConstraint(plant, world, *box, tool, np.zeros(3), context)
        program.AddPathPositionConstraint(at, place)
        if len(begin) == 12:
            kept = RotationMatrix(begin[3:].reshape(3, 3))
            turned = (world, kept, tool, RotationMatrix(), _SLACK, context)
            program.AddPathPositionConstraint(
                OrientationConstraint(plant, *turned), place
            )
    torque = robot.limits.torque
    program.AddEffortBoundsAtNormalizedTimes(plant, places, -torque, torque, context)
    return plant, context


def _box(
    line: Line, begin: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper bounds, (3,), of the tool's position between two points; open beside the rows of a plane."""
    axes = list(line.problem.task_map.axes) or [0, 1, 2]
    low, high = (np.full(3, -np.inf), np.full(3, np.inf))
    low[axes] = np.minimum(begin[: len(axes)], end[: len(axes)]) - _SLACK
    high[axes] = np.maximum(begin[: len(axes)], end[: len(axes)]) + _SLACK
    return low, high
