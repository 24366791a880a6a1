"""Fixtures of the benchmarks."""

from __future__ import annotations

import importlib
import math
import sys
from pathlib import Path

import pytest

import brachis

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def robot() -> brachis.Robot:
    limits = brachis.LimitSpec(torque=10.0, velocity=None)
    return brachis.Robot.from_urdf(
        ROOT / "robots/scara3/robot.urdf", gravity=[0, 0, 0], limits=limits
    )


@pytest.fixture(scope="session")
def make_task():
    def make(
        joint: str,
        *,
        angle: float = 90.0,
        intervals: int = 20,
        rounds: int = 10,
        solver: str = "auto",
        search: dict[str, object] | None = None,
    ) -> brachis.Task:
        return brachis.load_task(
            {
                "brachis": 1,
                "start": {"joints": [math.pi / 6, -2 * math.pi / 3, 2 * math.pi / 3]},
                "task_space": ["x", "y"],
                "path": [{"line": {"length": 1.0, "angle_deg": angle}}],
                "redundant_joints": "auto" if joint == "auto" else [joint],
                "search": search or {},
                "spline": {"intervals": intervals},
                "refinement": {"max_rounds": rounds},
                "solver": {"name": solver},
            }
        )

    return make


def pytest_benchmark_update_json(output_json):
    """Keep a table of what is saved (``--benchmark-save`` or ``--benchmark-json``) in benchmarks/results."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    committed = importlib.import_module("committed")
    rows = [
        (
            each["fullname"].split("::")[1],
            *(
                f"{1e3 * each['stats'][name]:.3g} ms"
                for name in ("median", "min", "max")
            ),
        )
        for each in output_json["benchmarks"]
    ]
    command = "python -m pytest benchmarks --benchmark-json FILE --benchmark-timer time.process_time"
    committed.write(
        "speed", command, "Timings", ("what", "median", "least", "most"), rows, ""
    )
