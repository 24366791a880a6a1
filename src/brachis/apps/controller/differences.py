"""Checks of successive samples by their differences, as controllers do."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from brachis.robot import Robot
from brachis.trajectory import Trajectory, torques_of
from brachis.verify import Check
from brachis.verify.limits.tool import largest_speeds


def check_differences(robot: Robot, run: Trajectory, allowed: float) -> Iterator[Check]:
    """Check the differences of successive samples, divided by the period, as controllers do."""
    period = run.times[1] - run.times[0]
    count = run.q.shape[1]
    quantities = {
        "velocity": (run.q, 1),
        "acceleration": (run.q, 2),
        "jerk": (run.q, 3),
    }
    if robot.has_masses:
        torques = torques_of(robot, run.q, run.qdot, run.qddot)
        quantities["torque_rate"] = (torques, 1)
    for kind, (values, order) in quantities.items():
        lower, upper = robot.limits.both_ways(kind)[:, :count]
        if not np.isfinite(upper).any():
            continue
        # The controller holds the first position before the motion, and the last one after it.
        held = np.pad(values, ((order - 1, order - 1), (0, 0)), mode="edge")
        rates = np.diff(held, order, axis=0) / period**order
        ratios = np.maximum(rates / upper, rates / lower)
        row, joint = map(int, np.unravel_index(np.argmax(ratios), ratios.shape))
        time = run.times[min(max(row - order + 2, 0), len(run.times) - 1)]
        name = f"{kind.replace('_', ' ')} by differences"
        subject = robot.joint_names[joint]
        ratio = ratios[row, joint]
        yield Check(name, ratio, allowed, "-", subject, time, of_limit=True)
    limit = robot.limits.rms_torque[:count]
    if np.isfinite(limit).any():
        ratios = np.sqrt(np.mean(torques**2, axis=0)) / limit
        joint = int(np.argmax(ratios))
        subject = robot.joint_names[joint]
        name = "rms torque by differences"
        yield Check(name, ratios[joint], allowed, "-", subject, of_limit=True)


def check_tool_speed(
    run: Trajectory, sampled: Trajectory, allowed: float
) -> Iterator[Check]:
    """Check the distances between tool positions at successive samples, divided by the period."""
    t = sampled.times
    s = run.path_coordinate(np.clip(t, 0.0, run.t_end))
    largest = largest_speeds(run.task, s, np.maximum)
    if np.isinf(largest).all():
        return
    robot = sampled.robot
    places, _ = robot.tool_placements(robot.of_real_joints(sampled.q))
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / (t[1] - t[0])
    ratios = speeds / np.maximum(largest[1:], largest[:-1])
    row = int(np.argmax(ratios))
    name = "tool speed by differences"
    time = t[row]
    yield Check(name, ratios[row], allowed, "-", "tool", time, of_limit=True)
