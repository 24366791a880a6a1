from pathlib import Path

import pytest
import yaml

from brachis.planner import plan
from support.effort import QUICK

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def planned():
    """A planned line whose limits of every kind are far from the motion, but for torque."""
    task = yaml.safe_load((ROOT / "examples/01_scara_line.yaml").read_text())
    task["robot"]["urdf"] = str(ROOT / "robots/scara3/robot.urdf")
    task["robot"]["limits"] = {
        "torque": 10,
        "velocity": 50,
        "acceleration": 500,
        "position": [[-10, 10]] * 3,
    }
    result = plan(task, **QUICK)
    assert result.verified
    return result.trajectory
