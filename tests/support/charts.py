"""Charts around joint paths that move as little as the path allows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.linalg import null_space, orthogonal_procrustes

from brachis.kinematics import ChartMap, ChartRows
from brachis.path import Path, build_path
from brachis.robot import Robot, TaskMap, bind
from brachis.task import load_task

PLACES = 33


def path_from(
    robot: Robot, rows: str | Sequence[str], segments: list[dict[str, Any]], start: Any
) -> Any:
    """Task map and path from a start posture; the segments as a task file writes them."""
    robot, task_map = bind(robot, rows)
    rows = rows if isinstance(rows, str) else list(rows)
    start = np.array(start, dtype=float)
    task = load_task(
        {
            "brachis": 1,
            "start": {"joints": start.tolist()},
            "task_space": rows,
            "path": segments,
        }
    )
    return task_map, build_path(task.path, task_map.value(start), task_map.rows)


def jacobian(task_map: TaskMap, q: np.ndarray) -> np.ndarray:
    """Pinocchio's task Jacobian (K, m, n)."""
    model = task_map.robot.model
    data = model.createData()
    tool = task_map.robot.frame_id
    axes = (
        pin.ReferenceFrame.LOCAL
        if task_map.in_tool_axes
        else pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    )
    columns = [pin.computeFrameJacobian(model, data, own, tool, axes) for own in q]
    shape = (len(q), 6, model.nv)
    return task_map.jacobian(np.moveaxis(np.reshape(columns, shape), 1, 0))


def least_motion(
    task_map: TaskMap, path: Path, start: Any, s: np.ndarray
) -> np.ndarray:
    """Postures (S, n), from each to the next by steps of the pseudo-inverse."""
    q = [np.array(start, dtype=float)]
    for target in path.sample(s[1:]).target:
        here = q[-1]
        for _ in range(20):
            miss = task_map.difference(target[None], task_map.values(here[None]))[0]
            if np.abs(miss).max() < 1e-13:
                break
            here = here + np.linalg.pinv(jacobian(task_map, here[None])[0]) @ miss
        q.append(here)
    return np.array(q)


def turned_null_spaces(task_map: TaskMap, q: np.ndarray) -> np.ndarray:
    """Rows (S, r, n) that span the null space in postures (S, n), each as near as possible to those before."""
    rows = [null_space(one).T for one in jacobian(task_map, q)]
    for k in range(1, len(rows)):
        if len(rows[k]):
            rows[k] = orthogonal_procrustes(rows[k].T, rows[k - 1].T)[0].T @ rows[k]
    return np.array(rows)


def chart_of(
    robot: Robot,
    rows: str | Sequence[str],
    segments: list[dict[str, Any]],
    start: Any,
    kind: str,
) -> ChartMap:
    """Chart along the least motion; its rows are ``constant``, ``following`` the null space or ``swinging``."""
    task_map, path = path_from(robot, rows, segments, start)
    s = np.linspace(0.0, 1.0, PLACES)
    reference = least_motion(task_map, path, start, s)
    null = turned_null_spaces(task_map, reference)
    if kind == "swinging":
        aside = np.random.default_rng(2).normal(size=null.shape[1:])
        null = null + 0.3 * np.sin(4.0 * s)[:, None, None] * aside / np.linalg.norm(
            aside
        )
    chosen = (
        ChartRows.constant(null.mean(axis=0))
        if kind == "constant"
        else ChartRows.along(s, null, reference)
    )
    return ChartMap(task_map, path, chosen, s, reference)
