"""An arm to be mounted, and the script that makes the robots of the repository."""

import importlib.util
import sys
from pathlib import Path

import pytest

from support.chains import Joint, chain_urdf

ROOT = Path(__file__).parents[3]
RAIL = {"range": (-2.0, 1.5), "velocity": 2.0, "force": 1500.0, "mass": 80.0}
BASE_INERTIAL = (
    "<link name='base'><inertial><origin xyz='0.01 0.02 0.1'/><mass value='7'/>"
    "<inertia ixx='0.1' iyy='0.1' izz='0.05' ixy='0' ixz='0' iyz='0'/></inertial></link>"
)


def arm_text(*, elements=""):
    """Text of three joints about unlike axes, 4 kg + 3 kg + 2 kg, on a base of 7 kg below ``world``."""
    joints = [
        Joint("revolute", axis=(0.0, 0.0, 1.0), xyz=(0.0, 0.1, 0.4)),
        Joint(
            "revolute", axis=(0.0, 1.0, 0.0), xyz=(0.1, 0.0, 0.2), rpy=(0.1, 0.2, -0.3)
        ),
        Joint("revolute", axis=(1.0, 0.0, 0.2), xyz=(0.3, 0.0, 0.05)),
    ]
    text = chain_urdf(joints, tool=(0.2, 0.1, 0.0), elements=elements)
    return text.replace("<link name='base'/>", BASE_INERTIAL)


@pytest.fixture
def arm(tmp_path):
    """File of that arm."""
    path = tmp_path / "arm" / "arm.urdf"
    path.parent.mkdir()
    path.write_text(arm_text())
    return path


@pytest.fixture(scope="session")
def maker():
    """The script robots/make_robots.py, imported without leaving compiled files in its folder."""
    spec = importlib.util.spec_from_file_location(
        "make_robots", ROOT / "robots/make_robots.py"
    )
    module = importlib.util.module_from_spec(spec)
    before, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        spec.loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = before
    return module
