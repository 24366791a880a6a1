"""The examples of the guide to task files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from support.poses import pose_path

PAGE = Path(__file__).parents[2] / "docs" / "task_files.md"
EXAMPLES = re.findall(r"^```yaml\n(.*?)^```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def test_there_are_examples() -> None:
    assert len(EXAMPLES) == 2


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_are_paths(example: str) -> None:
    content = yaml.safe_load(example)
    assert content["task_space"] == "pose"
    path = pose_path(content["path"], np.zeros(3), Rotation.identity())
    assert np.abs(path.sample([0.0, 0.5, 1.0]).xi[:, 3:]).max() > 0.1
