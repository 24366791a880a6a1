"""Tasks as a cell has them: process speeds, stops and dwells beside limits of every kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mixed_robots import ROOT

DOWNWARDS = [0, 1, 0, 0]
"""Quaternion, w first, of a tool that points down."""


def weld(folder: Path) -> dict[str, Any]:
    """Return the task of a welding cell; the points of its seam go into a folder.

    A six-axis arm on a rail comes down to a seam of 0.31 m, welds it at 0.02 m/s and goes up again, among five bodies.
    Its posture is free, and so is the roll of its torch; its jerk is limited, and it carries a payload.
    """
    s = np.linspace(0.0, 1.0, 63)
    points = np.column_stack(
        [
            0.75 + 0.02 * np.sin(2.0 * np.pi * s),
            0.31 * s - 0.15,
            0.35 + 0.01 * np.sin(np.pi * s),
        ]
    )
    rows = np.hstack([points, np.tile(DOWNWARDS, (len(s), 1))])
    np.savetxt(
        folder / "weld.csv",
        rows,
        fmt="%.6f",
        delimiter=",",
        header="x,y,z,qw,qx,qy,qz",
        comments="",
    )
    tolerance = {"position": "0.1 mm", "orientation": "0.1 deg"}
    seam = {"csv": {"file": str(folder / "weld.csv"), "tolerance": tolerance}}
    bodies = {
        "table": ([0.4, 0.8, 0.05], [0.8, 0.0, 0.25]),
        "part": ([0.2, 0.5, 0.04], [0.75, 0.0, 0.295]),
        "fixture": ([0.05, 0.05, 0.2], [0.95, 0.3, 0.4]),
        "fixture 2": ([0.05, 0.05, 0.2], [0.95, -0.35, 0.4]),
        "cabinet": ([0.5, 0.5, 1.5], [-1.0, 0.9, 0.75]),
    }
    return {
        "brachis": 1,
        "robot": {
            "urdf": str(ROOT / "robots/tx90l_rail/robot.urdf"),
            "payload": {"mass": 3.0, "com": [0.0, 0.0, 0.1]},
            "limits": {"jerk": [100, 300, 300, 300, 500, 500, 800]},
        },
        "start": "free",
        "task_space": "pose_free_roll",
        "path_start": {
            "position": (points[0] + [0.0, 0.0, 0.1]).tolist(),
            "quaternion_wxyz": DOWNWARDS,
        },
        "path": [
            {"line": {"by": [0.0, 0.0, -0.1]}, "stop": True},
            {**seam, "speed": 0.02, "stop": True},
            {"line": {"by": [0.0, 0.0, 0.1]}},
        ],
        "scene": [
            {"name": name, "box": size, "position": position}
            for name, (size, position) in bodies.items()
        ],
        "collisions": {"clearance": 0.01},
    }
