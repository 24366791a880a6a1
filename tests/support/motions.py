"""Decompositions with smooth paths and motions y(t) that they can follow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.testing import assert_allclose

from brachis.ik import find
from brachis.kinematics import ChartMap, ClosedFormMap, JointDerivatives
from brachis.path import build_path
from brachis.problem.feasibility import branch_of
from brachis.robot import Robot, task_map_of
from brachis.robot.limits import MAGNITUDES
from brachis.task import ToolLimits, load_task

THREE_CIRCLES = [{"circle": {"center": [0.0, 0.0], "turns": 3}}]
"""About the base."""
TOO_FAR = [{"line": {"by": [3.0, 0.0]}}]
PLANAR: dict[str, Any] = {
    "r = 0, 2R": ("RR", "xz", ["x", "z"], [0.4, 1.2], []),
    "r = 0, 3R with yaw": ("RRR", "xy", ["x", "y", "yaw"], [0.4, 1.8, 0.5], []),
    "r = 1, 3R": ("RRR", "xy", ["x", "y"], [0.4, 1.0, 0.5], ["j2"]),
    "r = 1, RPR": ("RPR", "tilted", ["x", "y"], [0.4, 0.2, 0.9], ["j1"]),
    "r = 1, 4R with yaw": (
        "RRRR",
        "xz",
        ["x", "z", "pitch"],
        [0.4, -0.6, 1.4, 0.8],
        ["j1"],
    ),
    "r = 2, 4R": ("RRRR", "xz", ["x", "z"], [0.4, 0.8, 0.7, 0.5], ["j1", "j4"]),
    "r = 2, PPRR": ("PPRR", "xy", ["x", "y"], [0.1, 0.2, 0.7, -0.1], ["j1", "j3"]),
}
"""Planar arms: pattern, plane, rows of the task space, start posture and redundant joints."""


def arc_path(
    robot: Robot, rows: Sequence[str], start: Any, angle_deg: float = 25.0
) -> list[dict[str, Any]]:
    """An arc about a point near the tool, with yaw along the tangent: all derivatives of the path differ from zero."""
    tool = robot.tool_placement(np.array(start, dtype=float)).translation[
        ["xyz".index(row) for row in rows[:2]]
    ]
    arc = {"center": np.add(tool, [0.12, -0.1]).tolist(), "angle_deg": angle_deg}
    return [{"arc": {**arc, "yaw": "tangent"} if "yaw" in rows else arc}]


def joint_map(
    robot: Robot,
    rows: str | Sequence[str],
    path: Sequence[dict[str, Any]],
    start: Sequence[float],
    redundant: Sequence[str],
) -> ClosedFormMap:
    """Decomposition on the branch of the start posture; the path's segments as a task file writes them."""
    start = np.array(start, dtype=float)
    space = task_map_of(robot, rows)
    content = {"brachis": 1, "start": {"joints": [0]}, "path": list(path)}
    task = load_task(
        {**content, "task_space": rows if isinstance(rows, str) else list(rows)}
    )
    curve = build_path(task.path, space.value(start), space.rows)
    candidate = find(robot, space, redundant)
    branch = branch_of(space, candidate, start, "start.joints")
    indices = tuple(map(robot.joint_names.index, candidate.redundant_joints))
    assert candidate.solver is not None
    return ClosedFormMap(space, curve, candidate.solver, indices, branch, start)


@dataclass(frozen=True)
class Sway:
    """A smooth motion: s runs from 0 to 1, the redundant joints, or sigma, sway about the start posture."""

    joint_map: ClosedFormMap | ChartMap
    amplitude: float = 0.25

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return y and three derivatives at times t in [0, 1], each (K, 1 + r)."""

        def swing(rate: float, phase: float) -> np.ndarray:
            order = np.arange(4.0)[:, None]
            return rate**order * np.sin(rate * t + phase + order * np.pi / 2.0)

        value = np.array([1.0, 0.0, 0.0, 0.0])[:, None]
        columns = [0.5 * value + 0.5 * swing(np.pi, -np.pi / 2.0)]
        start = self.joint_map.coordinates(0.0, self.joint_map.start)
        for place, q in enumerate(start[1:]):
            columns.append(q * value + self.amplitude * swing(2.0 + place, 0.0))
        return tuple(np.stack(columns, axis=2))


def check_time_derivatives(motion: Any, t: np.ndarray, exact: float) -> None:
    """Positions are the postures', to `exact`; velocities, accelerations and jerks differences over time."""
    joint_map, h = motion.joint_map, 1e-4
    state = joint_map.state(*motion(t))
    before, here, after = (
        joint_map.postures(motion(t + step)[0]) for step in (-h, 0.0, h)
    )
    assert_allclose(state.q, here, atol=exact)
    speed, bend = (after - before) / (2.0 * h), (after - 2.0 * here + before) / h**2
    assert np.abs(speed).max() > 0.1
    assert np.abs(bend).max() > 0.1
    assert_allclose(state.qdot, speed, atol=1e-5 * np.abs(speed).max())
    assert_allclose(state.qddot, bend, atol=1e-5 * np.abs(bend).max())
    before, after = (
        joint_map.state(*motion(t + step), near=here).qddot for step in (-h, h)
    )
    jerk = (after - before) / (2.0 * h)
    assert np.abs(jerk).max() > 0.1
    assert_allclose(state.qdddot, jerk, atol=1e-5 * np.abs(jerk).max())


def check_derivatives(motion: Any, t: np.ndarray) -> JointDerivatives:
    """Compare the derivatives of a joint map with central differences by every column of y and its derivatives."""
    joint_map, h, parts = motion.joint_map, 3e-5, motion(t)
    state = joint_map.state(*parts)
    exact = joint_map.derivatives(state)

    def difference(place: int, column: int) -> list[np.ndarray]:
        sides = []
        for sign in (1.0, -1.0):
            moved = [curve.copy() for curve in parts]
            moved[place][:, column] += sign * h
            sides.append(joint_map.state(*moved))
        names = ("q", "qdot", "qddot", "qdddot")
        return [
            (getattr(sides[0], name) - getattr(sides[1], name)) / (2.0 * h)
            for name in names
        ]

    for column in range(1 + joint_map.r):
        by_y, by_ydot, by_yddot, by_ydddot = (
            difference(place, column) for place in range(4)
        )
        gradient = state.gradient[:, :, column]
        # Zeros: position does not hang on speed, nor speed on acceleration.
        for value, expected in (
            (gradient, by_y[0]),
            (exact.qdot_y[:, :, column], by_y[1]),
            (exact.qddot_y[:, :, column], by_y[2]),
            (0.0 * gradient, by_ydot[0]),
            (gradient, by_ydot[1]),
            (exact.qddot_ydot[:, :, column], by_ydot[2]),
            (0.0 * gradient, by_yddot[0]),
            (0.0 * gradient, by_yddot[1]),
            (gradient, by_yddot[2]),
            (gradient, by_ydddot[3]),
            (3.0 * exact.qdot_y[:, :, column], by_yddot[3]),
            (3.0 * exact.qddot_y[:, :, column], by_ydot[3]),
        ):
            assert_allclose(
                value, expected, atol=2e-7 * max(1.0, np.abs(expected).max())
            )
        # A difference of differences, where the highest derivatives of a chart's splines have corners at its knots.
        atol = 2e-6 * max(1.0, np.abs(by_y[3]).max())
        assert_allclose(state.qdddot_y[:, :, column], by_y[3], atol=atol)
    return exact


def with_limits(trajectory, **limits):
    """The motion of a robot that has other limits: magnitudes for both directions, or arrays by their names."""
    robot = trajectory.robot
    magnitudes = {kind: limits.pop(kind) for kind in MAGNITUDES if kind in limits}
    changed = replace(robot.limits.with_magnitudes(**magnitudes), **limits)
    return replace(trajectory, robot=replace(robot, limits=changed))


def with_tool_speed(trajectory, speed):
    """The motion of a task with this limit on the tool's speed."""
    limits = {"tool_limits": ToolLimits(speed=speed)}
    return replace(trajectory, task=trajectory.task.model_copy(update=limits))


def motion_between(motion, robot, q, **parts):
    """A motion of a robot between two postures, (2, n), at rest in both: one polynomial piece of 1.1 s."""
    rest = np.zeros_like(q)
    parts = {"task_space": "joints", "redundant_joints": ()} | parts
    task = motion.task.model_copy(update={"task_space": parts.pop("task_space")})
    return replace(
        motion,
        task=task,
        robot=robot,
        urdf=robot.urdf,
        times=np.array([0.0, 1.1]),
        phase_ends=np.array([1.1]),
        q=q,
        qdot=rest,
        qddot=rest,
        qddot_before=rest,
        **parts,
    )
