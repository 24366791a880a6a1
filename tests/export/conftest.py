from pathlib import Path

import pytest

from brachis.planner import plan

EXAMPLE = Path(__file__).parents[2] / "examples" / "01_scara_line.yaml"


@pytest.fixture(scope="session")
def line_trajectory():
    return plan(EXAMPLE).trajectory
