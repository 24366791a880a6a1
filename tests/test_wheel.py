"""Robots and examples are found from an installed wheel as from the source tree."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import brachis
from brachis.errors import UnknownNameError

ROOT = Path(__file__).parents[1]
SCRIPT = """
import brachis
result = brachis.plan(brachis.examples.scara_line, redundant_joints=["j1"], intervals=8, effort="single")
print(result.trajectory.robot.source)
print(brachis.robots.path_of("tx90l_rail"), len(brachis.robots.names()), len(brachis.examples.names()))
"""


def test_names_are_those_of_the_folders():
    assert set(brachis.robots.names()) == {
        path.name for path in (ROOT / "robots").iterdir() if path.is_dir()
    }
    assert brachis.robots.path_of("scara3") == ROOT / "robots/scara3/robot.urdf"
    assert brachis.examples.cam_seam == ROOT / "examples/08_cam_seam.yaml"


def test_unknown_names_are_answered_with_those_there_are():
    with pytest.raises(UnknownNameError, match="scara3"):
        brachis.robots.path_of("scara")
    with pytest.raises(AttributeError, match="scara3"):
        _ = brachis.robots.scara
    with pytest.raises(AttributeError, match="scara_line"):
        _ = brachis.examples.scara


def test_an_installed_wheel_plans_its_example(tmp_path):
    build = [
        sys.executable,
        "-m",
        "hatchling",
        "build",
        "-t",
        "wheel",
        "-d",
        str(tmp_path),
    ]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "site")}
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env=environment,
        check=True,
        capture_output=True,
        text=True,
    )
    data = tmp_path / "site/brachis/data"
    source, rail = done.stdout.splitlines()
    assert Path(source).resolve() == data / "robots/scara3/robot.urdf"
    assert (
        rail
        == f"{data}/robots/tx90l_rail/robot.urdf {len(brachis.robots.names())} {len(brachis.examples.names())}"
    )
