"""Paths of mixed kinds near the tool's path along a joint motion; see `mixed_cases`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin

from brachis.robot import TaskMap

SHAPES = ("line", "arc", "circle", "spline", "blend", "csv")
CLOSED = ("circle",)
"""Those that come back to where they start."""


def random_path(
    rng: np.random.Generator,
    task_map: TaskMap,
    motion: np.ndarray,
    shape: str,
    csv: Path,
) -> list[dict[str, object]]:
    """Segments of a shape near the tool's path along a joint motion, (K, n); writes the CSV file that they need."""
    stated = coordinates_of(task_map, motion)
    poses = len(stated[0]) == 7
    rows, quaternions = (stated[:, :3], stated[:, 3:]) if poses else (stated, None)
    last, half = len(rows) - 1, len(rows) // 2
    if shape == "spline":
        chosen = np.linspace(0, last, int(rng.integers(4, 8))).astype(int)[1:]
        spline: dict[str, object] = {"through": rows[chosen].tolist()}
        if quaternions is not None:
            spline["orientations"] = [
                {"quaternion_wxyz": quaternions[k].tolist()} for k in chosen
            ]
        return [{"spline": spline}]
    if shape == "csv":
        chosen = np.linspace(0, last, int(rng.integers(6, 20))).astype(int)
        header = "x,y,z,qw,qx,qy,qz" if poses else ",".join(task_map.rows)
        np.savetxt(
            csv, stated[chosen], fmt="%.12f", delimiter=",", header=header, comments=""
        )
        return [{"csv": {"file": csv.name, "relative": bool(rng.random() < 0.5)}}]
    turning = poses and rng.random() < 0.6
    ends = [
        {"orientation": _to(rng, quaternions[k])} if turning else {}
        for k in (half, last)
    ]
    if shape == "line":
        return [{"line": {"to": rows[last].tolist()}, **ends[1]}]
    positions = rows[:, : len(task_map.axes)]
    if shape == "arc":
        return [
            {
                "arc": {
                    "via": positions[half].tolist(),
                    "to": positions[last].tolist(),
                },
                **ends[1],
            }
        ]
    if shape == "circle":
        return [_circle(rng, positions[0], turning=turning)]
    corner = rows[half].copy()
    corner[: len(task_map.axes)] += 0.2 * (
        positions[half] - 0.5 * (positions[0] + positions[last])
    )
    sides = np.linalg.norm(
        [
            corner[: len(task_map.axes)] - positions[0],
            positions[last] - corner[: len(task_map.axes)],
        ],
        axis=1,
    )
    first = {
        "line": {"to": corner.tolist()},
        "blend": float(rng.uniform(0.1, 0.4) * sides.min()),
        **ends[0],
    }
    return [first, {"line": {"to": rows[last].tolist()}, **ends[1]}]


def coordinates_of(task_map: TaskMap, motion: np.ndarray) -> np.ndarray:
    """Where the tool is in successive postures, (K, n), as a task states it: rows, or positions and quaternions."""
    values = task_map.values(motion)
    if values.shape[1] == 12:
        quaternions = [
            pin.Quaternion(matrix).coeffs()[[3, 0, 1, 2]]
            for matrix in values[:, 3:].reshape(-1, 3, 3)
        ]
        return np.hstack([values[:, :3], quaternions])
    if "yaw" in task_map.rows:
        values[:, -1] = np.unwrap(values[:, -1])
    return values


def place_of(task_map: TaskMap, q: np.ndarray) -> object:
    """Where the tool is in a posture, (n,), as ``path_start`` of a task."""
    stated = coordinates_of(task_map, q[None])[0].tolist()
    return (
        {"position": stated[:3], "quaternion_wxyz": stated[3:]}
        if len(stated) == 7
        else stated
    )


def _to(rng: np.random.Generator, quaternion: np.ndarray) -> dict[str, object]:
    """Turn to an orientation along a segment."""
    return {
        "to": {
            "quaternion_wxyz": quaternion.tolist(),
            "profile": str(rng.choice(["uniform", "smooth"])),
        }
    }


def _circle(
    rng: np.random.Generator, start: np.ndarray, *, turning: bool
) -> dict[str, object]:
    """Circle, or most of one, through a point, in a random plane; the tool may turn to and fro a little or keep on."""
    normal, across = rng.normal(size=(2, 3))
    if len(start) == 2:
        normal, across = np.array([0.0, 0.0, 1.0]), np.append(across[:2], 0.0)
    out = np.cross(normal, across)
    center = (
        start
        + float(rng.uniform(0.05, 0.25)) * (out / np.linalg.norm(out))[: len(start)]
    )
    turns = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.7, 1.3))
    segment: dict[str, object] = {"circle": {"center": center.tolist(), "turns": turns}}
    if len(start) == 3:
        segment["circle"] |= {"normal": normal.tolist()}
    if turning:
        angle = float(rng.uniform(-50.0, 50.0))
        segment["orientation"] = {
            "rotate": {
                "axis": rng.normal(size=3).tolist(),
                "angle_deg": angle,
                "frame": "tool",
            }
        }
    return segment
