"""Makes `tests/support` importable (``from support.chains import ...``) and shares what many tests need."""

from __future__ import annotations

import gc
import importlib
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import hypothesis
import pytest

_TESTS = Path(__file__).resolve().parent
_LONG = (
    "test_browser.py",
    "test_readme.py",
    "test_wheel.py",
    "test_fuzz.py",
    "test_auto_on_robots.py",
)
"""Tests of these files take longest: they come first, so that no worker is left alone with one at last."""
_CHROMIUM = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-unsafe-swiftshader",
)
_WITH_DEADLINES = (
    "brachis.common.deadline",
    "brachis.optimise.backends.monitor",
    "brachis.apps.bottleneck.reference",
)
"""Modules that look at the clock to see whether the time is up."""
if str(_TESTS) not in sys.path:
    sys.path.append(str(_TESTS))
    sys.modules["bottleneck"] = None  # type: ignore[assignment]  # pandas would take the folder for a package it may use

# The many processes that tests start would compile the package again and again, a third of their time.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Properties hold on a busy machine too.
hypothesis.settings.register_profile("brachis", deadline=None, derandomize=True)
hypothesis.settings.load_profile("brachis")

# A shell that starts the tests in the background has Ctrl-C ignored; tests that press it want Python's usual handler.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Look for garbage neither while all tests are imported, a fifth of that time, nor later among what they hold."""
    gc.disable()
    found = yield
    gc.freeze()
    gc.enable()
    return found


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let long tests come first."""
    items.sort(key=lambda item: item.path.name not in _LONG)


@pytest.fixture(scope="session", autouse=True)
def _busy_machine_takes_no_time() -> Iterator[None]:
    """Let deadlines count this process's own time, so that no plan runs out of time because others are at work."""
    own = SimpleNamespace(monotonic=time.process_time, perf_counter=time.process_time)
    with pytest.MonkeyPatch.context() as patch:
        for module in _WITH_DEADLINES:
            patch.setattr(f"{module}.time", own)
        yield


@pytest.fixture
def wall_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let deadlines be moments that other processes know, too."""
    for module in _WITH_DEADLINES:
        monkeypatch.setattr(f"{module}.time", time)


@pytest.fixture
def rough_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures that are made and written as files of few pixels, but not drawn; tests of plots have the real ones."""
    from brachis.apps.plots import style

    honest = style.new_figure

    def rough(width: float, height: float) -> Any:
        figure = honest(width, height)
        figure.set_layout_engine("none")
        figure.draw = lambda _renderer: None
        return figure

    monkeypatch.setattr(style, "new_figure", rough)
    monkeypatch.setattr("brachis.apps.plots.style._DPI", 30)


@pytest.fixture(scope="session")
def scara_urdf() -> Path:
    """URDF of the planar arm that comes with brachis."""
    return _TESTS.parent / "robots" / "scara3" / "robot.urdf"


@pytest.fixture(scope="session")
def line_result() -> Any:
    """The first example, planned from one start."""
    import brachis
    from support.effort import QUICK

    return brachis.plan(brachis.examples.scara_line, **QUICK)


@pytest.fixture(scope="session")
def line_trajectory(line_result: Any) -> Any:
    return line_result.trajectory


@pytest.fixture(scope="session")
def cycle() -> Any:
    """The plan of a program."""
    import brachis
    from support.cycle import CYCLE

    return brachis.plan(CYCLE)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """A Chromium that is installed here, without a window; one for all tests, as its driver allows."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed"
    )
    chromium = next(
        filter(
            None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))
        ),
        None,
    )
    if chromium is None:
        pytest.skip("there is no Chromium: apt-get install chromium")
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=chromium, args=list(_CHROMIUM))
        yield started
        started.close()


@pytest.fixture(scope="module")
def bench() -> Iterator[Callable[[str], ModuleType]]:
    """Import modules of the benchmarks by name."""
    folder = str(_TESTS.parent / "benchmarks")
    sys.path.insert(0, folder)
    try:
        yield importlib.import_module
    finally:
        sys.path.remove(folder)
