"""Robots and examples are found from an installed wheel as from the source tree."""

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

import brachis
from brachis.errors import UnknownNameError
from brachis.kernel.compile import find_compiler

ROOT = Path(__file__).parents[1]
FOLDERS = ("src", "robots", "examples")
FILES = ("pyproject.toml", "README.md", "LICENSE", "hatch_build.py")
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


@pytest.fixture
def source(tmp_path):
    """The files of a source distribution without libraries, so that the kernel in use is not compiled anew."""
    folder = tmp_path / "source"
    folder.mkdir()
    for name in (*FILES, *FOLDERS):
        copy = shutil.copytree if name in FOLDERS else shutil.copy
        copy(ROOT / name, folder / name)
    for library in folder.rglob("*.so"):
        library.unlink()
    return folder


@pytest.fixture
def quick_compiler(tmp_path):
    """The machine's compiler without optimisation, as its libraries are used for one small plan."""
    command = find_compiler()
    if command is None:
        pytest.skip("there is no C compiler")
    script = tmp_path / "cc"
    script.write_text(f'#!/bin/sh\nexec {shlex.join(command)} "$@" -O0\n')
    script.chmod(0o755)
    return script


def test_an_installed_wheel_plans_its_example(tmp_path, source, quick_compiler):
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
    compiling = {**os.environ, "CC": str(quick_compiler)}
    subprocess.run(build, cwd=source, env=compiling, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    built = {path.name for path in (tmp_path / "site/brachis/kernel").iterdir()}
    assert {"kernel_baseline.so", "kernel_baseline.sha256"} <= built
    tag = sysconfig.get_platform().partition("-")[0]  # linux or macosx
    assert f"-py3-none-{tag}" in wheel.name
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
    urdf, rail = done.stdout.splitlines()
    assert Path(urdf).resolve() == data / "robots/scara3/robot.urdf"
    assert (
        rail
        == f"{data}/robots/tx90l_rail/robot.urdf {len(brachis.robots.names())} {len(brachis.examples.names())}"
    )
