"""The examples of the guide to task files."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import brachis
from brachis.path import build_path
from support.poses import pose_path
from support.seams import wave

PAGE = Path(__file__).parents[2] / "docs" / "task_files.md"
SNIPPETS = re.findall(
    r"^```yaml\n(.*?)^```",
    PAGE.read_text(encoding="utf-8"),
    flags=re.DOTALL | re.MULTILINE,
)
EXAMPLES = [
    text for text in SNIPPETS if "path" in yaml.safe_load(text.replace("!degrees", ""))
]


OF_ROWS = [text for text in EXAMPLES if "task_space: [" in text]
OF_POSES = [text for text in EXAMPLES if text not in OF_ROWS]


def test_there_are_examples():
    assert (len(OF_ROWS), len(OF_POSES)) == (2, 4)


@pytest.mark.parametrize("example", OF_ROWS)
def test_examples_of_rows_are_paths(example):
    content = yaml.safe_load(example)
    start = {"joints": [0.1, 0.5, 0.2, -1.2, 0.3, 0.9, 0.1]}
    usual = {"brachis": 1, "robot": {"urdf": "iiwa14"}, "start": start}
    task = brachis.load_task({**usual, **content})
    rows = tuple(content["task_space"])
    coordinates = np.zeros(4)
    if rows[-1] == "axis":
        rows = (*rows[:-1], "rx", "ry", "rz")
        coordinates = np.concatenate([np.zeros(2), np.eye(3).ravel()])
    path = build_path(task.path, coordinates, rows)
    assert np.abs(path.sample([0.0, 0.5, 1.0]).xi[:, 3:]).max() > 0.1


def test_the_curve_of_a_data_sheet_is_taken():
    (curve,) = (yaml.safe_load(text) for text in SNIPPETS if "torque_speed" in text)
    robot = brachis.robots.scara3.with_limits(**curve["robot"]["limits"])
    to_joint, torque = 2.0 * np.pi / 60.0 / 50.0, 1.27 * 50 * 0.8
    expected = [[0.0, torque], [3000 * to_joint, torque], [4500 * to_joint, 0.0]]
    np.testing.assert_allclose(robot.limits.torque_speed[0], expected, rtol=1e-3)


def test_the_limits_of_ros_are_read(tmp_path):
    (text,) = (text for text in SNIPPETS if "joint_limits" in text)
    (tmp_path / "joint_limits.yaml").write_text(text, encoding="utf-8")
    limits = brachis.read_limits(tmp_path / "joint_limits.yaml")
    assert limits.velocity == {"shoulder_pan_joint": pytest.approx(np.radians(120.0))}


@pytest.mark.parametrize("example", OF_POSES)
def test_examples_are_paths(example, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content = yaml.safe_load(example)
    start = np.zeros(3)
    if "csv" in content["path"][0]:
        degrees = np.linspace(0.0, 20.0, 200)[:, None] * [1.0, 0.0, 0.0]
        rows, start = np.hstack([1e3 * wave(200), degrees]), wave(200)[0]
        np.savetxt("seam.csv", rows, header="x,y,z,a,b,c", delimiter=",", comments="")
    assert content["task_space"] == "pose"
    path = pose_path(content["path"], start, Rotation.identity())
    assert np.abs(path.sample([0.0, 0.5, 1.0]).xi[:, 3:]).max() > 0.1
