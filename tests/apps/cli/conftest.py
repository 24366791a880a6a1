"""Running the command line in this process."""

from __future__ import annotations

import contextlib
import io
import json
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import yaml

from brachis.search import verified
from brachis.verify import VerifyOptions
from support.command_line import code_of, interrupts_kept
from support.effort import QUICK

ROOT = Path(__file__).parents[3]
SCARA = ROOT / "robots/scara3/robot.urdf"


@dataclass(frozen=True)
class Outcome:
    out: str
    err: str

    @property
    def data(self):
        """What was printed as JSON."""
        return json.loads(self.out)


@pytest.fixture(autouse=True)
def own_interrupts(rough_figures):  # noqa: ARG001
    with interrupts_kept():
        yield


@pytest.fixture
def run(capfd):
    def run(*words, code=0, columns=200):
        """Run a command as it is typed, or word by word; it ends with this exit code."""
        command = words if len(words) != 1 else shlex.split(words[0])
        exit_code = code_of(*command, columns=columns)
        streams = capfd.readouterr()
        assert exit_code == code, streams.err
        return Outcome(streams.out, streams.err)

    return run


@pytest.fixture
def error_of(run):
    """What a command with wrong input says."""
    return lambda *words: run(*words, code=2).err


@pytest.fixture
def too_strict(monkeypatch):
    """A verification that passes nothing, and after which the time for further attempts is up."""
    honest, now = verified.verify_trajectory, [0.0]
    strict = VerifyOptions(ratio_tolerance=-0.5)

    def refusing(trajectory, **more):
        now[0] += 90.0
        return honest(trajectory, strict, **more)

    monkeypatch.setattr(verified, "verify_trajectory", refusing)
    monkeypatch.setattr("brachis.common.deadline.time.monotonic", lambda: now[0])


def quick_task():
    content = yaml.safe_load((ROOT / "examples/01_scara_line.yaml").read_text())
    content["robot"]["urdf"] = str(SCARA)
    content["search"] = QUICK
    return content


@pytest.fixture
def task():
    """The first example with few intervals as a mapping, with an absolute URDF path, planned from its one start."""
    return quick_task() | {"spline": {"intervals": 8}}


@dataclass(frozen=True)
class Planned:
    """What ``brachis plan --out`` printed and wrote of that task; for those who write, a copy is theirs."""

    data: dict
    out: Path

    def copied(self, to):
        return shutil.copytree(self.out, to)


@pytest.fixture
def result(planned):
    """The file of that motion."""
    return planned.out / "result.npz"


@pytest.fixture(scope="session")
def planned(tmp_path_factory):
    folder, printed = tmp_path_factory.mktemp("planned"), io.StringIO()
    (folder / "task.yaml").write_text(yaml.safe_dump(quick_task()))
    with interrupts_kept(), contextlib.redirect_stdout(printed):
        command = ("plan", folder / "task.yaml", "--out", folder / "out", "--json")
        assert code_of(*command) == 0
    return Planned(json.loads(printed.getvalue()), folder / "out")


@pytest.fixture
def write(tmp_path):
    def write(content):
        path = tmp_path / "task.yaml"
        path.write_text(yaml.safe_dump(content))
        return path

    return write


@pytest.fixture
def seam(task, write, tmp_path):
    """A task along points that scatter by 0.02 mm, in mm with decimal commas."""
    y = np.linspace(0.0, 600.0, 1_500)
    x = 1732.0508 + 20.0 * np.sin(y / 100.0)
    scatter = np.random.default_rng(5).normal(size=(2, 1_500)) * 0.02
    rows = (
        f"{a:.4f};{b:.4f}".replace(".", ",")
        for a, b in zip(x + scatter[0], y + scatter[1], strict=True)
    )
    (tmp_path / "seam.csv").write_text("\n".join(["x_mm;y_mm", *rows]))
    task["path"] = [{"csv": {"file": "seam.csv", "tolerance": {"position": "0.12 mm"}}}]
    return write({**task, "start": "free", "redundant_joints": ["j1"], "search": QUICK})
