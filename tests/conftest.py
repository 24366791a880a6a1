"""Makes `tests/support` importable (``from support.chains import ...``) and shares what many tests need."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest

_TESTS = Path(__file__).resolve().parent
if str(_TESTS) not in sys.path:
    sys.path.append(str(_TESTS))

# A shell that starts the tests in the background has Ctrl-C ignored; tests that press it want Python's usual handler.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def scara_urdf() -> Path:
    """URDF of the planar arm that comes with brachis."""
    return _TESTS.parent / "robots" / "scara3" / "robot.urdf"
