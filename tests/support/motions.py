"""Decompositions with smooth paths and motions y(t) that they can follow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brachis.feasibility import branch_of
from brachis.ik import find
from brachis.kinematics import ChartMap, ClosedFormMap
from brachis.path import build_path
from brachis.robot import Robot, task_map_of
from brachis.task import load_task


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
    asked = rows if isinstance(rows, str) else list(rows)
    task = load_task({"brachis": 1, "start": {"joints": [0]}, "task_space": asked, "path": list(path)})
    curve = build_path(task.path, space.value(start), space.rows)
    candidate = find(robot, space, redundant)
    branch = branch_of(space, candidate, start, "auto")
    indices = tuple(robot.joint_names.index(name) for name in candidate.redundant_joints)
    assert candidate.solver is not None
    return ClosedFormMap(space, curve, candidate.solver, indices, branch, start)


@dataclass(frozen=True)
class Sway:
    """A smooth motion: s runs from 0 to 1, the redundant joints, or sigma, sway about the start posture."""

    joint_map: ClosedFormMap | ChartMap
    amplitude: float = 0.25

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return y, ydot and yddot at times t in [0, 1], each (K, 1 + r)."""
        columns = [(0.5 - 0.5 * np.cos(np.pi * t), 0.5 * np.pi * np.sin(np.pi * t), 0.5 * np.pi**2 * np.cos(np.pi * t))]
        for place, q in enumerate(self.joint_map.coordinates(0.0, self.joint_map.start)[1:]):
            rate, a = 2.0 + place, self.amplitude
            columns.append((q + a * np.sin(rate * t), a * rate * np.cos(rate * t), -a * rate**2 * np.sin(rate * t)))
        y, ydot, yddot = (np.stack(parts, axis=1) for parts in zip(*columns, strict=True))
        return y, ydot, yddot
