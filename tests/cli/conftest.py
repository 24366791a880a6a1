"""Running the command line in this process."""

from __future__ import annotations

import copy
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from brachis import completion
from brachis.cli.main import main
from brachis.trajectory import Trajectory
from brachis.verify import Verification, VerifyOptions

ROOT = Path(__file__).parents[2]
SCARA = ROOT / "robots/scara3/robot.urdf"


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str


@pytest.fixture(autouse=True)
def own_interrupts(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The command line takes over SIGINT for good; the next test gets it back."""
    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    def run(*arguments: object, columns: int = 200) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["brachis", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", str(columns))
        code: object = 0
        try:
            main()
        except SystemExit as stop:
            code = stop.code or 0
        streams = capfd.readouterr()
        return Outcome(int(code), streams.out, streams.err)

    return run


@pytest.fixture
def too_strict(monkeypatch: pytest.MonkeyPatch) -> None:
    """A verification that passes nothing, and after which the time for further attempts is up."""
    honest, now = completion.verify_trajectory, [0.0]
    strict = VerifyOptions(ratio_tolerance=-0.5)

    def refusing(trajectory: Trajectory, **more: object) -> Verification:
        now[0] += 90.0
        return honest(trajectory, strict, **more)

    monkeypatch.setattr(completion, "verify_trajectory", refusing)
    monkeypatch.setattr("brachis.deadline.time.monotonic", lambda: now[0])


@pytest.fixture
def task() -> dict:
    """The first example as a mapping, with an absolute URDF path."""
    content = yaml.safe_load((ROOT / "examples/01_scara_line.yaml").read_text())
    content["robot"]["urdf"] = str(SCARA)
    return copy.deepcopy(content)


@pytest.fixture
def write(tmp_path: Path) -> Callable[[dict], Path]:
    def write(content: dict) -> Path:
        path = tmp_path / "task.yaml"
        path.write_text(yaml.safe_dump(content))
        return path

    return write
