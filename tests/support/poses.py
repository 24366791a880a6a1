"""Paths as a task describes them, and finite differences along paths of poses."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from brachis.path import Path, build_path
from brachis.path.pose import PosePath
from brachis.robot.task_map.protocol import POSE_ROWS
from brachis.task import load_task

START = np.array([0.5, 0.1, 0.3])
TURNED = Rotation.from_rotvec([0.3, -0.5, 0.8])


def pose(position: Any, rotation: Rotation) -> np.ndarray:
    """The twelve coordinates of a pose."""
    return np.concatenate([position, rotation.as_matrix().ravel()])


def rotations(coordinates: np.ndarray) -> Rotation:
    """The orientations of poses, (K, 12)."""
    return Rotation.from_matrix(coordinates[:, 3:].reshape(-1, 3, 3))


def pose_path(
    segments: list[dict[str, Any]], position: Any = START, rotation: Rotation = TURNED
) -> PosePath:
    """The path of poses that segments describe as a task file writes them."""
    task = load_task(
        {"brachis": 1, "start": {"joints": [0]}, "task_space": "pose", "path": segments}
    )
    path = build_path(task.path, pose(position, rotation), POSE_ROWS)
    assert isinstance(path, PosePath)
    return path


def row_path(segments: list[dict[str, Any]], start: Any, rows: Any) -> Path:
    """The path of rows that segments describe as a task file writes them."""
    content = {"brachis": 1, "start": {"joints": [0]}, "redundant_joints": []}
    task = load_task({**content, "task_space": rows, "path": segments})
    path = build_path(task.path, start, rows)
    assert isinstance(path, Path)
    return path


def smooth_places(path: PosePath, distance: float, count: int = 60) -> np.ndarray:
    """Values of s farther than `distance` from where the path is not analytic."""
    s = np.random.default_rng(4).uniform(0.0, 1.0, 4 * count)
    sequence = path
    rough = [
        start + (span.curve.knots - span.first) / sequence.total
        for start, span in zip(sequence.breaks[:-1], sequence.spans, strict=True)
    ]
    return s[np.abs(s[:, None] - np.concatenate(rough)).min(axis=1) > distance][:count]


def central_difference(function: Any, s: np.ndarray, h: float) -> np.ndarray:
    """Derivative to the sixth power of the step."""
    weights = {1: 45.0, 2: -9.0, 3: 1.0}
    return sum(
        w * (function(s + k * h) - function(s - k * h)) for k, w in weights.items()
    ) / (60.0 * h)


def twist_by_difference(path: PosePath, s: np.ndarray, h: float) -> np.ndarray:
    """Body twist from poses alone: the velocity in the tool frame, and the rate of the relative rotation vector."""
    here = rotations(path.sample(s).target)
    velocity = here.inv().apply(
        central_difference(lambda s: path.sample(s).target[:, :3], s, h)
    )
    turning = central_difference(
        lambda s: (here.inv() * rotations(path.sample(s).target)).as_rotvec(), s, h
    )
    return np.concatenate([velocity, turning], axis=1)
