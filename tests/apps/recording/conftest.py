from pathlib import Path

import numpy as np
import pytest

from brachis import export
from brachis.apps.recording import import_motion
from brachis.planner import plan
from support.effort import QUICK

ROOT = Path(__file__).parents[3]
SCARA = ROOT / "robots/scara3/robot.urdf"
DT = 0.004


def smooth_step(u):
    """From 0 to 1 for u from 0 to 1, with three derivatives that vanish at both ends."""
    return u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)


@pytest.fixture(scope="package")
def motion():
    """A planned motion, which a file has at every 4 ms."""
    content = {
        "brachis": 1,
        "robot": {"urdf": str(SCARA), "gravity": [0, 0, 0]},
        "start": {"joints": [0.5236, -2.0944, 2.0944]},
        "task_space": ["x", "y"],
        "path": [{"line": {"length": 0.8, "angle_deg": 90}}],
        "redundant_joints": ["j3"],
        "search": QUICK,
        "spline": {"intervals": 10},
    }
    return plan(content).trajectory


@pytest.fixture(scope="package")
def table(motion):
    """Times, positions and velocities of the motion."""
    samples = motion.sample(DT)
    return samples.t, samples.q, samples.qdot


@pytest.fixture(scope="package")
def file(motion, tmp_path_factory):
    path = tmp_path_factory.mktemp("today") / "today.csv"
    export.write(motion, path, dt=DT)
    return path


@pytest.fixture(scope="package")
def imported(file, motion):
    return import_motion(file, task=motion.task)


@pytest.fixture
def write(tmp_path):
    def write(header, *columns, fmt="%.17g", name="today.csv"):
        path = tmp_path / name
        np.savetxt(
            path,
            np.column_stack(columns),
            delimiter=",",
            header=header,
            comments="",
            fmt=fmt,
        )
        return path

    return write
